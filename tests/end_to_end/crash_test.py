"""kill -9 at any moment of the pipeline: the job goes on after the restart and leaves the same map."""

import pathlib
import random
import tempfile
import time
import unittest

import streets
from programs import LONG, Daemon

ROUNDS = 40 if LONG else 4


class Crash(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        cls.sessions = streets.simulate(scratch / "street", sessions=2)

    def upload(self, daemon, number, *flags):
        daemon.cli("session", "upload", "street", self.sessions[number], "--id", f"day-{number}", *flags)

    def test_the_export_is_that_of_a_run_without_the_kill(self):
        with Daemon() as daemon:
            daemon.cli("map", "create", "street")
            self.upload(daemon, 0, "--wait")
            began = time.monotonic()
            self.upload(daemon, 1, "--wait")
            took = time.monotonic() - began
            undisturbed = daemon.export("street", "--all")

        moments = random.Random(1)
        killed_at_work = 0
        for kill in range(ROUNDS):
            with self.subTest(kill=kill), Daemon() as daemon:
                daemon.cli("map", "create", "street")
                self.upload(daemon, 0, "--wait")
                self.upload(daemon, 1)
                time.sleep(moments.uniform(0, took))
                killed_at_work += daemon.state("street", "day-1") == "running"
                daemon.kill()
                daemon.start()
                self.assertEqual(daemon.wait("street", "day-1"), "committed")
                self.assertEqual(daemon.export("street", "--all"), undisturbed)
                self.assertEqual(daemon.stop(), 0)
        print(f"{killed_at_work} of {ROUNDS} kills met the session at work")

    def test_an_upload_goes_on_where_the_kill_met_it(self):
        with Daemon() as daemon:
            daemon.cli("map", "create", "street")
            self.upload(daemon, 0, "--wait")
            expected = daemon.export("street", "--all")
        with Daemon() as daemon:
            daemon.cli("map", "create", "street")
            self.upload(daemon, 0)
            daemon.kill()
            daemon.start()
            self.upload(daemon, 0, "--wait")
            self.assertEqual(daemon.export("street", "--all"), expected)


if __name__ == "__main__":
    unittest.main(verbosity=2)
