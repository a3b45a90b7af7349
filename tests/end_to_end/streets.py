"""Small simulated sessions, made once a test module."""

import pathlib
import shutil
import struct

from programs import BIN, run


def simulate(out, sessions=1, scans=24, sensor="vlp16", seed=1):
    """Session directories of one street, with true poses in one common frame."""
    out = pathlib.Path(out)
    run(BIN / "mapkeep", "simulate", out, "--sessions", sessions, "--scans", scans, "--sensor", sensor, "--seed", seed,
        "--change", 0.5)
    directories = sorted(out.glob("session-*"))
    for directory in directories:
        shutil.copy(directory / "truth_poses.txt", directory / "poses.txt")
    return directories


def spoil(session, out, **files):
    """A copy of a session in which some files hold other bytes; keys are paths with '/' as '__' and '.' as '_dot_'."""
    shutil.copytree(session, out)
    for name, content in files.items():
        path = out / name.replace("__", "/").replace("_dot_", ".")
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return out


def points(*rows):
    """The bytes of a velodyne .bin."""
    return b"".join(struct.pack("<4f", *row) for row in rows)
