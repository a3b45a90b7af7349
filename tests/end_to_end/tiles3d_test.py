"""The tiles of a real daemon, read by gltf-validator, loaders.gl and 3d-tiles-tools: what `mapkeep export` says."""

import json
import pathlib
import tempfile
import unittest

import node
import numpy
import streets
from programs import Daemon, run


class Tiles3d(unittest.TestCase):
    def test_other_readers_find_the_points_of_the_export(self):
        scratch = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))
        folder = node.installed(node.READERS, "--ignore-scripts")  # none is needed, and one wants a compiler
        with Daemon("--http", "127.0.0.1:0") as daemon:
            daemon.cli("map", "create", "street")
            for number, session in enumerate(streets.simulate(scratch / "street", sessions=2, scans=16)):
                daemon.cli("session", "upload", "street", session, "--id", f"s{number}", "--wait")
            daemon.cli("export", "street", scratch / "map.ply")
            exported = self.vertices(scratch / "map.ply")
            address = f"http://{daemon.http}/v1/maps/street"
            for name in ("epochs/2", "latest"):
                copy = scratch / name.replace("/", "-")
                said = json.loads(run("node", folder / "tiles3d.mjs", f"{address}/{name}/tileset.json", copy).stdout)
                self.assertEqual(said["problems"], [])
                self.assertGreater(said["tiles"], 4)
                self.assertEqual(said["loadersVersion"], "1.1")
                for points in (said["validatorPoints"], said["loaders"]["points"], said["tools"]["points"],
                               said["attributes"]["_STABILITY"], said["attributes"]["_AGE"], said["attributes"]["NORMAL"],
                               said["attributes"]["COLOR_0"]):
                    self.assertEqual(points, len(exported))
                for reader in ("loaders", "tools"):
                    self.assertLess(abs(numpy.array(said[reader]["min"]) - exported.min(axis=0)).max(), 1e-4)
                    self.assertLess(abs(numpy.array(said[reader]["max"]) - exported.max(axis=0)).max(), 1e-4)

    @staticmethod
    def vertices(path):
        """x, y, z of a binary little-endian PLY of float32."""
        header, body = path.read_bytes().split(b"end_header\n", 1)
        fields = [line for line in header.splitlines() if line.startswith(b"property")]
        assert all(line.split()[1] == b"float" for line in fields), header
        return numpy.frombuffer(body, "<f4").reshape(-1, len(fields))[:, :3].astype(float)


if __name__ == "__main__":
    unittest.main(verbosity=2)
