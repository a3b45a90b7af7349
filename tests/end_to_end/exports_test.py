"""What mapkeep exports is read by software of others, and comes back whole from an archive."""

import pathlib
import tempfile
import time
import unittest

import numpy as np

from npm import node
from programs import BIN, Daemon, run
from streets import simulate

ORIGIN = (500_000.25, 5_400_000.5, 300.125)


def points_of(pcd):
    """x y z intensity of an exported map: float32 after the header."""
    return np.frombuffer(pcd[pcd.index(b"DATA binary\n") + len(b"DATA binary\n"):], "<f4").reshape(-1, 4)


def in_order(points):
    return points[np.lexsort(points.T)]


class Exports(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        cls.daemon = cls.enterClassContext(Daemon())
        for day, directory in enumerate(simulate(cls.scratch / "street", sessions=2)):
            if day == 0:
                cls.daemon.cli("map", "create", "street", "--origin", ",".join(map(str, ORIGIN)), "--crs", "EPSG:25832")
                # The session's odometry is absolute: its poses lie in the CRS.
                poses = np.loadtxt(directory / "poses.txt")
                offset = np.array(ORIGIN)
            poses = np.loadtxt(directory / "poses.txt")
            poses[:, [3, 7, 11]] += offset
            np.savetxt(directory / "poses.txt", poses, fmt="%.9f")
            cls.daemon.cli("session", "upload", "street", directory, "--id", f"day-{day}", "--wait")

    def export(self, name, *flags):
        out = self.scratch / name
        out.unlink(missing_ok=True)
        return self.daemon.json("export", "street", out, *flags), out

    def test_las_holds_the_points_of_the_map_in_its_crs(self):
        report, las = self.export("map.las")
        self.assertEqual(report["format"], "las")
        read = node("las.mjs", las)
        header = read["header"]
        self.assertEqual((header["majorVersion"], header["minorVersion"]), (1, 4))
        self.assertEqual(header["pointDataRecordFormat"], 6)
        self.assertEqual(header["pointCount"], report["points"])
        self.assertEqual(header["pointCountByReturn"], [report["points"]] + [0] * 14)
        self.assertTrue(header["globalEncoding"] & 16, "the WKT bit")
        self.assertIn("ETRS89 / UTM zone 32N", read["wkt"])
        self.assertTrue(read["wkt"].startswith("PROJCS["), read["wkt"])
        columns = {name: np.array(values) for name, values in read["columns"].items()}
        xyz = np.stack([columns[c] for c in "XYZ"], axis=1)
        expected = points_of(self.export("map.pcd")[1].read_bytes())
        self.assertEqual(len(xyz), len(expected))
        # Both files hold the points in one order.
        np.testing.assert_allclose(xyz, expected[:, :3].astype(float) + ORIGIN, atol=0.0006)
        np.testing.assert_allclose(columns["Intensity"] / 65535, expected[:, 3], atol=1e-6)
        np.testing.assert_allclose(header["min"], xyz.min(axis=0), atol=1e-6)
        np.testing.assert_allclose(header["max"], xyz.max(axis=0), atol=1e-6)
        self.assertEqual(set(columns["Classification"]), {1, 2}, "ground, and what is not")
        self.assertEqual((set(columns["ReturnNumber"]), set(columns["NumberOfReturns"])), ({1}, {1}))
        self.assertTrue(((columns["stability"] > 0) & (columns["stability"] <= 1)).all())
        self.assertGreater(len(set(columns["stability"])), 10)
        # 2026-06-01 and -02, 08:00 UTC, in adjusted standard GPS time.
        days = [1780300800 + 86400 * day - 315964800 + 18 - 1e9 for day in range(2)]
        self.assertEqual(set(columns["GpsTime"]), set(days))
        # What loaders.gl gives.
        self.assertEqual(read["loaders"]["count"], report["points"])
        np.testing.assert_allclose(np.array(read["loaders"]["positions"]).reshape(-1, 3), xyz, atol=0.001)

    def test_gltf_and_3d_tiles_hold_every_point_once(self):
        expected = points_of(self.export("all.pcd")[1].read_bytes())
        las = self.scratch / "map.las"
        self.daemon.cli("export", "street", las)
        ground = int((np.array(node("las.mjs", las)["columns"]["Classification"]) == 2).sum())
        glb = self.scratch / "map.glb"
        tiles = self.scratch / "tiles"
        for out, flags in ((glb, ()), (tiles, ("--format", "3dtiles"))):
            with self.subTest(out.name):
                report = self.daemon.json("export", "street", out, *flags)
                self.assertEqual(report["points"], len(expected))
                read = node("tiles.mjs", out)
                self.assertEqual((read["errors"], read["messages"]), (0, []))
                self.assertEqual(read["points"], len(expected))
                np.testing.assert_allclose(read["min"], expected[:, :3].min(axis=0), atol=1e-3)
                np.testing.assert_allclose(read["max"], expected[:, :3].max(axis=0), atol=1e-3)
                self.assertEqual(read["ground"], ground)
                self.assertLessEqual({"POSITION", "NORMAL", "COLOR_0", "_STABILITY", "_AGE", "_GROUND", "_INTENSITY"},
                                     set(read["attributes"]))
        self.assertEqual(read["version"], "1.1")
        self.assertGreater(read["files"], 3)

    def test_an_archive_brings_every_voxel_back(self):
        report, first = self.export("map.mkmap")
        before = self.daemon.json("map", "info", "street")
        self.assertEqual(report["voxels"], before["voxels"])
        after = self.daemon.json("import", "copy", first)
        self.assertEqual(after["epoch"], 1)
        for key in ("voxels", "static_voxels", "blocks", "tiles", "origin", "crs", "voxel_size", "bounds"):
            self.assertEqual(after[key], before[key], key)
        second = self.scratch / "copy.mkmap"
        self.daemon.cli("export", "copy", second)
        self.assertEqual(first.read_bytes(), second.read_bytes())
        self.assertEqual(self.daemon.json("admin", "check", "copy")["problem_count"], 0)
        # It is a map like any other: a session can be added, and taken back.
        session = self.scratch / "street" / "session-01"
        self.daemon.cli("session", "upload", "copy", session, "--id", "more", "--wait")
        self.daemon.cli("map", "rollback", "copy", "--epoch", "1")
        third = self.scratch / "again.mkmap"
        self.daemon.cli("export", "copy", third)
        self.assertEqual(first.read_bytes(), third.read_bytes())
        taken = self.daemon.cli("import", "copy", first, check=1)
        self.assertIn("there is a map copy already", taken.stderr)

    def test_a_damaged_archive_makes_no_map(self):
        whole = self.export("whole.mkmap")[1].read_bytes()
        for name, bad in (("cut", whole[:len(whole) // 2]), ("flipped", whole[:-200] + b"?" + whole[-199:])):
            file = self.scratch / f"{name}.mkmap"
            file.write_bytes(bad)
            done = self.daemon.cli("import", "damaged", file, check=2)
            self.assertIn(f"{file}: at byte ", done.stderr)
        self.daemon.cli("map", "info", "damaged", check=1)
        # The daemon cleans up behind a client that has its answer already.
        deadline = time.monotonic() + 60
        while (left := list((self.daemon.directory / "data").glob("import-*"))) and time.monotonic() < deadline:
            time.sleep(0.1)
        self.assertEqual(left, [])

    def test_directories_appear_whole(self):
        out = self.scratch / "autoware"
        report = self.daemon.json("export", "street", out, "--format", "autoware")
        cells = sorted((out / "pointcloud_map.pcd").iterdir())
        self.assertGreater(len(cells), 1)
        self.assertEqual(sum(len(points_of(cell.read_bytes())) for cell in cells), report["points"])
        self.assertIn("is there already", self.daemon.cli("export", "street", out, "--format", "autoware", check=1).stderr)
        self.assertEqual([p.name for p in self.scratch.glob("*.partial")], [])

    def test_changes_are_told_by_object(self):
        change = self.scratch / "change.ply"
        report = self.daemon.json("map", "diff", "street", 1, 2, change)
        self.assertGreater(report["appeared"], 0)
        self.assertIn(b"property uchar red", change.read_bytes()[:600])
        classes = {o["change"] for o in report["objects"]}
        self.assertLessEqual(classes, {"appeared", "disappeared", "unstable"})
        for o in report["objects"]:
            low, high, centre = np.array(o["box"]["min"]), np.array(o["box"]["max"]), np.array(o["centre"])
            self.assertTrue(((low < centre) & (centre < high)).all())
        self.assertEqual(self.daemon.json("map", "diff", "street", 2, 2)["objects"], [])


if __name__ == "__main__":
    unittest.main(verbosity=2)
