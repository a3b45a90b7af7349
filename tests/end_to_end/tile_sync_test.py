"""`mapkeep tiles sync`: a folder that is the map as of one epoch, whatever happens to the process that keeps it."""

import json
import os
import pathlib
import random
import signal
import subprocess
import tempfile
import time
import unittest

import streets
from programs import BIN, LONG, TIMEOUT_S, Daemon

ROUNDS = 60 if LONG else 8


def manifest(folder):
    return json.loads((folder / "manifest.json").read_text())


def content(folder):
    """What a reader of the folder has: the tiles that the manifest names. Fails if one is missing or cut short."""
    tiles = {}
    for tile in manifest(folder)["tiles"]:
        bytes_of = (folder / tile["file"]).read_bytes()
        assert len(bytes_of) == tile["bytes"], tile
        tiles[tile["x"], tile["y"]] = bytes_of
    return tiles


class TileSync(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        scratch = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        cls.sessions = streets.simulate(scratch / "street", sessions=2)
        cls.daemon = cls.enterClassContext(Daemon())
        cls.daemon.cli("map", "create", "street")
        cls.daemon.cli("session", "upload", "street", cls.sessions[0], "--wait")
        cls.daemon.cli("session", "upload", "street", cls.sessions[1], "--wait")

    def setUp(self):
        self.scratch = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))

    def sync(self, folder, *flags):
        return json.loads(self.daemon.cli("--json", "tiles", "sync", "street", folder, *flags).stdout)

    def test_a_folder_follows_the_map_by_what_changed_alone(self):
        folder = self.scratch / "tiles"
        first = self.sync(folder, "--epoch", 1)
        self.assertEqual((first["epoch"], first["received"]), (1, first["tiles"]))
        old = content(folder)
        second = self.sync(folder)
        self.assertEqual(second["epoch"], 2)
        new = content(folder)
        changed = sum(new[place] != old.get(place) for place in new)
        self.assertEqual(second["received"], changed)
        again = self.sync(folder)
        self.assertEqual((again["received"], again["dropped"]), (0, 0))
        fresh = self.scratch / "fresh"
        self.sync(fresh)
        self.assertEqual(content(fresh), new)
        self.assertEqual({path.name for path in (folder / "tiles").iterdir()},
                         {path.name for path in (fresh / "tiles").iterdir()})

    def test_a_box_is_the_tiles_that_it_touches(self):
        everything = self.sync(self.scratch / "all")
        folder = self.scratch / "box"
        box = self.sync(folder, "--box", "1,1,0,2,2,1")
        self.assertEqual(list(content(folder)), [(0, 0)])
        self.assertEqual(box["tiles"], 1)
        self.assertGreater(everything["tiles"], 1)
        wider = self.sync(folder)
        self.assertEqual(wider["received"], everything["tiles"] - 1)
        narrower = self.sync(folder, "--box", "1,1,0,2,2,1")
        self.assertEqual((narrower["received"], narrower["dropped"]), (0, everything["tiles"] - 1))

    def test_damage_is_made_good_and_strangers_are_left_alone(self):
        folder = self.scratch / "tiles"
        self.sync(folder)
        whole = content(folder)
        names = [folder / tile["file"] for tile in manifest(folder)["tiles"]]
        names[0].unlink()
        names[1].write_bytes(names[1].read_bytes()[:-7])
        self.assertEqual(self.sync(folder)["received"], 2)
        self.assertEqual(content(folder), whole)

        self.daemon.cli("map", "create", "other")
        refused = self.daemon.cli("tiles", "sync", "other", folder, check=1)
        self.assertIn("holds tiles of map street", refused.stderr)
        (self.scratch / "alien").mkdir()
        (self.scratch / "alien/manifest.json").write_text('{"name": "an app"}')
        refused = self.daemon.cli("tiles", "sync", "street", self.scratch / "alien", check=1)
        self.assertIn("not the manifest", refused.stderr)

    def test_kill_9_at_any_moment_leaves_a_whole_epoch_and_loses_no_tile_received(self):
        undisturbed = self.scratch / "undisturbed"
        began = time.monotonic()
        self.sync(undisturbed)
        took = time.monotonic() - began
        newest = content(undisturbed)
        folder = self.scratch / "tiles"
        self.sync(folder, "--epoch", 1)
        old = content(folder)
        moments = random.Random(1)
        cut_short = resumed = 0
        for kill in range(ROUNDS):
            # There and back: each round has something to change.
            wanted = () if kill % 2 == 0 else ("--epoch", "1")
            with self.subTest(kill=kill):
                before = set(os.listdir(folder / "tiles"))
                sync = subprocess.Popen(
                    [BIN / "mapkeep", "--server", self.daemon.server, "tiles", "sync", "street", folder, *wanted],
                    stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                # Half of the kills at any time, half when some tile has just come.
                if kill % 4 < 2:
                    time.sleep(moments.uniform(0, 1.2 * took))
                else:
                    enough = moments.randint(1, 4)
                    while len(set(os.listdir(folder / "tiles")) - before) < enough and sync.poll() is None:
                        pass
                sync.send_signal(signal.SIGKILL)
                sync.wait(timeout=TIMEOUT_S)
                cut_short += sync.returncode == -signal.SIGKILL
                now = content(folder)
                self.assertEqual(now, newest if manifest(folder)["epoch"] == 2 else old)
                named = {tile["file"] for tile in manifest(folder)["tiles"]}
                strays = [path for path in (folder / "tiles").glob("*.tile") if f"tiles/{path.name}" not in named]
                target, wrong = (newest, old) if not wanted else (old, newest)
                to_come = sum(now.get(place) != target[place] for place in target)
                there = sum(self.is_target(path, target) for path in strays)  # before they are moved or removed
                result = self.sync(folder, *wanted)
                self.assertEqual(result["received"], to_come - there)
                resumed += len(strays)
                self.assertEqual(content(folder), target)
        print(f"{cut_short} of {ROUNDS} kills met it at work, {resumed} tiles were there already afterwards")

    @staticmethod
    def is_target(path, target):
        return path.read_bytes() in target.values()

    def test_a_follower_sees_new_epochs_and_outlives_the_daemon(self):
        folder = self.scratch / "tiles"
        settings = self.scratch / "mapkeepd.toml"
        settings.write_text("[limits]\nwatch_seconds = 2\n")
        with Daemon("--config", settings) as daemon:
            daemon.cli("map", "create", "street")
            daemon.cli("session", "upload", "street", self.sessions[0], "--wait")
            follower = subprocess.Popen(
                [BIN / "mapkeep", "--server", daemon.server, "--json", "tiles", "sync", "street", folder, "--follow"],
                stdout=subprocess.PIPE, text=True)
            try:
                self.assertEqual(json.loads(follower.stdout.readline())["epoch"], 1)
                daemon.cli("session", "upload", "street", self.sessions[1], "--wait")
                self.assertEqual(json.loads(follower.stdout.readline())["epoch"], 2)
                daemon.kill()
                daemon.start(daemon.server)
                daemon.cli("map", "rollback", "street", "--epoch", 1)
                epoch = 0
                while epoch < 3:  # it may say epoch 2 once more after the break
                    line = follower.stdout.readline()
                    self.assertTrue(line, "the follower ended")
                    epoch = json.loads(line)["epoch"]
                fresh = self.scratch / "fresh"
                daemon.cli("tiles", "sync", "street", fresh)
                self.assertEqual(content(folder), content(fresh))
            finally:
                follower.kill()
                follower.communicate()


if __name__ == "__main__":
    unittest.main(verbosity=2)
