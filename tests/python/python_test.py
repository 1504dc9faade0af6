"""The Python client against a daemon: python_test.py SIGHTLINED CLIENT_FOLDER STUBS. CLIENT_FOLDER: client/python of the sources."""
import asyncio
import contextlib
import io
import math
import pathlib
import runpy
import signal
import sys
import tempfile
import threading
import unittest

SIGHTLINED, CLIENT, STUBS = sys.argv[1:4]
sys.path[:0] = [STUBS, str(pathlib.Path(__file__).parent.parent / "conformance")]

import court  # noqa: E402
import grpc  # noqa: E402
import sightline_client  # noqa: E402
from daemon import Daemon  # noqa: E402
from sightline.v1 import scene_pb2, settings_pb2  # noqa: E402
from sightline_client import Connection, Patience  # noqa: E402

COURT = pathlib.Path(court.__file__).parent / "sessions/court.glb"
HERO, PILLAR = 1, 3
SCENE = dict(position=(0, 1.6, 6), targets={HERO: sightline_client.capsule(radius=0.3, height=1.8)},
             occluders={PILLAR: sightline_client.box(1, 4, 1)}, at={HERO: (0, 0.9, 0), PILLAR: (0, 2, 2)})


def place(reply):
    p = reply.pose.position
    return p.x, p.y, p.z


class ClientTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.address = cls.enterClassContext(Daemon(SIGHTLINED)).address

    def test_the_camera_moves_until_it_sees_what_a_pillar_hides(self):
        with sightline_client.Camera(self.address, **SCENE) as camera:
            self.assertEqual(camera.opened.instance_count, 2)
            replies = [camera.tick(n / 60, {HERO: (0, 0.9, 0)}) for n in range(180)]
        self.assertEqual([r.sequence for r in replies], list(range(1, 181)))
        self.assertEqual(replies[0].targets[0].visible_share, 0)
        self.assertEqual(replies[-1].targets[0].visible_share, 1)

    def test_settings_and_limits_change_with_a_tick(self):
        limits = settings_pb2.CameraLimits(max_speed_mps=0.1)
        with sightline_client.Camera(self.address, **SCENE, settings=settings_pb2.Settings(), seed=7) as camera:
            for n in range(60):
                reply = camera.tick(n / 60, {HERO: (0, 0.9, 0)}, limits=limits)
            v = reply.velocity
        self.assertLessEqual((v.x ** 2 + v.y ** 2 + v.z ** 2) ** 0.5, 0.1001)

    def test_a_refused_tick_says_why_and_the_session_goes_on(self):
        with sightline_client.Camera(self.address, **SCENE) as camera:
            with self.assertRaisesRegex(sightline_client.Refused, "transforms.*no such instance"):
                camera.tick(0, {99: (0, 0, 0)})
            self.assertEqual(camera.tick(0.1, {HERO: (1, 0.9, 0)}).sequence, 2)

    def test_an_opening_that_fails_names_the_fields_that_are_wrong(self):
        with self.assertRaisesRegex(sightline_client.Failed, "INVALID_ARGUMENT: open.instances.*radius") as raised:
            sightline_client.Camera(self.address, **{**SCENE, "targets": {HERO: sightline_client.sphere(-1)}})
        self.assertEqual(raised.exception.code, grpc.StatusCode.INVALID_ARGUMENT)
        self.assertEqual([v.field for v in raised.exception.violations], ["open.instances[0].shape.sphere.radius"])
        self.assertIn("[1e-4, 1e5] m", raised.exception.violations[0].description)

    def test_a_scene_is_a_file_or_its_bytes_or_one_that_the_daemon_has(self):
        hash_, whole = court.HASH, COURT.read_bytes()
        for scene in (COURT, str(COURT), whole, scene_pb2.SceneRef(hash=hash_)):
            with sightline_client.Camera(self.address, **SCENE, scene=scene) as camera:
                self.assertEqual(camera.opened.instance_count, 4)
            with sightline_client.LiveCamera(self.address, **SCENE, scene=scene, patience=Patience(wait_s=5)) as camera:
                self.assertEqual(camera.tick(0, {}).source, sightline_client.Source.REPLY)
                self.assertEqual(camera.opened.instance_count, 4)

            async def opened():
                async with sightline_client.AsyncCamera(self.address, **SCENE, scene=scene) as camera:
                    return camera.opened
            self.assertEqual(asyncio.run(opened()).instance_count, 4)
        for kind in (sightline_client.Camera, sightline_client.AsyncCamera, sightline_client.LiveCamera):
            with self.assertRaises(FileNotFoundError):
                kind(self.address, **SCENE, scene="no/such.glb")

    def test_a_daemon_that_is_missing_is_unavailable(self):
        with self.assertRaises(sightline_client.Failed) as raised:
            sightline_client.Camera("127.0.0.1:1", **SCENE)
        self.assertEqual(raised.exception.code, grpc.StatusCode.UNAVAILABLE)
        self.assertEqual(raised.exception.violations, [])

    def test_a_rotation_turns_an_instance(self):
        upright = (0, 0, 0, 1)
        sideways = (0, 0.5 ** 0.5, 0, 0.5 ** 0.5)  # 90 degrees about +Y: the wall shows the camera its edge
        scene = {**SCENE, "occluders": {PILLAR: sightline_client.box(4, 4, 0.1)}}

        def share(opened, places):
            with sightline_client.Camera(self.address, **{**scene, "at": {**SCENE["at"], PILLAR: opened}}) as camera:
                return camera.tick(0, places).targets[0].visible_share

        self.assertEqual(share((0, 2, 2), {}), 0)
        self.assertEqual(share(((0, 2, 2), upright), {}), 0)
        self.assertGreater(share(((0, 2, 2), sideways), {}), 0)
        self.assertGreater(share((0, 2, 2), {PILLAR: ((0, 2, 2), sideways)}), 0)
        with self.assertRaisesRegex(sightline_client.Refused, "rotations.*must hold 8 numbers"):
            share((0, 2, 2), {PILLAR: ((0, 2, 2), sideways), HERO: (0, 0.9, 0)})

    def test_an_arm_that_sticks_out_from_behind_a_wall_counts(self):
        forearm, wall = 11, 4
        elbow, forward = (0.5, 1.4, 0), (0.5, 1.4, -0.5)

        def shares(camera, hand):
            return [camera.tick(camera_time, {HERO: ((0, 0.9, 0), (0, 0, 0, 1)), forearm: sightline_client.along(elbow, hand)}).targets[0].visible_share
                    for camera_time in [0.0] * 8]

        scene = dict(position=(0, 1.6, 6), targets={HERO: sightline_client.capsule(0.2, 1.8)}, parts={HERO: {forearm: sightline_client.capsule(0.1, 0.7)}},
                     occluders={wall: sightline_client.box(2, 4, 0.1)}, at={HERO: (0, 0.9, 0), forearm: sightline_client.along(elbow, forward), wall: (0, 2, 2)})
        with sightline_client.Camera(self.address, **scene) as camera:
            self.assertEqual(max(shares(camera, forward)), 0)
            self.assertGreater(sum(shares(camera, (3, 1.4, 0))), 0)
        with self.assertRaisesRegex(ValueError, "parts of .9., which are not targets"):
            sightline_client.opening(**{**scene, "parts": {9: {}}})

    def test_a_capsule_lies_along_its_bone(self):
        for end in ((0, 1, 0), (0, -1, 0), (1, 0, 0), (-0.3, 0.2, 0.5), (0.2, -0.9, -0.1), (1e-7, -1, 0)):
            (x, y, z), (qx, qy, qz, qw) = sightline_client.along((1, 2, 3), (1 + end[0], 2 + end[1], 3 + end[2]))
            for got, expected in zip((x, y, z), (1 + end[0] / 2, 2 + end[1] / 2, 3 + end[2] / 2)):
                self.assertAlmostEqual(got, expected)
            self.assertAlmostEqual(math.hypot(qx, qy, qz, qw), 1)
            up = (2 * (qx * qy - qz * qw), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz + qx * qw))  # where the rotation takes +Y
            for got, expected in zip(up, end):
                self.assertAlmostEqual(got, expected / math.hypot(*end), places=6)

    def test_an_error_of_the_program_is_not_hidden(self):
        with self.assertRaises(ZeroDivisionError):
            with sightline_client.Camera(self.address, **SCENE):
                1 / 0

    def test_the_example_is_seventeen_lines_and_shows_both_targets_most_of_the_time(self):
        text = pathlib.Path(CLIENT, "example.py").read_text()
        self.assertLessEqual(len(text.splitlines()), 17)
        with tempfile.NamedTemporaryFile("w", suffix=".py") as file, contextlib.redirect_stdout(io.StringIO()) as printed:
            file.write(text.replace("127.0.0.1:50151", self.address))
            file.flush()
            runpy.run_path(file.name)
        lines = printed.getvalue().splitlines()
        self.assertEqual(len(lines), 300)
        self.assertFalse(lines[0].endswith("100% 100%"), "the pillar hides someone at first")
        self.assertGreater(sum(line.endswith("100% 100%") for line in lines), 150)


