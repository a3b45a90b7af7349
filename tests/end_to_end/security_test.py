"""The command line and a daemon with TLS and tokens, and what systemd hears of the daemon."""

import os
import pathlib
import socket
import subprocess
import tempfile
import unittest

from programs import BIN, Daemon, run


def token(file, name, role, map_name):
    return run(BIN / "mapkeepd", "token", name, "--role", role, "--map", map_name, "--append", file).stdout.strip()


class Environment:
    """Variables of the environment for a while; None: unset."""

    def __init__(self, **variables):
        self.variables = variables

    def __enter__(self):
        self.before = {name: os.environ.get(name) for name in self.variables}
        self.apply(self.variables)

    def __exit__(self, *unused):
        self.apply(self.before)

    @staticmethod
    def apply(variables):
        for name, value in variables.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


class Security(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        for name in ("server", "other"):
            subprocess.run(
                ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days",
                 "2", "-subj", f"/CN={name}", "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1", "-keyout",
                 cls.scratch / f"{name}.key", "-out", cls.scratch / f"{name}.pem"], check=True, capture_output=True)
        cls.tokens = cls.scratch / "tokens"
        cls.operator = token(cls.tokens, "console", "operator", "*")
        cls.reader = token(cls.tokens, "screen", "reader", "yard")
        cls.daemon = cls.enterClassContext(
            Daemon("--tls-cert", cls.scratch / "server.pem", "--tls-key", cls.scratch / "server.key", "--tokens", cls.tokens))

    def cli(self, *words, check=0, ca="server.pem"):
        return self.daemon.cli("--tls-ca", self.scratch / ca, *words, check=check)

    def test_token_from_the_environment_a_file_and_the_command_line(self):
        with Environment(MAPKEEP_TOKEN=self.operator):
            self.cli("map", "create", "yard")
        file = self.scratch / "token"
        file.write_text(self.operator + "\n")
        with Environment(MAPKEEP_TOKEN="wrong"):
            self.cli("--token-file", file, "map", "create", "depot")
        self.assertIn("yard", self.cli("--token", self.reader, "map", "list").stdout)
        self.assertNotIn("depot", self.cli("--token", self.reader, "map", "list").stdout)

    def test_refusals_say_why(self):
        for words, expected in (([], "token is needed"), (["--token", "mk_wrong"], "token is not known")):
            self.assertIn(expected, self.cli(*words, "map", "list", check=1).stderr)
        self.assertIn("operator", self.cli("--token", self.reader, "map", "create", "mine", check=1).stderr)
        self.assertIn("cannot be read", self.cli("--token-file", self.scratch / "none", "map", "list", check=2).stderr)

    def test_a_server_that_cannot_show_its_certificate_hears_no_token(self):
        self.assertIn("no mapkeepd answers", self.cli("--token", self.operator, "map", "list", ca="other.pem", check=1).stderr)
        self.daemon.cli("--token", self.operator, "map", "list", check=1)

    def test_a_token_does_not_cross_a_network_in_the_clear(self):
        done = run(BIN / "mapkeep", "--server", "192.0.2.1:7443", "--token", self.operator, "map", "list", check=1)
        self.assertIn("in the clear", done.stderr)


class Service(unittest.TestCase):
    def test_systemd_hears_of_readiness_life_and_the_end(self):
        with tempfile.TemporaryDirectory() as scratch, socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notices:
            notices.bind(f"{scratch}/notify")
            notices.settimeout(30)
            heard = []

            def hear(wanted):
                while wanted not in heard:
                    heard.append(notices.recv(1000).decode())

            with Environment(NOTIFY_SOCKET=f"{scratch}/notify", WATCHDOG_USEC="200000", WATCHDOG_PID=None), Daemon() as daemon:
                hear("READY=1")
                for _ in range(3):
                    heard.clear()
                    hear("WATCHDOG=1")
                self.assertEqual(daemon.stop(), 0)
                hear("STOPPING=1")


if __name__ == "__main__":
    unittest.main()
