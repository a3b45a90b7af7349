"""Runs the built programs the way a user does: a real daemon on a free port, the real command line."""

import json
import os
import pathlib
import shutil
import signal
import subprocess
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = pathlib.Path(os.environ["MAPKEEP_BIN"])
LONG = os.environ.get("MAPKEEP_LONG") == "1"
TIMEOUT_S = 600


def run(*words, check=0):
    """Runs a program to its end; its exit status must be `check` (None: any)."""
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, timeout=TIMEOUT_S)
    if check is not None and done.returncode != check:
        raise AssertionError(f"{' '.join(map(str, words))}: exit {done.returncode}, expected {check}\n"
                             f"stdout: {done.stdout}\nstderr: {done.stderr}")
    return done


def clean(*words, check=0):
    return run(BIN / "mapkeep", "clean", *words, check=check)


def score(mode, *words):
    """SA, DA and AA in percent from ../shared/eval/score_dor.py."""
    words_out = run("/usr/bin/python3", ROOT.parent / "shared/eval/score_dor.py", mode, *words).stdout.split()
    return {name: float(words_out[words_out.index(name) + 1]) for name in ("SA", "DA", "AA")}


class Daemon:
    """mapkeepd on a temporary store; survives kills: start() goes on with the same data."""

    def __init__(self, *flags):
        self.flags = flags
        self.directory = pathlib.Path(tempfile.mkdtemp(prefix="mapkeep-"))
        self.process = None

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *unused):
        if self.process.poll() is None:
            self.kill()
        shutil.rmtree(self.directory)

    def start(self, listen="127.0.0.1:0"):
        """Again on the address of before, if that is given."""
        ports = self.directory / "ports.json"
        ports.unlink(missing_ok=True)
        with open(self.directory / "log", "a") as log:
            self.process = subprocess.Popen(
                [BIN / "mapkeepd", "--data", self.directory / "data", "--listen", listen, "--admin",
                 "127.0.0.1:0", "--ports-file", ports, *self.flags], stdout=log, stderr=log)
        deadline = time.monotonic() + 60
        while not ports.exists():
            if self.process.poll() is not None or time.monotonic() > deadline:
                raise AssertionError("the daemon did not start:\n" + (self.directory / "log").read_text())
            time.sleep(0.02)
        said = json.loads(ports.read_text())
        self.server, self.admin, self.http = said["listen"], said["admin"], said.get("http")

    def kill(self):
        """kill -9."""
        self.process.send_signal(signal.SIGKILL)
        self.process.wait(timeout=TIMEOUT_S)

    def stop(self):
        """SIGTERM; gives the exit status."""
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(timeout=TIMEOUT_S)

    def cli(self, *words, check=0):
        return run(BIN / "mapkeep", "--server", self.server, *words, check=check)

    def json(self, *words):
        return json.loads(self.cli("--json", *words).stdout)

    def state(self, map_name, session):
        return self.cli("session", "show", map_name, session).stdout.splitlines()[0].removeprefix("state: ")

    def wait(self, map_name, session):
        """Waits until the session has ended; gives its state."""
        deadline = time.monotonic() + TIMEOUT_S
        while (state := self.state(map_name, session)) in ("uploading", "queued", "running"):
            if time.monotonic() > deadline:
                raise AssertionError(f"session {session} is still {state} after {TIMEOUT_S} s")
            time.sleep(0.1)
        return state

    def export(self, map_name, *flags):
        """The map's export as bytes."""
        out = self.directory / "export.pcd"
        self.cli("export", map_name, out, *flags)
        content = out.read_bytes()
        out.unlink()
        return content