def play(camera, first, n):
    return [camera.tick(frame / 60, {HERO: (math.sin(frame / 60), 0.9, 0)}) for frame in range(first, first + n)]


async def play_async(camera, first, n):
    return [await camera.tick(frame / 60, {HERO: (math.sin(frame / 60), 0.9, 0)}) for frame in range(first, first + n)]


class LostDaemonTest(unittest.TestCase):
    """What happens when a daemon goes away. tests/conformance checks what the next one is told."""

    def setUp(self):
        self.daemon = self.enterContext(Daemon(SIGHTLINED))

    def test_the_session_goes_on_in_the_daemon_at_the_next_address(self):
        reasons = []
        with Daemon(SIGHTLINED) as second:
            addresses = [self.daemon.address, second.address]
            with sightline_client.Camera(addresses, **SCENE, connection=Connection(on_resync=reasons.append)) as camera:
                before = play(camera, 0, 30)[-1]
                self.daemon.stop("drain")
                after = play(camera, 30, 30)
        self.assertEqual([reply.sequence for reply in after], list(range(31, 61)))
        self.assertLess(math.dist(place(before), place(after[0])), 0.2, "the camera does not jump")
        self.assertEqual((camera.resyncs, reasons), (1, ["the server is stopping"]))

    def test_a_session_waits_for_a_daemon_that_is_started_again(self):
        with sightline_client.Camera(self.daemon.address, **SCENE) as camera:
            play(camera, 0, 10)
            self.daemon.stop("kill")
            starting = threading.Timer(0.5, self.daemon.start)
            starting.start()
            self.assertEqual(play(camera, 10, 10)[-1].sequence, 20)
            starting.join()
        self.assertEqual(camera.resyncs, 1)

    def test_a_daemon_that_hangs_is_left(self):
        with Daemon(SIGHTLINED) as second:
            options = Connection(reply_timeout_s=2, open_timeout_s=10)
            camera = sightline_client.Camera([self.daemon.address, second.address], **SCENE, connection=options)
            play(camera, 0, 10)
            self.daemon.process.send_signal(signal.SIGSTOP)
            self.assertEqual(play(camera, 10, 10)[-1].sequence, 20)
            self.daemon.process.send_signal(signal.SIGCONT)
            camera.close()

    def test_a_camera_gives_up_in_time(self):
        with sightline_client.Camera(self.daemon.address, **SCENE, connection=Connection(give_up_after_s=0.0)) as camera:
            camera.tick(0, {})
            self.daemon.stop("kill")
            with self.assertRaises(sightline_client.Failed) as raised:
                camera.tick(1 / 60, {})
        self.assertEqual(raised.exception.code, grpc.StatusCode.UNAVAILABLE)

    def test_many_tasks_survive_a_daemon(self):
        async def main():
            async def one():
                async with sightline_client.AsyncCamera(self.daemon.address, **SCENE) as camera:
                    await play_async(camera, 0, 20)
                    await self.replaced.wait()
                    replies = await play_async(camera, 20, 20)
                    return camera.resyncs, replies[-1].sequence

            self.replaced = asyncio.Event()
            tasks = [asyncio.create_task(one()) for _ in range(5)]
            await asyncio.sleep(1)
            await asyncio.to_thread(self.daemon.replace, "kill")
            self.replaced.set()
            return await asyncio.gather(*tasks)

        self.assertEqual(asyncio.run(main()), [(1, 40)] * 5)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:])
