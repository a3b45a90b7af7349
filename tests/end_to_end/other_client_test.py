"""A client that nobody here wrote: @grpc/grpc-js with the protos alone, from begin to tiles."""

import json
import pathlib
import tempfile
import unittest

import numpy
from scipy.spatial import cKDTree

import node
import streets
from programs import ROOT, Daemon, run


class OtherClient(unittest.TestCase):
    def test_node_uploads_a_session_and_keeps_the_tiles(self):
        scratch = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))
        session = streets.simulate(scratch / "street", sessions=1)[0]
        folder = node.installed()
        with Daemon() as daemon:
            said = json.loads(run("node", folder / "robot.mjs", ROOT / "proto", daemon.server, "street", session,
                                  "drive").stdout)
            self.assertEqual(said["state"], "SESSION_STATE_COMMITTED", said["reason"])
            self.assertEqual(said["acknowledged"][-1], said["scans"])
            self.assertEqual(said["acknowledged"], sorted(said["acknowledged"]))
            self.assertEqual((said["epoch"], said["again"], said["wrong"]), (1, 0, "NOT_FOUND"))
            self.assertEqual(said["tiles"], said["listed"])
            # The same points as our own client exports.
            daemon.cli("export", "street", scratch / "map.ply", "--centroids")
            exported = self.vertices(scratch / "map.ply")
            distances, nearest = cKDTree(exported).query(said["points"])
            self.assertLess(distances.max(), 1e-4)
            self.assertEqual(sorted(nearest), list(range(len(exported))))

    @staticmethod
    def vertices(path):
        """x, y, z of a binary little-endian PLY of float32."""
        header, body = path.read_bytes().split(b"end_header\n", 1)
        fields = [line.split()[2].decode() for line in header.splitlines() if line.startswith(b"property")]
        assert all(line.split()[1] == b"float" for line in header.splitlines() if line.startswith(b"property")), header
        rows = numpy.frombuffer(body, "<f4").reshape(-1, len(fields))
        return rows[:, :3].astype(float)


if __name__ == "__main__":
    unittest.main(verbosity=2)
