"""A recording gives the session that it was made of, however it is compressed; what is wrong with one is named."""

import json
import pathlib
import tempfile
import unittest

import numpy as np

from npm import node
from programs import BIN, clean, run
from streets import simulate


class Recordings(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        cls.session = simulate(cls.scratch / "street", scans=12)[0]
        clean(cls.session, cls.scratch / "expected")

    def record(self, compression):
        out = self.scratch / f"{compression}.mcap"
        if not out.exists():
            node("mcap.mjs", self.session, out, compression)
        return out

    def test_an_mcap_file_gives_the_labels_of_the_session_that_it_holds(self):
        expected = [np.fromfile(f, "<u4") for f in sorted((self.scratch / "expected/labels").iterdir())]
        self.assertEqual(len(expected), 12)
        for compression in ("zstd", "lz4", "none", "flat"):
            with self.subTest(compression):
                out = self.scratch / f"cleaned-{compression}"
                clean(self.record(compression), out)
                labels = [np.fromfile(f, "<u4") for f in sorted((out / "labels").iterdir())]
                self.assertEqual([len(a) for a in labels], [len(b) for b in expected])
                same = sum((a == b).sum() for a, b in zip(labels, expected)) / sum(map(len, expected))
                # The poses went through a quaternion and back.
                self.assertGreater(same, 0.9995)

    def test_a_directory_of_files_is_one_session(self):
        folder = self.scratch / "bag"
        folder.mkdir()
        (folder / "bag_0.mcap").write_bytes(self.record("zstd").read_bytes())
        (folder / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
        report = json.loads(run(BIN / "mapkeep", "--json", "clean", folder, self.scratch / "of-folder").stdout)
        self.assertEqual(report["scans"], 12)

    def test_what_is_wrong_is_named(self):
        whole = self.record("zstd").read_bytes()
        bad = self.scratch / "bad.mcap"

        def error(content, *flags):
            bad.write_bytes(content)
            return clean(bad, self.scratch / "never", *flags, check=2).stderr

        self.assertIn(f"{bad}: at byte ", error(whole[:len(whole) // 2]))
        self.assertIn("the recording was broken off; `mcap recover` mends it", error(whole[:len(whole) // 2]))
        flipped = bytearray(whole)
        flipped[len(whole) // 3] ^= 0xff
        self.assertIn(f"{bad}: at byte ", error(bytes(flipped)))
        self.assertIn("neither a ROS 1 bag nor an MCAP file", error(b"nothing of the kind"))
        unknown = error(whole, "--points-topic", "/nope")
        self.assertIn("--points-topic /nope: no topic of that name and a type that fits: it holds ", unknown)
        self.assertIn("/lidar/points (sensor_msgs/msg/PointCloud2, 12)", unknown)
        self.assertIn("topic /lidar/points, message 0: its points have no times: --deskew is not for it",
                      error(whole, "--deskew"))
        self.assertIn("layout kitti has no times of points: --deskew",
                      clean(self.session, self.scratch / "never", "--deskew", check=2).stderr)
        self.assertFalse((self.scratch / "never").exists())


if __name__ == "__main__":
    unittest.main(verbosity=2)
