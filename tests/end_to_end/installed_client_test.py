"""The client library as a package: installed, found, built against, and run by the robot of client/example."""

import os
import pathlib
import re
import tempfile
import unittest

import streets
from programs import BIN, ROOT, Daemon, run


class InstalledClient(unittest.TestCase):
    def test_a_robot_is_built_against_the_installed_package_and_maps_a_street(self):
        scratch = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))
        run("cmake", "--install", BIN.parent, "--component", "client", "--prefix", scratch / "prefix")
        headers = list((scratch / "prefix/include").rglob("*.h"))
        self.assertGreater(len(headers), 10)
        for header in headers:
            self.assertNotRegex(header.read_text(), r"#include.*(grpc|google/|\.pb\.h)", header)

        # By itself, far from this source tree; with the sanitizers of this build, if it has some.
        flags = os.environ.get("MAPKEEP_SANITIZE", "")
        run("cmake", "-S", ROOT / "client/example", "-B", scratch / "build", "-G", "Ninja",
            f"-DCMAKE_PREFIX_PATH={scratch / 'prefix'}", f"-DCMAKE_CXX_FLAGS={f'-fsanitize={flags}' if flags else ''}")
        run("cmake", "--build", scratch / "build")

        drive = streets.simulate(scratch / "street", sessions=1)[0]
        with Daemon() as daemon:
            daemon.cli("map", "create", "street")
            said = run(scratch / "build/robot", daemon.server, "street", drive, scratch / "tiles").stdout
            found = re.fullmatch(r"committed, (\d+) bytes a scan, (\d+) tiles, found 1 at +(\S+) +(\S+) +(\S+)\n", said)
            self.assertTrue(found, said)
            last = (drive / "poses.txt").read_text().splitlines()[9].split()
            for axis in range(3):
                self.assertAlmostEqual(float(found[3 + axis]), float(last[4 * axis + 3]), delta=0.1)
            manifest = (scratch / "tiles/manifest.json").read_text()
            self.assertEqual(manifest.count('"version"'), int(found[2]))


if __name__ == "__main__":
    unittest.main(verbosity=2)
