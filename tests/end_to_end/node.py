"""npm packages of the tests, installed from their lock beside the build."""

import fcntl
import os
import pathlib
import shutil
import subprocess

from programs import ROOT, TIMEOUT_S

WIRE = ROOT / "tests/integration/node"
READERS = ROOT / "tests/end_to_end/readers"


def installed(source=WIRE, *flags):
    """The folder that holds node_modules and the scripts; installs once for each state of the lock."""
    folder = pathlib.Path(os.environ["MAPKEEP_SCRATCH"]) / "node" / source.name
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / "busy", "w") as busy:
        fcntl.flock(busy, fcntl.LOCK_EX)  # tests run beside each other
        for script in (*source.glob("*.mjs"), *source.glob("*.schema.json")):
            shutil.copy(script, folder)
        lock = (source / "package-lock.json").read_bytes()
        done = folder / "installed"
        if not done.exists() or done.read_bytes() != lock:
            for name in ("package.json", "package-lock.json"):
                shutil.copy(source / name, folder)
            result = subprocess.run(["npm", "ci", "--no-audit", "--no-fund", *flags], cwd=folder, capture_output=True,
                                    text=True, timeout=TIMEOUT_S)
            if result.returncode != 0:
                raise AssertionError(f"npm ci failed\n{result.stdout}\n{result.stderr}")
            done.write_bytes(lock)
    return folder
