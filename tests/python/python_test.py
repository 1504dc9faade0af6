"""The Python client against a daemon: python_test.py SIGHTLINED CLIENT_FOLDER STUBS. CLIENT_FOLDER: client/python of the sources."""
import contextlib
import io
import pathlib
import runpy
import subprocess
import sys
import tempfile
import time
import unittest

SIGHTLINED, CLIENT, STUBS = sys.argv[1:4]
sys.path.insert(0, STUBS)

import grpc  # noqa: E402
import sightline_client  # noqa: E402
from sightline.v1 import settings_pb2  # noqa: E402

HERO, PILLAR = 1, 3
SCENE = dict(position=(0, 1.6, 6), targets={HERO: sightline_client.capsule(radius=0.3, height=1.8)},
             occluders={PILLAR: sightline_client.box(1, 4, 1)}, at={HERO: (0, 0.9, 0), PILLAR: (0, 2, 2)})


def start_daemon(folder):
    ready = pathlib.Path(folder, "ready")
    daemon = subprocess.Popen([SIGHTLINED, "--listen", "127.0.0.1:0", "--ready-file", str(ready),
                               "--sampler", "embree", "--log-level", "error"])
    deadline = time.monotonic() + 60
    while not ready.exists():
        if daemon.poll() is not None or time.monotonic() > deadline:
            daemon.kill()
            raise RuntimeError("the daemon did not start")
        time.sleep(0.01)
    return daemon, ready.read_text().split()[0]


class ClientTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.daemon, cls.address = start_daemon(cls.folder.name)

    @classmethod
    def tearDownClass(cls):
        cls.daemon.terminate()
        cls.daemon.wait(timeout=20)
        cls.folder.cleanup()

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


class EndTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.daemon, self.address = start_daemon(folder.name)
        self.addCleanup(self.daemon.wait, 20)
        self.addCleanup(self.daemon.kill)

    def test_a_daemon_that_shuts_down_answers_what_was_sent_and_takes_no_more(self):
        with sightline_client.Camera(self.address, **SCENE) as camera:
            self.daemon.terminate()
            answered = []
            with self.assertRaises(sightline_client.Ended):
                while len(answered) < 600:
                    time.sleep(0.02)
                    answered.append(camera.tick(len(answered) / 60, {}).sequence)
            with self.assertRaises(sightline_client.Ended):
                camera.tick(len(answered) / 60, {})
        self.assertEqual(answered, list(range(1, len(answered) + 1)), "each tick returns its own reply")
        self.assertGreater(len(answered), 0)
        self.assertEqual(self.daemon.wait(20), 0)

    def test_a_connection_that_breaks_is_unavailable(self):
        with sightline_client.Camera(self.address, **SCENE) as camera:
            camera.tick(0, {})
            self.daemon.kill()
            with self.assertRaises(sightline_client.Failed) as raised:
                camera.tick(1 / 60, {})
        self.assertEqual(raised.exception.code, grpc.StatusCode.UNAVAILABLE)


class RequirementsTest(unittest.TestCase):
    def test_wheels_exist_for_new_versions_of_python(self):
        for version in ("3.12", "3.14"):
            with self.subTest(version=version):
                done = subprocess.run([sys.executable, "-m", "pip", "install", "--dry-run", "--ignore-installed", "--only-binary=:all:", "--python-version",
                                       version, "--target", "unused", "--disable-pip-version-check", "-r", f"{CLIENT}/requirements.txt"],
                                      capture_output=True, text=True, timeout=120)
                if "No module named pip" in done.stderr:
                    self.skipTest("needs pip")
                if "NewConnectionError" in done.stderr or "Connection to" in done.stderr:
                    self.skipTest("needs a package index")
                self.assertEqual(done.returncode, 0, done.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[4:])
