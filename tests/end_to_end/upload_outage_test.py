"""An upload goes on by itself when the daemon goes away in the middle and comes back; compressed, it costs less."""

import pathlib
import signal
import subprocess
import tempfile
import time
import unittest

import streets
from programs import BIN, LONG, TIMEOUT_S, Daemon

AWAY_S = 60 if LONG else 3
SCANS = 80


class UploadOutage(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        cls.session = streets.simulate(cls.scratch / "street", sessions=1, scans=SCANS)[0]

    def start_and_hold(self, daemon, encoding):
        """An upload that has come some way, and is stopped there."""
        upload = subprocess.Popen(
            [BIN / "mapkeep", "--server", daemon.server, "session", "upload", "street", self.session, "--id", "drive",
             "--encoding", encoding], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        deadline = time.monotonic() + TIMEOUT_S
        slice_s = 0.05
        while True:
            time.sleep(slice_s)
            upload.send_signal(signal.SIGSTOP)
            session = next(iter(daemon.json("session", "list", "street")["sessions"]), None)
            if session is not None:
                slice_s = 0.005
                self.assertLess(session["durable_scans"], SCANS, "it had ended before it could be stopped")
                if session["durable_scans"] >= 5:
                    return upload
            self.assertLess(time.monotonic(), deadline)
            upload.send_signal(signal.SIGCONT)

    def test_the_daemon_is_killed_in_the_middle_and_restarted(self):
        for encoding in ("raw", "draco-1cm"):
            with self.subTest(encoding=encoding), Daemon() as daemon:
                daemon.cli("map", "create", "street")
                upload = self.start_and_hold(daemon, encoding)
                daemon.kill()
                upload.send_signal(signal.SIGCONT)
                time.sleep(AWAY_S)
                self.assertIsNone(upload.poll(), "it gave up")
                daemon.start(daemon.server)
                output, errors = upload.communicate(timeout=TIMEOUT_S)
                self.assertEqual((upload.returncode, errors), (0, ""), output)
                session = daemon.json("session", "show", "street", "drive")
                self.assertEqual(session["durable_scans"], SCANS)
                self.assertNotEqual(session["state"], "uploading")

    def test_compressed_scans_cost_less_and_the_report_says_how_much(self):
        raw = sum(path.stat().st_size for path in (self.session / "velodyne").iterdir())
        sizes = {}
        with Daemon() as daemon:
            for encoding in ("raw", "draco-1mm", "draco-1cm"):
                daemon.cli("map", "create", encoding)
                daemon.cli("session", "upload", encoding, self.session, "--id", "drive", "--encoding", encoding)
                sizes[encoding] = daemon.json("session", "show", encoding, "drive")["payload_bytes"]
                shown = daemon.cli("session", "show", encoding, "drive").stdout
                self.assertRegex(shown, f"bytes a scan: +{sizes[encoding] // SCANS}, ")
            self.assertEqual(daemon.wait("draco-1cm", "drive"), "committed")
        self.assertEqual(sizes["raw"], raw)
        self.assertLess(sizes["draco-1mm"], raw / 2)
        self.assertLess(sizes["draco-1cm"], sizes["draco-1mm"])
        print({encoding: size // SCANS for encoding, size in sizes.items()}, "bytes a scan")


if __name__ == "__main__":
    unittest.main(verbosity=2)
