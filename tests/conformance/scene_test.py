#!/usr/bin/env python3
"""Opens sessions in a level of the client's own with each client: scene_test.py SIGHTLINED STUBS NAME=COMMAND...

The arguments are those of conformance_test.py, without its README.
"""
import json
import pathlib
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).parent
# The players' module has its own view of the arguments.
sys.argv.insert(3, "")
sys.path.insert(0, str(HERE.parent / "live"))
import conformance_test as conformance  # noqa: E402
from conformance_test import COMMANDS, SIGHTLINED  # noqa: E402

import players  # noqa: E402
from daemon import Daemon  # noqa: E402

COURT = str(HERE / "sessions/court.glb")
OPENING = {"scene": {"bindings": [{"node": "post", "id": "7"}]}, "targets": [{"id": "7"}], "camera": {"position": {"z": 6.0, "y": 1.6}}}
TOO_LARGE = 2 << 20  # bytes, for a daemon that takes 1 MiB


def gltf(uri):
    """A level of one triangle, whose corners are elsewhere."""
    return json.dumps({
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "name": "post"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "buffers": [{"uri": uri, "byteLength": 36}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [0, 0, 0]}]}).encode()


class Scene(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.daemon = cls.enterClassContext(Daemon(SIGHTLINED, "--max-upload-mib", "1"))
        cls.folder = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        with open(COURT, "rb") as court:
            whole = court.read()
        cls.refused = {}  # path, by code and field of the error
        for name, content, code, field in (("noise.glb", b"glTF" + bytes(60), "INVALID_ARGUMENT", "glb.header.version"),
                                           ("cut.glb", whole[:-40], "INVALID_ARGUMENT", "glb.header.length"),
                                           ("corners.gltf", gltf("corners.bin"), "INVALID_ARGUMENT", "buffers[0].uri"),
                                           ("large.glb", whole + bytes(TOO_LARGE), "RESOURCE_EXHAUSTED", "chunk")):
            (cls.folder / name).write_bytes(content)
            cls.refused[str(cls.folder / name)] = code, field

    def player(self, client):
        return conformance.Player(client.removesuffix(":base64"))

    def open(self, player, **scene):
        return player.run({"open": OPENING, "address": self.daemon.address, "uploads": [], **scene})

    def test_a_session_goes_on_in_the_level_of_its_client_in_a_daemon_that_does_not_have_it(self):
        for client in COMMANDS:
            for kind in ("scene_file", "scene"):
                with self.subTest(client=client, given_as=kind):
                    player = self.player(client)
                    opened = self.open(player, **{kind: COURT})["opened"]
                    self.assertEqual("2", opened["instanceCount"])
                    before = player.run({"tick": {"timeS": 0.0}})["camera"]
                    self.daemon.replace("kill")
                    after = player.run({"tick": {"timeS": 0.1}})["camera"]
                    self.assertEqual(before["mirrorHash"], after["mirrorHash"])
                    self.assertEqual(1, player.run({"close": {}})["closed"]["resyncs"])
                    player.close()

    def test_a_level_that_the_daemon_refuses_is_an_error_with_its_code_and_field(self):
        for client in COMMANDS:
            player = self.player(client)
            for path, expected in self.refused.items():
                with self.subTest(client=client, level=path):
                    failed = self.open(player, scene_file=path)["failed"]
                    self.assertEqual(expected, (failed["code"], failed["violations"][0]["field"]))
            player.close()

    def test_a_live_camera_does_the_same(self):
        for client, command in COMMANDS.items():
            if "--asyncio" in command:
                continue  # it has none of its own
            with self.subTest(client=client), players.Player(client, command) as player:
                self.live_open(player, COURT)
                before = player.run({"live_tick": {"timeS": 0.0}})["view"]
                self.assertEqual("reply", before["source"])
                self.daemon.replace("kill")
                after = player.run({"live_tick": {"timeS": 0.1}})["view"]
                self.assertEqual(("2", before["hash"]), (str(after["reply"]), after["hash"]))
                self.assertEqual(1, player.run({"live_close": {}})["live_closed"]["resyncs"])
                for path, (code, _) in self.refused.items():
                    self.live_open(player, path)
                    self.assertEqual({"error": code}, player.run({"live_tick": {"timeS": 0.0}}), path)
                    player.run({"live_close": {}})

    def live_open(self, player, path):
        player.run({"live_open": OPENING, "address": self.daemon.address, "wait_s": 5.0, "scene_file": path})


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
