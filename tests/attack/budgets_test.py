"""One client that takes more than its share: budgets_test.py SIGHTLINED STUBS."""
import struct
import sys
import threading
import time
import unittest

import daemon as attack

attack.Daemon.path, STUBS = sys.argv[1:3]
sys.path.insert(0, STUBS)

import grpc  # noqa: E402

from daemon import CONTROL, HEALTH, SERVICE, Daemon  # noqa: E402
from sessions import info, open_session, stub, upload  # noqa: E402
from sightline.v1 import camera_control_pb2  # noqa: E402

EXHAUSTED = grpc.StatusCode.RESOURCE_EXHAUSTED


def glb(name):
    """A scene of one triangle. Different names make different files."""
    import json
    positions = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)
    text = json.dumps({"asset": {"version": "2.0", "generator": name}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                       "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], "buffers": [{"byteLength": 36}],
                       "bufferViews": [{"buffer": 0, "byteLength": 36}],
                       "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0],
                                      "max": [1, 1, 0]}]}).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", 36, 0x004E4942) + positions
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


class Messages(unittest.TestCase):
    def test_compressed_messages_are_refused_before_they_are_unpacked(self):
        bomb = bytes(96 << 20)  # a tenth of a megabyte when it is compressed
        with Daemon() as daemon, grpc.insecure_channel(daemon.address, compression=grpc.Compression.Gzip) as channel:
            for method in (HEALTH + "Check", SERVICE + "GetServerInfo"):
                with self.subTest(method), self.assertRaises(grpc.RpcError) as raised:
                    channel.unary_unary(method)(bomb, timeout=60)
                with self.subTest(method):
                    self.assertEqual(raised.exception.code(), grpc.StatusCode.UNIMPLEMENTED)
            for method in (CONTROL, SERVICE + "UploadScene"):
                call = channel.stream_stream(method)(iter([bomb]), timeout=60)
                with self.subTest(method), self.assertRaises(grpc.RpcError) as raised:
                    next(call)
                self.assertEqual(raised.exception.code(), grpc.StatusCode.UNIMPLEMENTED)
            self.assertLess(daemon.most_memory_mib(), 90)


class Sessions(unittest.TestCase):
    def test_one_client_cannot_hold_all_sessions(self):
        path = "/tmp/sightline-attack-%d" % id(self)
        with Daemon("--max-sessions", "8", "--listen-unix", path) as daemon:
            tcp, unix = daemon.ready.read_text().split()
            held = [open_session(tcp) for _ in range(6)]
            with self.assertRaises(grpc.RpcError) as raised:
                open_session(tcp)
            self.assertEqual(raised.exception.code(), EXHAUSTED)
            self.assertIn("--max-sessions-per-client", raised.exception.details())
            with open_session(unix) as other:
                self.assertEqual(other.tick().sequence, 1)
            for session in held:
                session.close()

    def test_idle_sessions_end(self):
        with Daemon("--session-idle-s", "3") as daemon, open_session(daemon.address) as busy:
            idle = open_session(daemon.address)
            end = time.monotonic() + 6
            while time.monotonic() < end:
                busy.tick()
                time.sleep(0.02)
            status = idle.status()
            self.assertEqual(status.code(), grpc.StatusCode.DEADLINE_EXCEEDED)
            self.assertIn("--session-idle-s", status.details())
            busy.tick()


class Uploads(unittest.TestCase):
    def test_uploads_that_drip_make_way(self):
        with Daemon() as daemon:
            stopping = threading.Event()

            def drip():
                while not stopping.wait(0.5):
                    yield camera_control_pb2.UploadSceneRequest(chunk=b"x")
            with stub(daemon.address) as service:
                slow = [service.UploadScene.future(drip()) for _ in range(4)]
                time.sleep(3)
                self.assertTrue(upload(daemon.address, glb("quick")).hash)
                stopping.set()
                self.assertIn(grpc.StatusCode.CANCELLED, [call.code() for call in slow])

    def test_small_uploads_do_not_push_out_a_scene_before_it_is_opened(self):
        with Daemon() as daemon:
            first = upload(daemon.address, glb("first")).hash
            for n in range(20):
                upload(daemon.address, glb(f"other {n}"))
            from sightline.v1.session_pb2 import OpenSession
            scene = OpenSession().scene
            scene.hash = first
            with open_session(daemon.address, scene=scene) as session:
                self.assertEqual(session.opened.instance_count, 2)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=2, warnings="ignore")
