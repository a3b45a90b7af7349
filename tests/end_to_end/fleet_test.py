"""Three daemons on one RADOS pool behind a balancer, TLS on both sides, serve a fleet while daemons and an OSD die.

Every acknowledged session is applied once, no robot sees an error that it could not retry, and a daemon that replays the
commits gets the same map. Through HAProxy and through nginx, with the configurations of deploy/balancer.
"""

import contextlib
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import time
import unittest

import programs

BALANCER = programs.ROOT / "deploy/balancer"
CLUSTER = programs.ROOT / "tests/rados_cluster"
ROBOTS = 40
SCANS = 40 if programs.LONG else 15
START_TIMEOUT_S = 60


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def wait_for(what, condition, seconds=START_TIMEOUT_S):
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError(f"{what} did not happen within {seconds} s")
        time.sleep(0.1)


class Certificates:
    """An authority, and what it signed: NAME.crt, NAME.key and both as NAME.pem."""

    def __init__(self, directory):
        self.directory = directory
        programs.run("openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
                     "-days", "2", "-subj", "/CN=authority", "-keyout", directory / "ca.key", "-out", directory / "ca.crt")
        for name in ("mapkeepd", "balancer"):
            self.sign(name)

    def sign(self, name):
        key, request, crt = (self.directory / f"{name}.{suffix}" for suffix in ("key", "csr", "crt"))
        programs.run("openssl", "req", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-subj",
                     f"/CN={name}", "-keyout", key, "-out", request)
        names = self.directory / f"{name}.ext"
        names.write_text(f"subjectAltName=DNS:{name},DNS:localhost,IP:127.0.0.1\n")
        programs.run("openssl", "x509", "-req", "-in", request, "-CA", self.directory / "ca.crt", "-CAkey",
                     self.directory / "ca.key", "-CAcreateserial", "-days", "2", "-extfile", names, "-out", crt)
        (self.directory / f"{name}.pem").write_text(crt.read_text() + key.read_text())


class Tokens:
    """The daemons' file of tokens, and what robots and operator send."""

    def __init__(self, directory):
        self.file, self.robots_file = directory / "tokens", directory / "robot-tokens"
        lines, robots = [], []
        for number in range(ROBOTS):
            token, line = self.make(f"robot-{number}", "robot")
            robots.append(token)
            lines.append(line)
        self.operator, line = self.make("operator", "operator")
        self.file.write_text("\n".join([*lines, line]) + "\n")
        self.robots_file.write_text("\n".join(robots) + "\n")

    @staticmethod
    def make(name, role):
        done = programs.run(programs.BIN / "mapkeepd", "token", name, "--role", role, "--map", "*")
        token = re.search(r"mk_[\w-]{43}", done.stdout + done.stderr).group(0)
        line = re.search(r"^\S+\s+\S+\s+\S+\s+sha256:[0-9a-f]{64}$", done.stdout, re.M).group(0)
        return token, line


class Replica:
    """One mapkeepd on the pool, always on the same ports, so that the balancer finds it again."""

    def __init__(self, fleet, name):
        self.directory = fleet.scratch / name
        self.directory.mkdir()
        self.listen, self.admin, self.http = free_port(), free_port(), free_port()
        self.words = [programs.BIN / "mapkeepd", "--config", fleet.configuration, "--data", self.directory / "data",
                      "--listen", f"127.0.0.1:{self.listen}", "--admin", f"127.0.0.1:{self.admin}", "--http",
                      f"127.0.0.1:{self.http}", "--ports-file", self.directory / "ports.json"]
        self.start()

    def start(self):
        ports = self.directory / "ports.json"
        ports.unlink(missing_ok=True)
        with open(self.directory / "log", "a") as log:
            self.process = subprocess.Popen(self.words, stdout=log, stderr=log)
        wait_for("a daemon's start", lambda: ports.exists() or self.process.poll() is not None)
        if self.process.poll() is not None:
            raise AssertionError("the daemon did not start:\n" + (self.directory / "log").read_text()[-4000:])

    def end(self, number):
        """Sends a signal; gives the exit status."""
        self.process.send_signal(number)
        return self.process.wait(timeout=programs.TIMEOUT_S)


