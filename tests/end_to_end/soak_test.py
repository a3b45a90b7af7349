"""A daemon under mixed load for a while (20 minutes with MAPKEEP_LONG=1): robots upload and watch, readers stream, a
folder follows, pages are read, connections break off. Its memory levels off, it leaks no descriptor, and no queue
grows."""

import json
import os
import pathlib
import random
import re
import socket
import statistics
import subprocess
import threading
import time
import unittest
import urllib.error
import urllib.parse
import urllib.request

import programs
from programs import BIN, LONG, TIMEOUT_S, Daemon

SECONDS = 1200 if LONG else 20
LEAST_ROUNDS = 3
# Small caches are full soon: what grows after that is a leak.
SETTINGS = """
[history]
keep_epochs = 10
collect_seconds = 5
[limits]
block_cache_mib = 16
http_cache_mib = 8
plan_cache_mib = 4
watch_seconds = 20
[rocksdb]
block_cache_mib = 8
write_buffer_mib = 16
"""
# What memory is made up of, as the daemon says: printed, so that one sees what grew if something did.
PARTS = ("process_heap_used_bytes", "process_heap_free_bytes", "rocksdb_write_buffer_bytes",
         "rocksdb_block_cache_bytes", "rocksdb_table_reader_bytes", "plan_cache_bytes", "scan_cache_bytes",
         'cache_bytes{cache="blocks"}', 'cache_bytes{cache="nodes"}', 'cache_bytes{cache="tiles"}',
         'cache_bytes{cache="http_tiles"}', 'cache_bytes{cache="http_points"}')
QUEUES = ("jobs_waiting", "jobs_running", "uploads_open", "upload_pending_bytes", "pool_waiting", "pool_running",
          "staging_waiting", "staging_running")


class Soak:
    """What goes on beside the robots, and what the daemon says of itself."""

    def __init__(self, daemon):
        self.daemon = daemon
        self.stop = threading.Event()
        self.pages = self.broken_off = 0
        self.errors = []
        self.threads = [threading.Thread(target=work) for work in (self.read_pages, self.break_off)]
        for thread in self.threads:
            thread.start()

    def end(self):
        self.stop.set()
        for thread in self.threads:
            thread.join()

    def get(self, path):
        with urllib.request.urlopen(f"http://{self.daemon.http}{path}", timeout=TIMEOUT_S) as answer:
            return answer.read()

    def read_pages(self):
        while not self.stop.wait(0.05):
            try:
                tileset = json.loads(self.get("/v1/maps/soak/latest/tileset.json"))
                content = tileset["root"].get("content")
                if content:
                    self.get(urllib.parse.urljoin("/v1/maps/soak/latest/", content["uri"]))
                self.pages += 1
            except urllib.error.HTTPError as error:
                if error.code not in (404, 410):  # no map yet; an epoch that was collected meanwhile
                    self.errors.append(error)
            except OSError as error:
                self.errors.append(error)

    def break_off(self):
        """Connects, says half a sentence or nothing, and goes."""
        while not self.stop.wait(0.1):
            for address in (self.daemon.server, self.daemon.http, self.daemon.admin):
                host, port = address.rsplit(":", 1)
                with socket.create_connection((host, int(port)), timeout=TIMEOUT_S) as connection:
                    connection.sendall(random.choice((b"", b"GET /v1/ma", b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n")))
                self.broken_off += 1

    def metrics(self):
        with urllib.request.urlopen(f"http://{self.daemon.admin}/metrics", timeout=TIMEOUT_S) as answer:
            text = answer.read().decode()
        return {name: float(value) for name, value in re.findall(r"^mapkeep_(\S+) (\S+)$", text, re.M)}

    def descriptors(self):
        """Sockets and whatever else is no file of the store; files that were removed and are still open."""
        others = removed = 0
        folder = pathlib.Path(f"/proc/{self.daemon.process.pid}/fd")
        for entry in folder.iterdir():
            try:
                target = os.readlink(entry)
            except FileNotFoundError:
                continue
            others += not target.startswith(str(self.daemon.directory))
            removed += target.endswith(" (deleted)")
        return others, removed

    def settled(self):
        """What it says once nothing is to be done any more, which must come."""
        deadline = time.monotonic() + TIMEOUT_S
        while True:
            said = self.metrics()
            waiting = {name: said[name] for name in QUEUES if said[name] > 0}
            if not waiting:
                return said
            if time.monotonic() > deadline:
                raise AssertionError(f"still waiting: {waiting}")
            time.sleep(0.2)


class SoakTest(unittest.TestCase):
    def test_under_mixed_load_memory_levels_off_and_no_descriptor_leaks_and_no_queue_grows(self):
        with Daemon("--http", "127.0.0.1:0") as daemon:
            settings = daemon.directory / "mapkeepd.toml"
            settings.write_text(SETTINGS)
            daemon.flags = (*daemon.flags, "--config", settings)
            daemon.stop()
            daemon.start()
            follower = None
            soak = Soak(daemon)
            samples = []
            sessions = 0
            begin = time.monotonic()
            try:
                while time.monotonic() < begin + SECONDS or len(samples) < LEAST_ROUNDS:
                    # Odd rounds in batches large and whole, even ones thinned.
                    load = programs.run(
                        BIN / "fleet_load", "--server", daemon.server, "--map", "soak", "--prefix",
                        f"round{len(samples)}", "--robots", 4, "--scans", 6, "--readers", 2, "--route", 6,
                        "--every-nth-point", 1 if len(samples) % 2 else 8)
                    sessions += len(json.loads(load.stdout)["sessions"])
                    if follower is None:
                        follower = subprocess.Popen(
                            [BIN / "mapkeep", "--server", daemon.server, "tiles", "sync", "soak",
                             daemon.directory / "tiles", "--follow"], stdout=subprocess.DEVNULL)
                    said = soak.settled()
                    samples.append((said["process_resident_bytes"] / 2**20, *soak.descriptors(),
                                    said["process_threads"], *(said[part] / 2**20 for part in PARTS)))
                    self.assertIsNone(follower.poll(), "the follower ended")
            finally:
                soak.end()
                if follower is not None:
                    follower.kill()
                    follower.wait()
            minutes = (time.monotonic() - begin) / 60
            daemon.cli("admin", "check", "soak")
            self.assertEqual(soak.errors, [])
            self.assertGreater(soak.pages, 0)
            for name, column in zip(("MiB resident", "other descriptors", "removed files open", "threads",
                                     *(f"MiB of {part.replace('_bytes', '')}" for part in PARTS)), zip(*samples)):
                print(f"{name}: first {column[0]:.0f}, median of the second third "
                      f"{self.third(column, 1):.0f}, of the last {self.third(column, 2):.0f}, most {max(column):.0f}")
            print(f"{minutes:.1f} minutes, {len(samples)} rounds, {sessions} sessions committed, {soak.pages} pages, "
                  f"{soak.broken_off} connections broken off")
            memory, others, removed, threads, *_ = zip(*samples)
            self.assertLess(self.third(memory, 2), 1.1 * self.third(memory, 1) + 32)
            # A few connections may just be on their way.
            self.assertLess(self.third(others, 2), self.third(others, 1) + 16)
            self.assertLess(self.third(removed, 2), self.third(removed, 1) + 16)
            self.assertLess(self.third(threads, 2), self.third(threads, 1) + 16)

    @staticmethod
    def third(column, which):
        size = max(1, len(column) // 3)
        return statistics.median(column[which * size:(which + 1) * size] if which < 2 else column[-size:])


if __name__ == "__main__":
    unittest.main()
