"""Pages and tiles over HTTP of a real daemon: what a browser, a proxy or a script sees."""

import gzip
import http.client
import json
import pathlib
import socket
import ssl
import tempfile
import threading
import time
import unittest
import urllib.parse

import streets
from programs import BIN, TIMEOUT_S, Daemon, run

MAP = "/v1/maps/street"


class Answer:
    def __init__(self, response):
        self.status = response.status
        self.headers = response.headers
        self.body = response.read()

    def json(self):
        return json.loads(self.body)


def get(address, path, method="GET", tls=None, **headers):
    """One request; keyword accept_encoding is the field Accept-Encoding."""
    if tls is None:
        connection = http.client.HTTPConnection(address, timeout=TIMEOUT_S)
    else:
        connection = http.client.HTTPSConnection(address, timeout=TIMEOUT_S, context=tls)
    try:
        fields = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request(method, path, headers=fields)
        return Answer(connection.getresponse())
    finally:
        connection.close()


def tiles_of(tileset, base):
    """Paths of all tiles, with what they are relative to."""
    found = []

    def walk(tile):
        if "content" in tile:
            found.append(urllib.parse.urljoin(base, tile["content"]["uri"]))
        for child in tile.get("children", []):
            walk(child)

    walk(tileset["root"])
    return found


class Events(threading.Thread):
    """Listens to a map's events."""

    def __init__(self, address, path, **headers):
        super().__init__(daemon=True)
        self.events = []
        self.ended = False
        self.connection = http.client.HTTPConnection(address, timeout=TIMEOUT_S)
        self.connection.request("GET", path, headers=headers)
        self.response = self.connection.getresponse()
        self.start()

    def run(self):
        event = {}
        for line in self.response:
            line = line.decode().rstrip("\n")
            if line.startswith(":"):
                continue
            if line:
                name, _, value = line.partition(": ")
                event[name] = value
            elif event:
                self.events.append((event["event"], json.loads(event["data"]), event.get("id")))
                event = {}
        self.ended = True

    def wait(self, wanted):
        deadline = time.monotonic() + TIMEOUT_S
        while not any(wanted(name, data) for name, data, _ in list(self.events)):
            if time.monotonic() > deadline or self.ended:
                raise AssertionError(f"the event never came: {self.events}")
            time.sleep(0.02)


