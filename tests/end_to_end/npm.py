"""Runs the Node programs of format_readers, whose packages are installed by their lock file on first use."""

import fcntl
import json
import pathlib
import subprocess

from programs import TIMEOUT_S

FOLDER = pathlib.Path(__file__).resolve().parent / "format_readers"


def install():
    """npm ci, unless what the lock file says is there; once, whoever asks first."""
    lock = FOLDER / "package-lock.json"
    stamp = FOLDER / "node_modules" / ".installed"
    with open(lock) as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        if stamp.exists() and stamp.read_bytes() == lock.read_bytes():
            return
        subprocess.run(["npm", "ci", "--no-audit", "--no-fund"], cwd=FOLDER, check=True, capture_output=True,
                       timeout=TIMEOUT_S)
        stamp.write_bytes(lock.read_bytes())


def node(script, *words):
    """The JSON document that a script prints."""
    install()
    done = subprocess.run(["node", FOLDER / script, *map(str, words)], capture_output=True, timeout=TIMEOUT_S)
    if done.returncode != 0:
        raise AssertionError(f"{script}: exit {done.returncode}\n{done.stderr.decode()}")
    return json.loads(done.stdout)
