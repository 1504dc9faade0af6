"""Numbers that a client may send by mistake: numbers_test.py SIGHTLINED STUBS [CLASS.METHOD...]. Each is refused, or taken and answered with finite numbers,
by both samplers, and a session beside it never notices."""
import pathlib
import sys
import unittest

import daemon as attack

attack.Daemon.path, STUBS = sys.argv[1:3]
attack.in_containers()
sys.path[:0] = [STUBS, str(pathlib.Path(__file__).parents[1] / "metrics")]

import legal_numbers  # noqa: E402
from daemon import Daemon  # noqa: E402
from exposition import scrape, value  # noqa: E402
from sessions import open_session  # noqa: E402


class Numbers(unittest.TestCase):
    def plays_all(self, sampler):
        try:
            daemon = Daemon("--sampler", sampler, "--metrics-listen", "127.0.0.1:0")
        except RuntimeError as trouble:
            if sampler == "egl":
                self.skipTest(f"no context of OpenGL: {trouble}")
            raise
        with daemon, open_session(daemon.address) as healthy:
            for case in legal_numbers.CASES:
                with self.subTest(case.name):
                    self.assertEqual(legal_numbers.plays(daemon.address, case), "")
                    self.assertIsNone(daemon.process.poll(), "the daemon ended")
                    self.assertEqual(legal_numbers.not_finite_in(healthy.tick()), [])
            families = scrape(self.metrics_address(daemon))
            self.assertEqual(value(families, "sightline_sessions_closed_total", code="INTERNAL"), 0)

    def metrics_address(self, daemon):
        daemon.wait_for_log("metrics=")
        return daemon.log().split("metrics=")[1].split()[0]

    def test_embree(self):
        self.plays_all("embree")

    def test_egl(self):
        self.plays_all("egl")


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