class Pages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.scratch = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        assets = cls.scratch / "viewer"
        (assets / "assets").mkdir(parents=True)
        (assets / "index.html").write_text("<!doctype html><title>page</title>" + " " * 2000)
        (assets / "assets/main-1234.js").write_text("let a = 1;\n" * 500)
        cls.daemon = cls.enterClassContext(Daemon("--http", "127.0.0.1:0", "--http-assets", assets, "--http-cors", "*"))
        cls.sessions = streets.simulate(cls.scratch / "street", sessions=2, scans=12)
        cls.daemon.cli("map", "create", "street")
        cls.daemon.cli("map", "create", "empty")
        cls.upload("first", cls.sessions[0])

    @classmethod
    def upload(cls, name, session):
        cls.daemon.cli("session", "upload", "street", session, "--id", name, "--wait")

    def get(self, path, **headers):
        return get(self.daemon.http, path, **headers)

    def test_json_reads_like_the_protos(self):
        maps = self.get("/v1/maps").json()["maps"]
        self.assertEqual([m["name"] for m in maps], ["empty", "street"])
        street = self.get(MAP).json()
        self.assertGreater(int(street["staticVoxels"]), 1000)
        self.assertEqual(street["voxelSize"], 0.2)
        epochs = self.get(MAP + "/epochs?limit=10").json()["epochs"]
        self.assertEqual(epochs[-1]["kind"], "empty")
        first = next(e for e in epochs if e["session"] == "first")
        self.assertEqual((first["kind"], first["epoch"], first["readable"]), ("session", "1", True))
        sessions = self.get(MAP + "/sessions").json()["sessions"]
        self.assertEqual(sessions[0]["id"], "first")
        session = self.get(MAP + "/sessions/first").json()
        self.assertEqual(session["state"], "SESSION_STATE_COMMITTED")
        poses = self.get(MAP + "/sessions/first/poses").json()
        self.assertEqual((len(poses["poses"]), poses["scanCount"]), (12, 12))
        self.assertEqual(len(self.get(MAP + "/sessions/first/poses?first=10").json()["poses"]), 2)

    def test_a_voxel_is_what_query_prints(self):
        centroids = self.daemon.directory / "centroids.ply"
        self.daemon.cli("export", "street", centroids, "--centroids")
        header, body = centroids.read_bytes().split(b"end_header\n", 1)
        x, y, z = memoryview(body[:12]).cast("f")
        voxel = self.get(f"{MAP}/voxel?x={x}&y={y}&z={z}").json()
        told = self.daemon.json("query", "street", "--", x, y, z)
        self.assertAlmostEqual(voxel["stability"], told["stability"], places=5)
        self.assertEqual(voxel["isStatic"], True)
        at_one = self.get(f"{MAP}/voxel?x={x}&y={y}&z={z}&epoch=1").json()
        self.assertEqual(at_one["epoch"], "1")
        self.assertEqual(self.get(f"{MAP}/voxel?x={x}&y={y}&z=9000").status, 404)
        self.assertEqual(self.get(f"{MAP}/voxel?x={x}&y={y}").status, 400)
        self.assertEqual(self.get(f"{MAP}/voxel?x={x}&y={y}&z={z}&epoch=77").status, 404)

    def test_what_is_not_there_says_so_in_json(self):
        for path, status in [("/nothing", 404), ("/v1", 404), ("/v1/maps/absent", 404), (MAP + "/epochs/99/tileset.json", 404),
                             (MAP + "/epochs/x/tileset.json", 400), (MAP + "/epochs/1/tiles/30_0_0.glb", 404),
                             (MAP + "/epochs/1/tiles/0_30000_0.glb", 404), (MAP + "/epochs/1/tiles/..%2f..", 400),
                             (MAP + "/sessions/absent", 404), (MAP + "/sessions/absent/poses", 404),
                             (MAP + "/changes/0", 404), (MAP + "/changes/a/b", 400), ("/v1/maps/..", 400),
                             ("/viewer/../etc/passwd", 400), ("/viewer/absent.js", 404), ("/v1/maps/a%20b", 400),
                             (MAP + "/sessions?pageToken=%21", 400), (MAP + "/epochs?limit=x", 400)]:
            answer = self.get(path)
            self.assertEqual(answer.status, status, path)
            self.assertIn("message", answer.json()["error"], path)

    def test_tiles_are_kept_for_ever_and_asked_for_in_parts(self):
        latest = self.get(MAP + "/latest/tileset.json")
        self.assertEqual(latest.headers["Cache-Control"], "no-cache")
        self.assertEqual(self.get(MAP + "/latest/tileset.json", If_None_Match=latest.headers["ETag"]).status, 304)
        epoch = latest.json()["extras"]["mapkeep"]["epoch"]
        base = f"{MAP}/epochs/{epoch}/tileset.json"
        tileset = self.get(base)
        self.assertIn("immutable", tileset.headers["Cache-Control"])
        tiles = tiles_of(tileset.json(), base)
        self.assertEqual(sorted(tiles), sorted(tiles_of(latest.json(), MAP + "/latest/tileset.json")))
        tile = self.get(tiles[-1])
        self.assertEqual((tile.status, tile.headers["Content-Type"]), (200, "model/gltf-binary"))
        self.assertIn("immutable", tile.headers["Cache-Control"])
        self.assertEqual(tile.headers["Access-Control-Allow-Origin"], "*")
        # Not changed: nothing is sent. Another state: everything.
        again = self.get(tiles[-1], If_None_Match=tile.headers["ETag"])
        self.assertEqual((again.status, again.body), (304, b""))
        self.assertEqual(self.get(tiles[-1], If_None_Match='"other"').status, 200)
        # Parts.
        part = self.get(tiles[-1], Range="bytes=100-299", Accept_Encoding="gzip")
        self.assertEqual((part.status, part.body), (206, tile.body[100:300]))
        self.assertEqual(part.headers["Content-Range"], f"bytes 100-299/{len(tile.body)}")
        self.assertEqual(self.get(tiles[-1], Range="bytes=-10").body, tile.body[-10:])
        self.assertEqual(self.get(tiles[-1], Range="bytes=999999999-").status, 416)
        # Packed.
        packed = self.get(tiles[-1], Accept_Encoding="gzip")
        self.assertEqual(packed.headers["Content-Encoding"], "gzip")
        self.assertIn("Accept-Encoding", packed.headers["Vary"])
        self.assertEqual(gzip.decompress(packed.body), tile.body)
        self.assertLess(len(packed.body), len(tile.body) / 2)
        self.assertEqual(self.get(tiles[-1], Accept_Encoding="zstd").headers["Content-Encoding"], "zstd")
        self.assertNotEqual(packed.headers["ETag"], tile.headers["ETag"])
        # The short name, and a head without its body.
        short = tiles[-1].split("/")
        short[-1] = short[-1].split(".")[0] + ".glb"
        self.assertEqual(self.get("/".join(short)).body, tile.body)
        head = self.get(tiles[-1], method="HEAD")
        self.assertEqual((head.status, head.body, head.headers["Content-Length"]), (200, b"", str(len(tile.body))))

    def test_an_empty_map_is_an_empty_tileset(self):
        self.assertNotIn("content", self.get("/v1/maps/empty/latest/tileset.json").json()["root"])
        self.assertEqual(self.get("/v1/maps/empty/epochs/0/tileset.json").status, 200)

    def test_the_viewer_is_served_with_its_parts(self):
        page = self.get("/", Accept_Encoding="gzip")
        self.assertEqual((page.status, page.headers["Content-Type"]), (200, "text/html; charset=utf-8"))
        self.assertIn(b"<title>page", gzip.decompress(page.body))
        self.assertEqual(self.get("/", If_None_Match=page.headers["ETag"], Accept_Encoding="gzip").status, 304)
        script = self.get("/viewer/assets/main-1234.js")
        self.assertIn("immutable", script.headers["Cache-Control"])
        self.assertTrue(script.headers["Content-Type"].startswith("text/javascript"))
        self.assertEqual(self.get("/viewer/").body, self.get("/viewer/index.html").body)

    def test_five_hundred_slow_readers_delay_nobody(self):
        base = MAP + "/epochs/1/tileset.json"
        tiles = [(len(self.get(path).body), path) for path in tiles_of(self.get(base).json(), base)]
        path = max(tiles)[1]
        before = self.memory()
        readers = []
        for _ in range(500):
            reader = socket.socket()
            reader.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            reader.connect(("127.0.0.1", int(self.daemon.http.rsplit(":", 1)[1])))
            # As much as the buffers of the kernel do not take: pipelined until the answer is stuck.
            reader.sendall(f"GET {path} HTTP/1.1\r\nHost: x\r\n\r\n".encode() * 40)
            self.addCleanup(reader.close)
            readers.append(reader)
        for _ in range(50):
            self.assertEqual(get(self.daemon.admin, "/readyz").status, 200)
            self.assertEqual(self.get(base).status, 200)
            self.assertEqual(self.get(path).status, 200)
        # They share the bytes of the tile: what each costs is a connection.
        self.assertLess(self.memory() - before, 128)
        for reader in readers:
            reader.setblocking(False)
            self.assertNotEqual(reader.recv(1, socket.MSG_PEEK), b"")  # still served

    def memory(self):
        """MiB of the daemon."""
        status = pathlib.Path(f"/proc/{self.daemon.process.pid}/status").read_text()
        return int(status.split("VmRSS:")[1].split()[0]) / 1024

    def test_z_a_commit_shows_up_live_and_changes_few_tiles(self):
        """Last, as it changes the map."""
        events = Events(self.daemon.http, MAP + "/events")
        events.wait(lambda name, data: name == "epoch" and data["epoch"] == "1")
        self.assertEqual(events.events[0][2], "1")
        self.upload("second", self.sessions[1])
        events.wait(lambda name, data: name == "epoch" and (data["epoch"], data["session"]) == ("2", "second"))
        events.wait(lambda name, data: name == "session" and data["state"] == "SESSION_STATE_COMMITTED")
        states = {data["state"] for name, data, _ in events.events if name == "session"}
        self.assertIn("SESSION_STATE_RUNNING", states)
        # Who comes back having seen epoch 2 is not told of it again.
        again = Events(self.daemon.http, MAP + "/events", **{"Last-Event-ID": "2"})
        self.daemon.cli("map", "rollback", "street", "--epoch", "1")
        again.wait(lambda name, data: name == "epoch" and (data["epoch"], data["kind"]) == ("3", "rollback"))
        self.assertNotIn("2", [data["epoch"] for name, data, _ in again.events if name == "epoch"])

        # Changes between epochs, and none after the rollback.
        changes = self.get(MAP + "/changes/1/2").json()
        self.assertGreater(changes["appeared"], 0)
        self.assertEqual(self.get(MAP + "/changes/2/1").json()["disappeared"], changes["appeared"])
        self.assertEqual(self.get(MAP + "/changes/1/3").json(), {"appeared": 0, "disappeared": 0, "unstable": 0})
        points = self.get(MAP + "/changes/1/2/points.glb")
        self.assertEqual(points.body[:4], b"glTF")
        self.assertIn(b'"_CLASS"', points.body)
        self.assertEqual(self.get(MAP + "/changes/1/99").status, 404)
        # A rollback has the tiles of the epoch that it brought back: names and all.
        names = [[path.rsplit("/", 1)[1] for path in tiles_of(self.get(f"{MAP}/epochs/{epoch}/tileset.json").json(), "/")]
                 for epoch in (1, 3)]
        self.assertEqual(*names)

        # The end of the daemon ends the streams.
        self.assertEqual(self.daemon.stop(), 0)
        again.join(TIMEOUT_S)
        events.join(TIMEOUT_S)
        self.assertTrue(again.ended and events.ended)

    def test_a_collected_epoch_is_gone(self):
        with Daemon("--http", "127.0.0.1:0", "--config", self.short_history()) as daemon:
            daemon.cli("map", "create", "street")
            daemon.cli("session", "upload", "street", self.sessions[0], "--id", "first", "--wait")
            self.assertEqual(get(daemon.http, MAP + "/epochs/1/tileset.json").status, 200)
            daemon.cli("map", "rollback", "street", "--epoch", "0")
            daemon.cli("map", "rollback", "street", "--epoch", "0")
            daemon.cli("admin", "gc")
            deadline = time.monotonic() + TIMEOUT_S
            while (gone := get(daemon.http, MAP + "/epochs/1/tileset.json")).status == 200 and time.monotonic() < deadline:
                time.sleep(0.1)
            self.assertEqual(gone.status, 410)
            self.assertIn("oldest", gone.json()["error"]["message"])
            self.assertEqual(get(daemon.http, MAP + "/epochs/1/tiles/0_0_0.glb").status, 410)
            self.assertEqual(get(daemon.http, MAP + "/voxel?x=1&y=1&z=1&epoch=1").status, 410)
            self.assertEqual(get(daemon.http, MAP + "/changes/1/2").status, 410)

    def short_history(self):
        file = self.scratch / "short.toml"
        file.write_text("[history]\nkeep_epochs = 1\n")
        return file


