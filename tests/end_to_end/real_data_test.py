"""The promises on real data: 77 scans of KITTI, in ../shared/data (skipped where that folder is absent)."""

import os
import pathlib
import subprocess
import tempfile
import unittest

from programs import ROOT, Daemon, clean, run, score

ARCHIVE = ROOT.parent / "shared/data/kitti-0005-first77.tar.xz"
UNPACKED = pathlib.Path(os.environ["MAPKEEP_SCRATCH"]) / "kitti-0005-first77"


def setUpModule():
    if not ARCHIVE.exists():
        raise unittest.SkipTest(f"{ARCHIVE} is not on this machine")
    if not UNPACKED.exists():
        with tempfile.TemporaryDirectory(dir=UNPACKED.parent) as scratch:
            subprocess.run(["tar", "xf", ARCHIVE, "-C", scratch], check=True, timeout=300)
            os.rename(pathlib.Path(scratch) / UNPACKED.name, UNPACKED)


class RealData(unittest.TestCase):
    def test_the_demo_leaves_a_clean_map(self):
        with tempfile.TemporaryDirectory() as out:
            demo = run(ROOT / "deploy/demo", "--data", UNPACKED, "--out", out)
            self.assertIn("state: committed", demo.stdout)
            scores = score("map", UNPACKED, pathlib.Path(out) / "map.pcd")
            print("demo map:", scores)
            self.assertGreaterEqual(scores["AA"], 98)

    def test_cleaning_offline_labels_every_point(self):
        with tempfile.TemporaryDirectory() as out:
            clean(UNPACKED, out)
            scores = score("labels", UNPACKED / "label", pathlib.Path(out) / "labels")
            print("clean labels:", scores)
            self.assertGreaterEqual(scores["AA"], 98.5)

    def test_two_sessions_make_one_clean_map(self):
        with Daemon() as daemon, tempfile.TemporaryDirectory() as out:
            daemon.cli("map", "create", "street")
            for frames, session in (("0:37", "first"), ("38:76", "second")):
                daemon.cli("session", "upload", "street", UNPACKED, "--frames", frames, "--id", session, "--wait")
            cloud = pathlib.Path(out) / "map.pcd"
            daemon.cli("export", "street", cloud)
            scores = score("map", UNPACKED, cloud)
            print("map of two sessions:", scores)
            self.assertGreaterEqual(scores["AA"], 97)


if __name__ == "__main__":
    unittest.main(verbosity=2)
