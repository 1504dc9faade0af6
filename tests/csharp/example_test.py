"""The C# example against a daemon: example_test.py SIGHTLINED MONO EXAMPLE."""
import pathlib
import re
import subprocess
import sys
import unittest

SIGHTLINED, MONO, EXAMPLE = sys.argv[1:4]
sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "conformance"))

from daemon import Daemon  # noqa: E402


class Example(unittest.TestCase):
    def test_the_camera_moves(self):
        with Daemon(SIGHTLINED) as daemon:
            done = subprocess.run([MONO, EXAMPLE, f"http://{daemon.address}"], capture_output=True, text=True, timeout=120)
        self.assertEqual(done.returncode, 0, done.stderr)
        places = re.findall(r"camera \(([^)]*)\)", done.stdout)
        self.assertEqual(len(places), 300)
        self.assertGreater(len(set(places)), 30)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
