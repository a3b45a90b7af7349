"""What deploy/ holds is accepted by the programs that it is written for, and the image's daemon serves."""

import pathlib
import re
import shutil
import tempfile
import tomllib
import unittest

import programs

DEPLOY = programs.ROOT / "deploy"


def certificate(directory, name):
    """A key and a certificate signed by itself: NAME.key, NAME.crt, and both as NAME.pem."""
    key, crt = directory / f"{name}.key", directory / f"{name}.crt"
    programs.run("openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days",
                 "2", "-subj", f"/CN={name}", "-addext", f"subjectAltName=DNS:{name}", "-keyout", key, "-out", crt)
    (directory / f"{name}.pem").write_text(crt.read_text() + key.read_text())


class Scratch(unittest.TestCase):
    def setUp(self):
        self.scratch = pathlib.Path(tempfile.mkdtemp(prefix="mapkeep-deploy-"))
        self.addCleanup(shutil.rmtree, self.scratch)


class Unit(Scratch):
    def unit(self):
        """The unit with the program that was built in place of the one that is not installed."""
        path = self.scratch / "mapkeepd.service"
        path.write_text((DEPLOY / "systemd/mapkeepd.service").read_text().replace("/usr/bin/mapkeepd",
                                                                                  str(programs.BIN / "mapkeepd")))
        return path

    def test_systemd_finds_nothing_wrong_with_the_unit(self):
        done = programs.run("systemd-analyze", "verify", self.unit())
        self.assertEqual([line for line in done.stderr.splitlines() if "mapkeepd.service" in line], [])

    def test_the_unit_is_as_closed_as_systemd_asks(self):
        done = programs.run("systemd-analyze", "security", "--offline=true", "--threshold=20", self.unit())
        self.assertIn("exposure level", done.stdout)

    def test_the_settings_of_every_sample_are_known_to_the_daemon(self):
        known = set(re.findall(r"^\| `([a-z_.]+)` \|", (programs.ROOT / "server/README.md").read_text(), re.M))
        for sample in sorted(DEPLOY.rglob("mapkeepd*.toml")):
            with self.subTest(sample=str(sample.relative_to(DEPLOY))):
                for name, value in tomllib.loads(sample.read_text()).items():
                    names = [f"{name}.{inner}" for inner in value] if isinstance(value, dict) else [name]
                    self.assertEqual([n for n in names if n not in known], [])


class Kubernetes(unittest.TestCase):
    def test_kustomize_builds_every_resource(self):
        built = programs.run("kubectl", "kustomize", DEPLOY / "kubernetes").stdout
        kinds = re.findall(r"^kind: (\w+)$", built, re.M)
        for kind in ("Namespace", "ConfigMap", "Deployment", "Service", "PodDisruptionBudget", "HorizontalPodAutoscaler"):
            self.assertIn(kind, kinds)
        self.assertEqual(len(re.findall(r"path: /(?:livez|readyz)$", built, re.M)), 3)
        # The pods read the configuration under the name that kustomize gave it.
        name = re.search(r"^  name: (mapkeepd-\w+)$", built, re.M).group(1)
        self.assertIn(f"name: {name}\n        name: configuration", built)


class Balancers(Scratch):
    def placed(self, source):
        """The configuration with its certificates where this test made them, and ports that are free."""
        certificate(self.scratch, "balancer")
        shutil.copy(self.scratch / "balancer.crt", self.scratch / "ca.crt")
        return (DEPLOY / "balancer" / source).read_text().replace("/etc/mapkeep/tls", str(self.scratch))

    def test_haproxy_accepts_both_configurations(self):
        for name in ("haproxy-rados.cfg", "haproxy-rocksdb.cfg"):
            with self.subTest(name=name):
                path = self.scratch / name
                path.write_text(self.placed(name))
                done = programs.run("/usr/sbin/haproxy", "-c", "-f", path)
                self.assertNotIn("[ALERT]", done.stderr)
                self.assertNotIn("[WARNING]", done.stderr)

    def test_nginx_accepts_both_configurations(self):
        for name in ("nginx-rados.conf", "nginx-rocksdb.conf"):
            with self.subTest(name=name):
                path = self.scratch / "nginx.conf"
                path.write_text(f"pid {self.scratch}/pid;\nerror_log stderr;\nevents {{}}\nhttp {{\n"
                                f"access_log off;\n{self.placed(name)}\n}}\n")
                programs.run("/usr/sbin/nginx", "-t", "-p", self.scratch, "-c", path)


if __name__ == "__main__":
    unittest.main()
