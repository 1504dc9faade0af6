"""Runs client/python/example.py against a daemon of its own: python_test.py SIGHTLINED EXAMPLE STUBS."""
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import unittest

SIGHTLINED, EXAMPLE, STUBS = sys.argv[1:4]
TICKS = 120


def start_daemon(folder):
    ready = pathlib.Path(folder, "ready")
    daemon = subprocess.Popen([SIGHTLINED, "--listen", "127.0.0.1:0", "--ready-file", str(ready),
                               "--sampler", "embree", "--log-level", "warning"])
    deadline = time.monotonic() + 60
    while not ready.exists():
        if daemon.poll() is not None or time.monotonic() > deadline:
            daemon.kill()
            raise RuntimeError("the daemon did not come up")
        time.sleep(0.01)
    return daemon, ready.read_text().split()[0]


def run_example(*arguments):
    environment = dict(os.environ, PYTHONPATH=STUBS)
    return subprocess.run([sys.executable, EXAMPLE, *arguments], env=environment, capture_output=True,
                          text=True, timeout=60)


class ExampleTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.daemon, cls.address = start_daemon(cls.folder.name)

    @classmethod
    def tearDownClass(cls):
        cls.daemon.terminate()
        cls.daemon.wait(timeout=20)
        cls.folder.cleanup()

    def test_prints_a_pose_for_every_tick_and_keeps_both_targets_in_view(self):
        result = run_example(self.address, str(TICKS))
        self.assertEqual(result.returncode, 0, result.stderr)
        lines = result.stdout.splitlines()
        self.assertRegex(lines[0], r"^session \S+: 3 instances, \d+ triangles$")
        poses = [re.search(r"camera \(([^)]*)\)", line).group(1) for line in lines[1:]]
        self.assertEqual(len(poses), TICKS)
        self.assertGreater(len(set(poses)), TICKS // 4, "the camera never moved")
        shares = [[float(share) for share in re.findall(r"\d: (\d\.\d+)", line)] for line in lines[1:]]
        self.assertTrue(all(len(share) == 2 for share in shares))
        clear = sum(min(share) == 1.0 for share in shares[TICKS // 2:])
        self.assertGreater(clear, TICKS // 4, "most of the second half shows both")

    def test_a_daemon_that_is_not_there_is_an_error(self):
        result = run_example("127.0.0.1:1", "1")
        self.assertNotEqual(result.returncode, 0)
        self.assertIn("UNAVAILABLE", result.stderr)

    def test_the_example_is_short(self):
        self.assertLess(len(pathlib.Path(EXAMPLE).read_text().splitlines()), 100)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
