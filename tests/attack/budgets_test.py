"""One client that takes more than its share: budgets_test.py SIGHTLINED STUBS."""
import sys
import tempfile
import threading
import time
import unittest

import daemon as attack

attack.Daemon.path, STUBS = sys.argv[1:3]
attack.in_containers()
sys.path.insert(0, STUBS)

import grpc  # noqa: E402

from daemon import CONTROL, DATA, END_STREAM, HEALTH, SERVICE, Daemon, FlowingConnection, Healthy, RawConnection, frame, message  # noqa: E402
from scenes import crowd_tuning, empty_parts, glb, largest_tuning, many_instances, repeated_triangles, scene_of, stacked_plates, varint  # noqa: E402
from sessions import Crowd, info, open_request, open_session, stub, upload  # noqa: E402
from sightline.v1 import camera_control_pb2  # noqa: E402

EXHAUSTED = grpc.StatusCode.RESOURCE_EXHAUSTED


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

    def test_many_sessions_of_one_client_take_no_time_from_another(self):
        with tempfile.TemporaryDirectory() as folder, Daemon("--listen-unix", folder + "/socket") as daemon:
            tcp, unix = daemon.ready.read_text().split()
            with Crowd(tcp, 256, targets=8, tuning=crowd_tuning()) as crowd:
                self.assertGreater(len(crowd.sessions), 30, crowd.told)
                self.assertRegex(crowd.told, "--client-memory-mib|--max-sessions-per-client")
                with open_session(unix, targets=8, tuning=crowd_tuning()) as other:
                    other.tick()
                    before = crowd.answers
                    for _ in range(20):
                        other.tick()
                    # Two clients share the threads equally. If all sessions did, a step of each of the crowd would pass in each of these 20.
                    self.assertLess(crowd.answers - before, 20 * 10)
                healthy = Healthy(unix, 4).result()
            self.assertEqual((healthy["answered"], healthy["error"]), (healthy["ticks"], ""))
            self.assertGreater(healthy["replies"], 0.6 * healthy["ticks"], "the others were merged, because they waited for so long")
            self.assertGreater(crowd.answers, before)

    def test_long_steps_of_one_client_leave_a_thread_to_another(self):
        with tempfile.TemporaryDirectory() as folder, Daemon("--listen-unix", folder + "/socket", "--threads", "2", "--max-message-memory-mib", "32") as daemon:
            tcp, unix = daemon.ready.read_text().split()
            with Crowd(tcp, 6, targets=16, instances=stacked_plates(15_000)) as crowd, open_session(unix) as other:
                self.assertEqual(len(crowd.sessions), 6, crowd.told)

                def ticks_beside(steps):
                    """Ticks of the other client that are answered while so many steps of the crowd are taken."""
                    ticks, until = 0, crowd.answers + steps
                    while crowd.answers < until:
                        other.tick()
                        ticks += 1
                    return ticks
                ticks_beside(18)  # the first steps take longest
                ticks = ticks_beside(60)
            # If each tick had to wait for one of two threads, about as many ticks as long steps would be answered.
            self.assertGreater(ticks, 3 * 60)

    def test_sessions_of_very_many_targets_are_bounded_by_their_memory(self):
        with Daemon("--max-maps-ms", "0") as daemon:
            with Crowd(daemon.address, 256, targets=32) as crowd:
                time.sleep(3)
                self.assertIn("--client-memory-mib", crowd.told)
                self.assertGreater(crowd.answers, 0)
                self.assertLess(daemon.most_memory_mib(), 300)
            time.sleep(0.5)
            open_session(daemon.address, targets=32).close()

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


class Steps(unittest.TestCase):
    def test_a_step_that_costs_too_much_is_refused(self):
        largest = largest_tuning()
        with Daemon() as daemon:
            with self.assertRaises(grpc.RpcError) as raised:
                open_session(daemon.address, targets=32, tuning=largest)
            self.assertEqual(raised.exception.code(), EXHAUSTED)
            self.assertIn("--max-step-cost-ms", raised.exception.details())
            with open_session(daemon.address, targets=32) as session:
                self.assertEqual(session.tick().sequence, 1)
                session.sends(tuning=largest)
                self.assertIn("--max-step-cost-ms", session.reads().tick_error.message)
                self.assertEqual(session.tick().sequence, 3)

    def test_maps_that_take_too_long_are_given_up(self):
        from google.protobuf import json_format
        from sightline.tuning.v1alpha1.tuning_pb2 import Tuning
        largest = json_format.ParseDict({"sample": {"points": 16, "resolution": 64}}, Tuning())
        with Daemon("--max-step-cost-ms", "0", "--max-maps-ms", "2") as daemon, open_session(daemon.address, targets=32) as session:
            session.sends(tuning=largest)
            self.assertIn("--max-maps-ms", session.reads().tick_error.message)


