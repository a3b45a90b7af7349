"""Bad input ends in one clear error, and the daemon still serves."""

import pathlib
import random
import tempfile
import unittest

import streets
from programs import Daemon

ROW = "1 0 0 0 0 1 0 0 0 0 1 0\n"


class BadInput(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        cls.session = streets.simulate(cls.scratch / "street", scans=4)[0]
        cls.daemon = cls.enterClassContext(Daemon())
        cls.daemon.cli("map", "create", "site")

    def refused(self, directory, status, *expected, flags=(), before_sending=True):
        """The upload ends with this status and one line that says all of `expected`, before anything was sent or later."""
        before = self.daemon.json("session", "list", "site")
        done = self.daemon.cli("session", "upload", "site", directory, *flags, check=status)
        message = done.stderr.strip().splitlines()[-1]
        for words in expected:
            self.assertIn(words, message)
        if before_sending:
            self.assertEqual(self.daemon.json("session", "list", "site"), before, "something was uploaded")
        self.daemon.cli("map", "info", "site")

    def spoiled(self, **files):
        return streets.spoil(self.session, pathlib.Path(tempfile.mkdtemp(dir=self.scratch)) / "session", **files)

    def test_scan_files(self):
        scan = (self.session / "velodyne/000001.bin").read_bytes()
        truncated = self.spoiled(velodyne__000001_dot_bin=scan[:-7])
        self.refused(truncated, 2, "velodyne/000001.bin", "16")
        noise = random.Random(1).randbytes(16 * 5000)
        self.refused(self.spoiled(velodyne__000001_dot_bin=noise), 2, "velodyne/000001.bin")
        self.refused(self.spoiled(velodyne__000002_dot_bin=b""), 2, "velodyne/000002.bin", "empty")
        holed = streets.points((1, 2, 3, 0.5), (4, float("nan"), 6, 0.5))
        self.refused(self.spoiled(velodyne__000003_dot_bin=holed), 2, "velodyne/000003.bin", "point 1")

    def test_poses(self):
        for poses, words in {
            ROW * 3: "4",
            ROW * 2 + "1 0 0 0 0 1 0 0 0 0 1\n" + ROW: "poses.txt:3",
            ROW + ROW.replace("1 0 0 0 ", "1 0 0 nan ", 1) + ROW * 2: "poses.txt:2",
            ROW * 3 + ROW.replace("1", "2"): "poses.txt:4",
        }.items():
            self.refused(self.spoiled(poses_dot_txt=poses), 2, "poses.txt", words)

    def test_what_only_the_server_can_know(self):
        far = self.spoiled(poses_dot_txt=ROW + ROW.replace("1 0 0 0 ", "1 0 0 900000 ", 1) + ROW * 2)
        self.refused(far, 2, "scan 1", "range", flags=("--id", "far"), before_sending=False)
        unknown = self.daemon.cli("session", "upload", "nowhere", self.session, check=1)
        self.assertIn("nowhere", unknown.stderr)
        self.daemon.cli("session", "upload", "site", self.session, "--id", "once")
        self.refused(self.spoiled(poses_dot_txt=ROW * 4), 1, "once", flags=("--id", "once"), before_sending=False)
        self.daemon.cli("session", "upload", "site", self.session, "--id", "once", "--wait")

    def test_usage(self):
        for words in (["map", "create", "../x"], ["map", "create", "y", "--voxel-size", "0"],
                      ["session", "upload", "site", self.scratch / "absent"], ["query", "site", "1", "2"], ["sing"]):
            self.daemon.cli(*words, check=2)


if __name__ == "__main__":
    unittest.main(verbosity=2)
