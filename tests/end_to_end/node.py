"""The npm packages of tests/integration/node, installed from their lock beside the build."""

import fcntl
import os
import pathlib
import shutil
import subprocess

from programs import ROOT, TIMEOUT_S

SOURCE = ROOT / "tests/integration/node"


def installed():
    """The folder that holds node_modules and the scripts; installs once for each state of the lock."""
    folder = pathlib.Path(os.environ["MAPKEEP_SCRATCH"]) / "node"
    folder.mkdir(exist_ok=True)
    with open(folder / "busy", "w") as busy:
        fcntl.flock(busy, fcntl.LOCK_EX)  # tests run beside each other
        for script in SOURCE.glob("*.mjs"):
            shutil.copy(script, folder)
        lock = (SOURCE / "package-lock.json").read_bytes()
        done = folder / "installed"
        if not done.exists() or done.read_bytes() != lock:
            for name in ("package.json", "package-lock.json"):
                shutil.copy(SOURCE / name, folder)
            result = subprocess.run(["npm", "ci", "--no-audit", "--no-fund"], cwd=folder, capture_output=True, text=True,
                                    timeout=TIMEOUT_S)
            if result.returncode != 0:
                raise AssertionError(f"npm ci failed\n{result.stdout}\n{result.stderr}")
            done.write_bytes(lock)
    return folder