class Scenes(unittest.TestCase):
    def test_a_small_file_of_very_many_instances_is_refused(self):
        scene = many_instances(999_000)
        self.assertLess(len(scene), 2000)
        with Daemon() as daemon:
            with self.assertRaises(grpc.RpcError) as raised:
                upload(daemon.address, scene)
            self.assertEqual(raised.exception.code(), EXHAUSTED)
            self.assertIn("too many instances in one file (--session-memory-mib)", raised.exception.details())
            self.assertLess(daemon.most_memory_mib(), 200)

    def test_sessions_share_the_memory_for_instances(self):
        scene = many_instances(100_000)
        with Daemon("--sessions-memory-mib", "64") as daemon:
            hash_of_scene = upload(daemon.address, scene).hash
            with open_session(daemon.address, scene=scene_of(hash_of_scene)) as first:
                with self.assertRaises(grpc.RpcError) as raised:
                    open_session(daemon.address, scene=scene_of(hash_of_scene))
                self.assertEqual(raised.exception.code(), EXHAUSTED)
                self.assertIn("--sessions-memory-mib", raised.exception.details())
                self.assertEqual(first.tick().sequence, 1)
            open_session(daemon.address, scene=scene_of(hash_of_scene)).close()

    def test_one_client_cannot_have_all_the_memory_for_instances(self):
        with tempfile.TemporaryDirectory() as folder:
            socket = folder + "/socket"
            # A user on the unix socket and the loopback address are two clients. Each session takes 38 MiB of 100.
            with Daemon("--sessions-memory-mib", "100", "--listen-unix", socket) as daemon:
                scene = many_instances(100_000)
                mine, other = upload(daemon.address, scene).hash, upload("unix:" + socket, scene).hash
                with open_session(daemon.address, scene=scene_of(mine)):
                    with self.assertRaises(grpc.RpcError) as raised:
                        open_session(daemon.address, scene=scene_of(mine))
                    self.assertEqual(raised.exception.code(), EXHAUSTED)
                    self.assertIn("--client-memory-mib", raised.exception.details())
                    with open_session("unix:" + socket, scene=scene_of(other)) as beside:
                        self.assertEqual(beside.tick().sequence, 1)
                # Memory that was given back can be used again.
                open_session(daemon.address, scene=scene_of(mine)).close()

    def test_distinct_shapes_count_as_memory_while_they_are_there(self):
        from sightline.v1.scene_pb2 import NewInstance, SceneDelta, Shape

        def balls(first, count):
            return [NewInstance(id=1000 + n, shape=Shape(sphere=Shape.Sphere(radius=1 + n / 1e5))) for n in range(first, first + count)]

        with Daemon("--session-memory-mib", "8", "--max-maps-ms", "0") as daemon, open_session(daemon.address) as session:
            session.sends(delta=SceneDelta(added_instances=balls(0, 20_000)))  # 2 GB with what the sampler takes
            refused = session.reads().tick_error
            self.assertEqual(refused.field_violations[0].field, "tick.delta.added_instances")
            self.assertIn("--session-memory-mib", refused.message)
            self.assertLess(daemon.most_memory_mib(), 200)
            # Equal shapes take their memory once, and what was removed takes none.
            equal = [NewInstance(id=1000 + n, shape=Shape(sphere=Shape.Sphere(radius=1))) for n in range(1000)]
            self.assertEqual(session.tick(delta=SceneDelta(added_instances=equal)).sequence, 2)
            self.assertEqual(session.tick(delta=SceneDelta(removed_ids=[instance.id for instance in equal])).sequence, 3)
            for n in range(4):
                added = balls(50 * n, 50)  # two such lots do not fit
                self.assertEqual(session.tick(delta=SceneDelta(added_instances=added)).sequence, 4 + 2 * n)
                self.assertEqual(session.tick(delta=SceneDelta(removed_ids=[ball.id for ball in added])).sequence, 5 + 2 * n)


    def test_a_small_file_that_repeats_its_triangles_is_refused(self):
        scene = repeated_triangles(3000, 60)
        self.assertLess(len(scene), 200_000)
        with Daemon() as daemon:
            with self.assertRaises(grpc.RpcError) as raised:
                upload(daemon.address, scene)
            self.assertEqual(raised.exception.code(), EXHAUSTED)
            self.assertIn("--geometry-memory-mib", raised.exception.details())
            self.assertLess(daemon.most_memory_mib(), 350)

    def test_the_geometry_of_all_scenes_together_is_bounded(self):
        with Daemon("--geometry-memory-mib", "8", "--client-scenes-memory-mib", "100", "--kept-uploads-mib", "100") as daemon:
            hashes = [upload(daemon.address, repeated_triangles(30_000, 1, start)).hash for start in range(2)]
            with self.assertRaises(grpc.RpcError) as raised:
                for start in range(2, 20):
                    upload(daemon.address, repeated_triangles(30_000, 1, start))
            self.assertEqual(raised.exception.code(), EXHAUSTED)
            self.assertIn("--geometry-memory-mib", raised.exception.details())
            open_session(daemon.address, scene=scene_of(hashes[0])).close()