class Fleet(contextlib.ExitStack):
    """The cluster, three daemons on it, and what they need."""

    def __enter__(self):
        super().__enter__()
        self.scratch = pathlib.Path(tempfile.mkdtemp(prefix="mapkeep-fleet-"))
        self.callback(shutil.rmtree, self.scratch, ignore_errors=True)
        Certificates(self.scratch)
        self.tokens = Tokens(self.scratch)
        self.ceph = self.scratch / "ceph"
        self.scratch.chmod(0o755)
        programs.run(CLUSTER, "up", self.ceph)
        self.callback(programs.run, CLUSTER, "down", self.ceph)
        self.configuration = self.scratch / "mapkeepd.toml"
        self.configuration.write_text(
            f'engine = "rados"\ntls_cert = "{self.scratch}/mapkeepd.crt"\ntls_key = "{self.scratch}/mapkeepd.key"\n'
            f'tokens = "{self.tokens.file}"\n[rados]\nconf = "{self.ceph}/ceph.conf"\npool = "maps"\n'
            "[limits]\nlease_seconds = 5\ndrain_seconds = 8\n[history]\nkeep_scans = true\n")
        self.replicas = []
        for name in "abc":
            self.replicas.append(Replica(self, name))
            self.callback(self.stop, self.replicas[-1])
        return self

    @staticmethod
    def stop(replica):
        if replica.process.poll() is None:
            replica.end(signal.SIGKILL)

    def placed(self, source):
        """A configuration of deploy/balancer with this fleet's ports and certificates; gives it and the port for gRPC."""
        text, port, pages = (BALANCER / source).read_text(), free_port(), free_port()
        text = text.replace("/etc/mapkeep/tls", str(self.scratch))
        for number, replica in enumerate(self.replicas):
            host = f"10.0.0.{11 + number}"
            # The health of a server is asked on the admin port of its own.
            text = re.sub(rf"{re.escape(host)}:(744[35]) check port 7444",
                          lambda m, r=replica: f"127.0.0.1:{r.listen if m[1] == '7443' else r.http} check port {r.admin}", text)
            text = text.replace(f"{host}:7443", f"127.0.0.1:{replica.listen}").replace(f"{host}:7445",
                                                                                      f"127.0.0.1:{replica.http}")
        text = re.sub(r"\b(bind |listen )(:?)7443", rf"\g<1>127.0.0.1:{port}", text)
        text = re.sub(r"\b(bind |listen )(:?)443", rf"\g<1>127.0.0.1:{pages}", text)
        return text, port

    @contextlib.contextmanager
    def balancer(self, words, port):
        with open(self.scratch / "balancer.log", "w") as log:
            process = subprocess.Popen([str(w) for w in words], stdout=log, stderr=log)
        try:
            def listening():
                with socket.socket() as s:
                    return s.connect_ex(("127.0.0.1", port)) == 0 or process.poll() is not None
            wait_for("the balancer's start", listening)
            if process.poll() is not None:
                raise AssertionError("the balancer did not start:\n" + (self.scratch / "balancer.log").read_text())
            yield
        finally:
            process.terminate()
            process.wait(timeout=30)

    def haproxy(self):
        text, port = self.placed("haproxy-rados.cfg")
        path = self.scratch / "haproxy.cfg"
        path.write_text(text)
        return self.balancer(["/usr/sbin/haproxy", "-db", "-f", path], port), port

    def nginx(self):
        text, port = self.placed("nginx-rados.conf")
        path = self.scratch / "nginx.conf"
        path.write_text(f"daemon off;\nuser root;\npid {self.scratch}/nginx.pid;\nerror_log stderr;\n"
                        f"events {{ worker_connections 4096; }}\nhttp {{\naccess_log off;\n{text}\n}}\n")
        return self.balancer(["/usr/sbin/nginx", "-p", self.scratch, "-c", path], port), port

    def cli(self, port, *words, check=0):
        """The operator's command line."""
        return programs.run(programs.BIN / "mapkeep", "--server", f"localhost:{port}", "--tls-ca",
                            self.scratch / "ca.crt", "--token", self.tokens.operator, *words, check=check)

    def load(self, port, map_name, robots):
        """Starts the load generator."""
        return subprocess.Popen(
            [programs.BIN / "fleet_load", "--server", f"localhost:{port}", "--tls-ca", str(self.scratch / "ca.crt"),
             "--token", self.tokens.operator, "--robot-tokens", str(self.tokens.robots_file), "--map", map_name,
             "--prefix", "robot", "--robots", str(robots), "--scans", str(SCANS), "--every-nth-point", "3"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    def committed(self, port, map_name):
        """Sessions of the map that ended committed; nothing while nobody answers."""
        listed = self.cli(port, "--json", "session", "list", map_name, check=None)
        if listed.returncode != 0:
            return []
        return [s for s in json.loads(listed.stdout)["sessions"] if s["state"] in ("committed", "SESSION_STATE_COMMITTED")]


class FleetTest(unittest.TestCase):
    def serve(self, fleet, balancer, port, map_name, robots, troubles):
        with balancer:
            load = fleet.load(port, map_name, robots)
            try:
                wait_for("the first commits", lambda: len(fleet.committed(port, map_name)) >= 2 or load.poll() is not None, 300)
                for trouble in troubles:
                    trouble()
                out, errors = load.communicate(timeout=programs.TIMEOUT_S)
            finally:
                if load.poll() is None:
                    load.kill()
                    load.communicate()
            self.assertEqual(load.returncode, 0, out[-6000:] + errors[-2000:])
            result = json.loads(out)
            self.assertEqual(result["errors"], [])
            self.assertEqual(len(result["sessions"]), robots)
            self.assertGreater(result["map_streams"], 0)

            # Exactly once: as many epochs as sessions, each made by another one.
            self.assertEqual(sorted(s["epoch"] for s in result["sessions"]), list(range(1, robots + 1)))
            versions = json.loads(fleet.cli(port, "--json", "map", "versions", map_name, "--limit", "1000").stdout)
            made = [v["session"] for v in versions["versions"] if v.get("session")]
            self.assertEqual(sorted(made), sorted(s["id"] for s in result["sessions"]))
            fleet.cli(port, "admin", "check", map_name)
            fleet.cli(port, "admin", "replay", map_name)

    def test_every_session_is_applied_once_whatever_dies(self):
        with Fleet() as fleet:
            def drain():
                self.assertEqual(fleet.replicas[0].end(signal.SIGTERM), 0)
                fleet.replicas[0].start()

            def kill_a_daemon():
                fleet.replicas[1].end(signal.SIGKILL)
                fleet.replicas[1].start()

            def kill_an_osd():
                programs.run(CLUSTER, "kill-osd", fleet.ceph)
                time.sleep(5)
                programs.run(CLUSTER, "start-osd", fleet.ceph)

            with self.subTest("HAProxy"):
                self.serve(fleet, *fleet.haproxy(), "through-haproxy", ROBOTS, [drain, kill_a_daemon, kill_an_osd])
            with self.subTest("nginx"):
                robots = ROBOTS if programs.LONG else 12
                self.serve(fleet, *fleet.nginx(), "through-nginx", robots, [drain, kill_a_daemon])


if __name__ == "__main__":
    unittest.main()
