"""The image that deploy/container/Dockerfile describes is built from nothing but Debian, and its daemon serves."""

import json
import os
import pathlib
import shutil
import subprocess
import tempfile
import time
import unittest
import urllib.request

import programs

BUILD_TIMEOUT_S = 3000


def chroot_is_refused():
    """Why this kernel or container does not let a process change its root; None if it does."""
    done = programs.run("chroot", "/", "true", check=None)
    return None if done.returncode == 0 else done.stderr.strip()


class Image(unittest.TestCase):
    def setUp(self):
        if refusal := chroot_is_refused():
            self.skipTest(f"not built: {refusal}")
        self.scratch = pathlib.Path(tempfile.mkdtemp(prefix="mapkeep-image-", dir="/var/tmp"))
        self.scratch.chmod(0o755)
        self.addCleanup(shutil.rmtree, self.scratch, ignore_errors=True)

    def buildah(self, command, *words):
        environment = os.environ | {"BUILDAH_ISOLATION": "chroot", "STORAGE_DRIVER": "vfs"}
        done = subprocess.run(
            ["buildah", "--root", self.scratch / "images", "--runroot", self.scratch / "run", command, *words],
            env=environment, capture_output=True, text=True, timeout=BUILD_TIMEOUT_S)
        if done.returncode != 0:
            raise AssertionError(f"buildah {command}: exit {done.returncode}\n{done.stdout[-8000:]}\n{done.stderr[-8000:]}")
        return done.stdout.strip().splitlines()

    def base(self):
        """Debian 12 as debootstrap makes it, which stands for debian:12-slim where no registry is."""
        system = self.scratch / "debian"
        programs.run("debootstrap", "--variant=minbase", "--include=ca-certificates", "bookworm", system)
        # As the image of the same name: with the security updates. And with the authorities that this machine trusts.
        mirror = "http://deb.debian.org"
        (system / "etc/apt/sources.list").write_text(
            f"deb {mirror}/debian bookworm main\ndeb {mirror}/debian bookworm-updates main\n"
            f"deb {mirror}/debian-security bookworm-security main\n")
        shutil.copytree("/usr/local/share/ca-certificates", system / "usr/local/share/ca-certificates", dirs_exist_ok=True)
        programs.run("chroot", system, "update-ca-certificates")
        container = self.buildah("from", "scratch")[-1]
        self.buildah("add", "--quiet", container, system, "/")
        self.buildah("commit", "--quiet", container, "localhost/debian")
        self.buildah("rm", container)
        shutil.rmtree(system)
        return "localhost/debian"

    def test_the_image_is_built_and_its_daemon_serves(self):
        # What this machine compiled serves the image as well, where ccache finds it to be the same.
        cache = pathlib.Path(programs.run("ccache", "--get-config", "cache_dir").stdout.strip())
        cache.mkdir(parents=True, exist_ok=True)
        self.buildah("build", "--build-arg", f"BASE={self.base()}", "--pull-never", "--volume",
                     f"{cache}:/root/.cache/ccache", "--file", programs.ROOT / "deploy/container/Dockerfile", "--tag",
                     "localhost/mapkeep", self.context())
        container = self.buildah("from", "--pull-never", "localhost/mapkeep")[-1]
        root = pathlib.Path(self.buildah("mount", container)[-1])

        inspected = json.loads("\n".join(self.buildah("inspect", container)))
        settings = inspected["OCIv1"]["config"]
        self.assertEqual(settings["User"], "10001:10001")
        self.assertIn("/var/lib/mapkeep", settings["Volumes"])
        for compiler in ("usr/bin/g++", "usr/bin/cmake", "src"):
            self.assertFalse((root / compiler).exists(), f"{compiler} has no business in the image")
        self.serves(root, settings["Entrypoint"])

    def context(self):
        """What git knows, as a clone would hold it."""
        context = self.scratch / "context"
        context.mkdir()
        files = programs.run("git", "-C", programs.ROOT, "ls-files", "-z").stdout.split("\0")
        for name in filter(None, files):
            (context / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(programs.ROOT / name, context / name)
        return context

    def serves(self, root, entrypoint):
        """Starts the image's program in its root, which it cannot write, and asks whether it is ready."""
        data = self.scratch / "data"
        data.mkdir()
        os.chown(data, 10001, 10001)
        words = [*entrypoint, "--listen", "127.0.0.1:0", "--admin", "127.0.0.1:0", "--ports-file",
                 "/var/lib/mapkeep/ports.json"]
        script = ('mount --bind "$0" "$0" && mount --bind "$1" "$0/var/lib/mapkeep" && mount -o remount,ro,bind "$0" && '
                  'exec chroot --userspec=10001:10001 "$0" "${@:2}"')
        with open(self.scratch / "log", "w") as log:
            daemon = subprocess.Popen(["unshare", "--mount", "bash", "-c", script, root, data, *words], stdout=log,
                                      stderr=log)
        try:
            deadline = time.monotonic() + 60
            while not (data / "ports.json").exists():
                if daemon.poll() is not None or time.monotonic() > deadline:
                    raise AssertionError("the image's daemon did not start:\n" + (self.scratch / "log").read_text())
                time.sleep(0.1)
            admin = json.loads((data / "ports.json").read_text())["admin"]
            with urllib.request.urlopen(f"http://{admin}/readyz", timeout=10) as answer:
                self.assertEqual(answer.status, 200)
        finally:
            daemon.terminate()
            self.assertEqual(daemon.wait(timeout=60), 0)


if __name__ == "__main__":
    unittest.main()
