#!/usr/bin/env python3
"""limits_test.py SIGHTLINED PYTHON_FOLDER: each limit of the daemon is run into, and its counter says so."""
import pathlib
import sys
import threading
import time
import unittest

SIGHTLINED = sys.argv[1]
sys.path[:0] = [sys.argv[2], str(pathlib.Path(__file__).parents[1] / "attack")]

import grpc  # noqa: E402
from daemon import CONTROL, HEALTH, Daemon, FlowingConnection, message  # noqa: E402
from exposition import scrape  # noqa: E402
from observed_daemon import camera, control, opening, rpc, start, until  # noqa: E402
from scenes import TRIANGLE, container, empty_parts, many_instances, repeated_triangles, triangle  # noqa: E402
from sessions import open_session, stub, upload  # noqa: E402
from sightline.v1 import camera_control_pb2  # noqa: E402

Daemon.path = SIGHTLINED


class Limits(unittest.TestCase):
    """Each refusal raises the counter of its flag, and no other."""

    def refused_by(self, flags, provoke):
        with start(*flags) as daemon:
            provoke(daemon)
            families = scrape(daemon.operators)
        return {dict(labels)["limit"]: number for (_, labels), number in families["sightline_limit_hits_total"].samples.items() if number}

    def hits(self, daemon):
        return any(scrape(daemon.operators)["sightline_limit_hits_total"].samples.values())

    def open_twice(self, daemon):
        with camera(daemon):
            with self.assertRaises(Exception):
                camera(daemon).__enter__()

    def control(self, daemon, *messages):
        with grpc.insecure_channel(daemon.address) as channel:
            with self.assertRaises(grpc.RpcError) as refused:
                list(control(channel, iter(messages)))
        self.assertEqual(refused.exception.code(), grpc.StatusCode.RESOURCE_EXHAUSTED, refused.exception)

    def upload(self, daemon, chunks):
        with grpc.insecure_channel(daemon.address) as channel:
            send = rpc(channel, "UploadScene", camera_control_pb2.UploadSceneResponse, "stream_unary")
            with self.assertRaises(grpc.RpcError):
                send(camera_control_pb2.UploadSceneRequest(chunk=chunk) for chunk in chunks)

    def test_sessions(self):
        self.assertEqual(set(self.refused_by(["--max-sessions", "1", "--max-sessions-per-client", "1"], self.open_twice)), {"max-sessions"})

    def test_sessions_of_a_client(self):
        self.assertEqual(set(self.refused_by(["--max-sessions", "4", "--max-sessions-per-client", "1"], self.open_twice)),
                         {"max-sessions-per-client"})

    def test_memory_of_a_session(self):
        hits = self.refused_by(["--session-memory-mib", "1"], lambda daemon: self.control(daemon, opening(4000)))
        self.assertEqual(hits, {"session-memory-mib": 1})

    def test_memory_of_all_sessions(self):
        hits = self.refused_by(["--sessions-memory-mib", "1"], lambda daemon: self.control(daemon, opening(4000)))
        self.assertEqual(hits, {"sessions-memory-mib": 1})

    def test_memory_of_a_client(self):
        hits = self.refused_by(["--client-memory-mib", "1"], lambda daemon: self.control(daemon, opening(4000)))
        self.assertEqual(hits, {"client-memory-mib": 1})

    def test_cost_of_a_step(self):
        hits = self.refused_by(["--max-step-cost-ms", "0.01"], lambda daemon: self.control(daemon, opening()))
        self.assertEqual(hits, {"max-step-cost-ms": 1})

    def test_memory_of_a_message(self):
        hits = self.refused_by(["--max-message-memory-mib", "8"], lambda daemon: self.control(daemon, opening(70_000)))
        self.assertEqual(hits, {"max-message-memory-mib": 1})

    def test_size_of_a_message(self):
        message = opening()
        message.open.label = "x" * (5 << 19)  # 2.5 MiB

        def send(daemon):
            with grpc.insecure_channel(daemon.address) as channel, self.assertRaises(grpc.RpcError) as refused:
                next(control(channel, iter([message])))
            self.assertEqual(refused.exception.code(), grpc.StatusCode.RESOURCE_EXHAUSTED)
            self.assertIn("(--max-message-mib)", refused.exception.details())
        self.assertEqual(self.refused_by(["--max-message-mib", "2"], send), {"max-message-mib": 1})

    def test_memory_of_the_messages_of_all_clients(self):
        """A session takes no replies, so its ticks wait; half of the memory is for one client."""
        def send(daemon):
            tick = empty_parts(20_000)
            attacker = FlowingConnection(daemon.address, window=0)
            streams = [attacker.start_call(CONTROL) for _ in range(16)]
            attacker.send_all({stream: message(opening().SerializeToString()) for stream in streams}, 10)
            attacker.send_all({stream: message(tick) for stream in streams}, 20)
            until(lambda: self.hits(daemon), "a hit")
            attacker.close()
        hits = self.refused_by(["--messages-memory-mib", "16", "--max-message-memory-mib", "8"], send)
        self.assertEqual(set(hits), {"messages-memory-mib"})

    def test_time_of_the_maps_of_a_step(self):
        from google.protobuf import json_format
        from sightline.tuning.v1alpha1.tuning_pb2 import Tuning
        largest = json_format.ParseDict({"sample": {"points": 16, "resolution": 64}}, Tuning())

        def send(daemon):
            with open_session(daemon.address, targets=32) as session:
                session.sends(tuning=largest)
                self.assertIn("--max-maps-ms", session.reads().tick_error.message)
        self.assertEqual(self.refused_by(["--max-maps-ms", "2", "--max-step-cost-ms", "0"], send), {"max-maps-ms": 1})

    def test_processor_time_of_reading_a_file(self):
        def send(daemon):
            with self.assertRaises(grpc.RpcError) as refused:
                upload(daemon.address, ('{"asset":{"version":"2.0"},"extras":[' + "{}," * 100_000 + "{}]}").encode())
            self.assertIn("--max-load-s", refused.exception.details())
        self.assertEqual(self.refused_by(["--max-load-s", "0.001"], send), {"max-load-s": 1})

    def test_a_session_that_is_idle(self):
        def wait(daemon):
            with open_session(daemon.address) as session:
                self.assertEqual(session.status().code(), grpc.StatusCode.DEADLINE_EXCEEDED)
        self.assertEqual(self.refused_by(["--session-idle-s", "0.4"], wait), {"session-idle-s": 1})

    def test_number_of_uploads(self):
        """Half of the places are for one client."""
        def upload_twice(daemon):
            stopping = threading.Event()

            def slowly():
                yield camera_control_pb2.UploadSceneRequest(chunk=b"x")
                stopping.wait(60)
            with stub(daemon.address) as service:
                first = service.UploadScene.future(slowly())
                time.sleep(0.5)
                with self.assertRaises(grpc.RpcError) as refused:
                    service.UploadScene(iter([camera_control_pb2.UploadSceneRequest(chunk=b"x")]))
                self.assertIn("--max-uploads", refused.exception.details())
                first.cancel()
                stopping.set()
        self.assertEqual(self.refused_by(["--max-uploads", "2"], upload_twice), {"max-uploads": 1})

    def test_an_upload_that_pauses(self):
        def pause(daemon):
            stopping = threading.Event()

            def slowly():
                yield camera_control_pb2.UploadSceneRequest(chunk=b"x")
                stopping.wait(60)
            with stub(daemon.address) as service, self.assertRaises(grpc.RpcError):
                service.UploadScene(slowly())
            stopping.set()
        self.assertEqual(self.refused_by(["--upload-timeout-s", "0.2"], pause), {"upload-timeout-s": 1})

    def test_memory_of_the_geometry(self):
        def load(daemon):
            for start in range(20):
                upload(daemon.address, repeated_triangles(30_000, 1, start))

        def send(daemon):
            with self.assertRaises(grpc.RpcError) as refused:
                load(daemon)
            self.assertIn("--geometry-memory-mib", refused.exception.details())
        hits = self.refused_by(["--geometry-memory-mib", "8", "--client-scenes-memory-mib", "100", "--kept-uploads-mib", "100"], send)
        self.assertEqual(hits, {"geometry-memory-mib": 1})

    def test_uploads_that_make_way_before_they_are_opened(self):
        def send(daemon):
            for start in range(4):
                upload(daemon.address, repeated_triangles(30_000, 1, start))
        for limit, other in (("kept-uploads-mib", "client-scenes-memory-mib"), ("client-scenes-memory-mib", "kept-uploads-mib")):
            self.assertEqual(set(self.refused_by([f"--{limit}", "2", f"--{other}", "100"], send)), {limit})
        self.assertEqual(self.refused_by(["--kept-uploads-mib", "100"], send), {})

    def test_reflection_calls(self):
        def hold(daemon):
            stopping = threading.Event()

            def silent():
                yield b"\x3a\x01*"
                stopping.wait(60)
            with grpc.insecure_channel(daemon.address) as channel:
                method = "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo"
                first = channel.stream_stream(method)(silent())
                next(first)
                with self.assertRaises(grpc.RpcError) as refused:
                    next(channel.stream_stream(method)(silent()))
                self.assertIn("--max-reflection-calls", refused.exception.details())
                stopping.set()
                first.cancel()
        self.assertEqual(self.refused_by(["--max-reflection-calls", "1"], hold), {"max-reflection-calls": 1})

    def test_watches_of_the_health_service(self):
        """Three quarters of them are for one client."""
        def hold(daemon):
            with grpc.insecure_channel(daemon.address) as channel:
                calls = [channel.unary_stream(HEALTH + "Watch")(b"") for _ in range(3)]
                for call in calls:
                    next(call)
                with self.assertRaises(grpc.RpcError) as refused:
                    next(channel.unary_stream(HEALTH + "Watch")(b""))
                self.assertIn("--max-health-watches", refused.exception.details())
                for call in calls:
                    call.cancel()
        self.assertEqual(self.refused_by(["--max-health-watches", "4"], hold), {"max-health-watches": 1})

    def test_size_of_an_upload(self):
        hits = self.refused_by(["--max-upload-mib", "1"], lambda daemon: self.upload(daemon, [bytes(1 << 19)] * 3))
        self.assertEqual(hits, {"max-upload-mib": 1})

    def test_instances_of_an_uploaded_scene(self):
        hits = self.refused_by([], lambda daemon: self.upload(daemon, [many_instances(999_000)]))
        self.assertEqual(hits, {"session-memory-mib": 1})

    def test_scenes_of_a_client(self):
        scene = repeated_triangles(60_000, 1)
        chunks = [scene[first:first + (1 << 19)] for first in range(0, len(scene), 1 << 19)]
        hits = self.refused_by(["--client-scenes-memory-mib", "1"], lambda daemon: self.upload(daemon, chunks))
        self.assertEqual(hits, {"client-scenes-memory-mib": 1})

    def test_a_refusal_that_quotes_the_name_of_a_limit_is_no_hit(self):
        scene = triangle("quoting")
        scene["extensionsRequired"] = scene["extensionsUsed"] = ["EXT (--max-uploads)"]

        def upload(daemon):
            with grpc.insecure_channel(daemon.address) as channel:
                send = rpc(channel, "UploadScene", camera_control_pb2.UploadSceneResponse, "stream_unary")
                with self.assertRaises(grpc.RpcError) as refused:
                    send(iter([camera_control_pb2.UploadSceneRequest(chunk=container(scene, TRIANGLE))]))
            self.assertIn("(--max-uploads)", refused.exception.details())
        self.assertEqual(self.refused_by([], upload), {})

    def test_a_call_that_is_never_opened(self):
        def wait(daemon):
            with grpc.insecure_channel(daemon.address) as channel:
                call = control(channel, iter(lambda: time.sleep(30), None))
                with self.assertRaises(grpc.RpcError):
                    next(call)
        self.assertEqual(self.refused_by(["--open-timeout-s", "0.2"], wait), {"open-timeout-s": 1})

    def test_connections_of_a_client(self):
        import socket

        def connect(daemon):
            with camera(daemon) as one:
                one.tick(0.1, {})
                host, port = daemon.address.split(":")
                with socket.create_connection((host, int(port)), timeout=10) as second:
                    self.assertEqual(second.recv(1), b"")  # it is refused at once
        self.assertEqual(set(self.refused_by(["--max-connections-per-client", "1"], connect)), {"max-connections-per-client"})

    def test_connections(self):
        import socket

        def connect(daemon):
            with camera(daemon) as one:
                one.tick(0.1, {})
                host, port = daemon.address.split(":")
                with socket.create_connection((host, int(port)), timeout=10) as second:
                    self.assertEqual(second.recv(1), b"")  # it is refused at once
        self.assertEqual(set(self.refused_by(["--max-connections", "1", "--max-connections-per-client", "2"], connect)), {"max-connections"})

    def test_every_limit_that_can_be_hit_has_a_test_here(self):
        with start() as daemon:
            limits = {dict(labels)["limit"] for _, labels in scrape(daemon.operators)["sightline_limit_hits_total"].samples}
        page = pathlib.Path(__file__).read_text()
        self.assertEqual({limit for limit in limits if f'"{limit}"' not in page}, set())


if __name__ == "__main__":
    sys.argv[1:] = sys.argv[3:]
    unittest.main(verbosity=2)
