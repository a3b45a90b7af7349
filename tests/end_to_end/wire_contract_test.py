"""The protos keep their style, and what was released stays readable: buf lint and buf breaking."""

import pathlib
import shutil
import subprocess
import tempfile
import unittest

import node
from programs import ROOT, TIMEOUT_S

PROTO = ROOT / "proto"
RELEASED = ROOT / "tests/integration/released"


def buf(*words, folder=PROTO):
    return subprocess.run([node.installed() / "node_modules/.bin/buf", *map(str, words)], cwd=folder,
                          capture_output=True, text=True, timeout=TIMEOUT_S)


class WireContract(unittest.TestCase):
    def test_the_protos_are_in_style(self):
        lint = buf("lint")
        self.assertEqual((lint.returncode, lint.stdout), (0, ""), lint.stderr)

    def test_nothing_that_was_released_is_broken(self):
        versions = sorted(path for path in RELEASED.iterdir() if path.is_dir())
        self.assertTrue(versions)
        for version in versions:
            with self.subTest(version=version.name):
                broken = buf("breaking", "--against", version)
                self.assertEqual((broken.returncode, broken.stdout), (0, ""), broken.stderr)

    def test_a_break_would_be_found(self):
        with tempfile.TemporaryDirectory() as scratch:
            changed = pathlib.Path(scratch) / "proto"
            shutil.copytree(PROTO, changed)
            proto = changed / "mapkeep/v1/session_service.proto"
            text = proto.read_text()
            self.assertIn("fixed32 crc32c = 5;", text)
            proto.write_text(text.replace("fixed32 crc32c = 5;", "fixed64 crc32c = 5;"))
            newest = max(path for path in RELEASED.iterdir() if path.is_dir())
            broken = buf("breaking", "--against", newest, folder=changed)
            self.assertNotEqual(broken.returncode, 0)
            self.assertIn("crc32c", broken.stdout)


if __name__ == "__main__":
    unittest.main(verbosity=2)