class GuardedPages(unittest.TestCase):
    """With TLS and tokens: the same rules as gRPC."""

    @classmethod
    def setUpClass(cls):
        cls.scratch = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        certificate, key, tokens = (cls.scratch / name for name in ("cert.pem", "key.pem", "tokens"))
        run("openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes", "-days", "2",
            "-subj", "/CN=server", "-addext", "subjectAltName=DNS:localhost,IP:127.0.0.1", "-keyout", key, "-out", certificate)
        cls.token = {}
        for name, role, of_map in (("console", "operator", "*"), ("screen", "reader", "yard"), ("truck", "robot", "yard")):
            cls.token[name] = run(BIN / "mapkeepd", "token", name, "--role", role, "--map", of_map, "--append",
                                  tokens).stdout.strip()
        cls.daemon = cls.enterClassContext(
            Daemon("--http", "127.0.0.1:0", "--tls-cert", certificate, "--tls-key", key, "--tokens", tokens))
        cls.tls = ssl.create_default_context(cafile=certificate)
        for name in ("yard", "depot"):
            cls.daemon.cli("--tls-ca", certificate, "--token", cls.token["console"], "map", "create", name)

    def get(self, path, who=None, **headers):
        if who is not None:
            headers["Authorization"] = f"Bearer {self.token.get(who, who)}"
        return get(self.daemon.http, path, tls=self.tls, **headers)

    def test_no_token_and_a_wrong_one_are_401_without_the_secret_in_the_log(self):
        for who in (None, "mk_wrong_secret"):
            answer = self.get("/v1/maps/yard", who)
            self.assertEqual((answer.status, answer.headers["WWW-Authenticate"]), (401, "Bearer"))
            self.assertEqual(self.get("/v1/maps", who).status, 401)
            self.assertEqual(self.get("/v1/maps/yard/events", who).status, 401)
        log = (self.daemon.directory / "log").read_text()
        self.assertIn("page refused", log)
        self.assertNotIn("mk_wrong_secret", log)

    def test_a_reader_sees_its_maps_alone(self):
        self.assertEqual(self.get("/v1/maps/yard/latest/tileset.json", "screen").status, 200)
        self.assertEqual(self.get("/v1/maps/depot", "screen").status, 403)
        self.assertEqual(self.get("/v1/maps/depot/epochs/0/tileset.json", "screen").status, 403)
        self.assertEqual([m["name"] for m in self.get("/v1/maps", "screen").json()["maps"]], ["yard"])
        self.assertEqual(len(self.get("/v1/maps", "console").json()["maps"]), 2)
        # What robots may is to upload.
        self.assertEqual(self.get("/v1/maps/yard", "truck").status, 403)

    def test_the_token_may_stand_in_the_address_for_those_who_cannot_send_fields(self):
        self.assertEqual(self.get(f"/v1/maps/yard?token={self.token['screen']}").status, 200)

    def test_caches_on_the_way_do_not_keep_what_not_everybody_may_see(self):
        self.assertIn("private", self.get("/v1/maps/yard/epochs/0/tileset.json", "screen").headers["Cache-Control"])

    def test_the_viewer_itself_is_for_everybody(self):
        self.assertIn(self.get("/").status, (200, 404))

    def test_without_tls_there_is_no_answer(self):
        with self.assertRaises((OSError, http.client.HTTPException)):
            get(self.daemon.http, "/v1/maps")
        self.assertEqual(self.get("/v1/maps/yard", "screen").status, 200)


if __name__ == "__main__":
    unittest.main(verbosity=2)
