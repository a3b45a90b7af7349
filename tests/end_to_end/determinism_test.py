"""The same sessions in the same order give the same map, bit for bit."""

import pathlib
import tempfile
import unittest

import streets
from programs import Daemon


class Determinism(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        cls.sessions = streets.simulate(scratch / "street", sessions=2)

    def map_of(self, threads):
        with Daemon("--threads", str(threads)) as daemon:
            daemon.cli("map", "create", "street")
            for number, session in enumerate(self.sessions):
                daemon.cli("session", "upload", "street", session, "--id", f"day-{number}", "--wait")
            poses = daemon.directory / "poses.txt"
            daemon.cli("session", "poses", "street", "day-1", poses)
            return daemon.export("street", "--all"), daemon.export("street"), poses.read_bytes()

    def test_one_and_two_threads_and_two_runs_leave_the_same_bytes(self):
        one, two, again = self.map_of(1), self.map_of(2), self.map_of(2)
        self.assertEqual(one, two)
        self.assertEqual(two, again)
        self.assertGreater(len(one[1]), 100_000, "the map is all but empty")


if __name__ == "__main__":
    unittest.main(verbosity=2)