class Heavy(unittest.TestCase):
    def test_messages_that_wait_take_a_bounded_memory(self):
        tick = message(empty_parts(200_000))
        opening = message(camera_control_pb2.ControlRequest(open=open_request()).SerializeToString())
        with Daemon() as daemon:
            healthy = Healthy(daemon.address, 12)
            attacker = FlowingConnection(daemon.address, window=0)  # what it opens waits to be read, so its ticks wait too
            streams = [attacker.start_call(CONTROL) for _ in range(48)]
            attacker.send_all({stream: opening for stream in streams}, 5)
            time.sleep(1)
            attacker.send_all({stream: tick for stream in streams}, 8)
            result = healthy.result()
            self.assertEqual((result["answered"], result["error"]), (result["ticks"], ""))
            self.assertLess(daemon.most_memory_mib(), 300)
            attacker.close()

    def test_messages_that_never_end_take_a_bounded_memory(self):
        size = (4 << 20) - 8
        unfinished = message(bytes(size))[:-1]
        with Daemon() as daemon:
            healthy = Healthy(daemon.address, 10)
            attackers = [FlowingConnection(daemon.address) for _ in range(4)]
            sending = [threading.Thread(target=lambda of=of: of.send_all(
                {of.start_call(SERVICE + "GetServerInfo"): unfinished for _ in range(24)}, 8)) for of in attackers]
            for thread in sending:
                thread.start()
            for thread in sending:
                thread.join()
            # One client has half of 128 MiB, and the connections that hold most are cut.
            self.assertLess(daemon.most_memory_mib(), 180)
            for attacker in attackers:
                attacker.close()
            result = healthy.result()
            self.assertEqual((result["answered"], result["error"]), (result["ticks"], ""))
            time.sleep(1)
            self.assertTrue(info(daemon.address).version)

    def test_a_message_of_empty_parts_is_refused_before_it_is_parsed(self):
        message = empty_parts(1_900_000)
        with Daemon() as daemon:
            healthy = Healthy(daemon.address, 4)
            for _ in range(4):
                with grpc.insecure_channel(daemon.address, options=[("grpc.max_send_message_length", -1)]) as channel:
                    call = channel.stream_stream(CONTROL)(iter([message]), timeout=20)
                    with self.assertRaises(grpc.RpcError) as raised:
                        next(call)
                self.assertEqual(raised.exception.code(), EXHAUSTED)
                self.assertIn("--max-message-memory-mib", raised.exception.details())
            result = healthy.result()
            self.assertEqual((result["answered"], result["error"]), (result["ticks"], ""))
            self.assertLess(daemon.most_memory_mib(), 120)

    def test_silent_reflection_calls_hold_no_threads(self):
        methods = [f"/grpc.reflection.{version}.ServerReflection/ServerReflectionInfo" for version in ("v1", "v1alpha")]
        with Daemon() as daemon, grpc.insecure_channel(daemon.address) as channel:
            stopping = threading.Event()

            def silent():
                yield b"\x3a\x01*"
                stopping.wait(20)
            held = [channel.stream_stream(method)(silent()) for method in methods * 32]
            time.sleep(1)
            refused = [call for call in held if not call.is_active()]
            self.assertEqual(len(refused), 64 - 16, "both versions share the sixteen calls")
            self.assertEqual({call.code() for call in refused}, {EXHAUSTED})
            self.assertTrue(info(daemon.address).version)
            self.assertTrue(upload(daemon.address, glb("x")).hash)
            stopping.set()
            for call in held:
                call.cancel()


