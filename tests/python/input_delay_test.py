"""The example input_delay.py against a daemon: input_delay_test.py SIGHTLINED CLIENT_FOLDER STUBS README. README shows what it prints."""
import os
import pathlib
import re
import subprocess
import sys
import unittest

SIGHTLINED, CLIENT, STUBS, README = sys.argv[1:5]
sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "conformance"))

from daemon import Daemon  # noqa: E402

ROW = re.compile(r"^(\w+ ?\w+)\s+([\d.]+) %\s+([\d.]+) %\s+([\d.]+) m/s$", re.M)


def tables(text):
    """By heading and way: mean and 95th percentile of the error in percent of the picture's height, and the camera's greatest speed."""
    parts = re.split(r"^(Running|Turning on the spot):.*$", text, flags=re.M)
    return {title: {way: tuple(map(float, values)) for way, *values in ROW.findall(rows)} for title, rows in zip(parts[1::2], parts[2::2])}


class InputDelay(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with Daemon(SIGHTLINED) as daemon:
            done = subprocess.run([sys.executable, pathlib.Path(CLIENT, "input_delay.py"), daemon.address], env=dict(os.environ, PYTHONPATH=STUBS),
                                  capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stderr
        cls.printed = done.stdout
        cls.figures = tables(done.stdout)

    def test_the_relative_pose_saves_most_of_the_error_of_running_targets(self):
        running = self.figures["Running"]
        for way in ("relative pose", "unrotated pose"):
            self.assertLess(running[way][0], running["pose"][0] / 4, self.printed)

    def test_without_the_rotation_a_target_that_turns_does_not_swing_the_camera(self):
        turning = self.figures["Turning on the spot"]
        self.assertLess(turning["unrotated pose"][1], 0.1, "targets that stand are where they were")
        self.assertGreater(turning["relative pose"][1], 1.0, self.printed)
        self.assertGreater(turning["relative pose"][2], 1.5 * turning["unrotated pose"][2], self.printed)

    def test_the_page_shows_what_the_program_prints(self):
        shown = tables(pathlib.Path(README).read_text())
        self.assertEqual(list(shown), list(self.figures))
        for title, rows in self.figures.items():
            self.assertEqual(list(shown[title]), list(rows))
            for way, values in rows.items():
                for value, on_page in zip(values, shown[title][way]):  # the last bits of a step depend on the processor
                    self.assertAlmostEqual(value, on_page, delta=max(0.2, 0.1 * value), msg=f"{title}, {way}\n{self.printed}")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
