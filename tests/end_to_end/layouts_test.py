"""One simulated session gives the same map in whichever layout it lies."""

import pathlib
import tempfile
import unittest

import numpy as np
from scipy.spatial import cKDTree

from programs import BIN, Daemon, run


def points_of(pcd):
    """x y z of an exported map: float32 x y z intensity after the header."""
    return np.frombuffer(pcd[pcd.index(b"DATA binary\n") + len(b"DATA binary\n"):], "<f4").reshape(-1, 4)[:, :3]


class Layouts(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        cls.maps = {}
        with Daemon() as daemon:
            for layout in ("kitti", "elite", "kth"):
                run(BIN / "mapkeep", "simulate", scratch / layout, "--sessions", 1, "--scans", 24, "--sensor", "vlp16",
                    "--layout", layout)
                daemon.cli("map", "create", layout)
                daemon.cli("session", "upload", layout, scratch / layout / "session-01", "--id", "day", "--wait")
                cls.maps[layout] = daemon.export(layout)

    def test_equal_points_give_equal_bytes(self):
        self.assertGreater(len(self.maps["kitti"]), 100_000, "the map is all but empty")
        self.assertEqual(self.maps["kitti"], self.maps["elite"])

    def test_points_that_were_rounded_in_the_world_frame_give_the_map_within_a_centimetre(self):
        kitti, kth = points_of(self.maps["kitti"]), points_of(self.maps["kth"])
        for one, other in ((kitti, kth), (kth, kitti)):
            near = cKDTree(other).query(one)[0] <= 0.01
            # A point on the border of two voxels may be counted in the other one.
            self.assertGreater(near.mean(), 0.999, f"{(~near).sum()} of {near.size} are farther off")


if __name__ == "__main__":
    unittest.main(verbosity=2)