class Health(unittest.TestCase):
    def watch(self, channel, name, timeout=60):
        return channel.unary_stream(HEALTH + "Watch")(b"\x0a" + varint(len(name)) + name, timeout=timeout)

    def test_long_names_of_services_are_not_kept(self):
        name = bytes(4_000_000).replace(b"\0", b"x")
        with Daemon() as daemon, grpc.insecure_channel(daemon.address) as channel:
            calls = [self.watch(channel, name) for _ in range(64)]
            time.sleep(3)
            self.assertLess(daemon.memory_mib(), 150)
            with self.assertRaises(grpc.RpcError) as raised:
                next(calls[0])
            self.assertEqual(raised.exception.code(), grpc.StatusCode.INVALID_ARGUMENT)

    def test_one_client_cannot_have_all_watches(self):
        path = "/tmp/sightline-attack-%d" % id(self)
        with Daemon("--listen-unix", path) as daemon:
            tcp, unix = daemon.ready.read_text().split()
            attacker = RawConnection(tcp)
            for _ in range(1000):
                stream, call = attacker.call(HEALTH + "Watch")
                attacker.send(call + frame(DATA, END_STREAM, stream, b"\0" * 5))
                time.sleep(0.001)
            time.sleep(1)
            with grpc.insecure_channel(tcp) as channel, self.assertRaises(grpc.RpcError) as raised:
                next(self.watch(channel, b""))
            self.assertEqual(raised.exception.code(), EXHAUSTED)
            with grpc.insecure_channel(unix) as channel:
                self.assertEqual(next(self.watch(channel, b"")), b"\x08\x01")
            attacker.close()


class Uploads(unittest.TestCase):
    def test_one_client_cannot_hold_all_places_by_sending_slowly(self):
        path = "/tmp/sightline-attack-%d" % id(self)
        with Daemon("--listen-unix", path) as daemon:
            tcp, unix = daemon.ready.read_text().split()
            stopping = threading.Event()

            def slowly():
                while not stopping.wait(0.25):
                    yield camera_control_pb2.UploadSceneRequest(chunk=bytes(5 << 10))
            with stub(tcp) as service:
                slow = [service.UploadScene.future(slowly()) for _ in range(6)]
                time.sleep(3)
                self.assertTrue(upload(unix, glb("quick")).hash)
                stopping.set()
                self.assertEqual(sum(call.code() == EXHAUSTED for call in slow), 2)

    def test_uploads_that_drip_make_way(self):
        with Daemon() as daemon:
            stopping = threading.Event()

            def drip():
                while not stopping.wait(0.5):
                    yield camera_control_pb2.UploadSceneRequest(chunk=b"x")
            with stub(daemon.address) as service:
                slow = [service.UploadScene.future(drip()) for _ in range(8)]
                time.sleep(3)
                self.assertTrue(upload(daemon.address, glb("quick")).hash)
                stopping.set()
                self.assertIn(grpc.StatusCode.CANCELLED, [call.code() for call in slow])

    def test_small_uploads_do_not_push_out_a_scene_before_it_is_opened(self):
        with Daemon() as daemon:
            first = upload(daemon.address, glb("first")).hash
            for n in range(20):
                upload(daemon.address, glb(f"other {n}"))
            with open_session(daemon.address, scene=scene_of(first)) as session:
                self.assertEqual(session.opened.instance_count, 2)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=2, warnings="ignore")
