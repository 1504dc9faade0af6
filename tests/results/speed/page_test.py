"""The page on speed: that it says what the tables beside it say, and that its claims can fail."""
import pathlib
import shutil
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import gpu_page  # noqa: E402
import make_page  # noqa: E402
import service  # noqa: E402
from svg_plots import LogAxis, line_plot  # noqa: E402


def row(section, x, name, p50, scene=0.0):
    return {"section": section, "x": float(x), "row": name, "p50_ms": p50, "scene_p50_ms": scene}


def ratio(x, other, value, section="peers"):
    return {"section": section, "x": float(x), "other": other, "ratio": value, "least": value, "greatest": value}


def verdicts(claims):
    return {claim.text: claim.holds for claim in claims}


class KeptPage(unittest.TestCase):
    def test_is_what_its_tables_make(self):
        with tempfile.TemporaryDirectory() as scratch:
            copy = pathlib.Path(scratch) / "speed"
            shutil.copytree(HERE, copy)
            self.assertEqual(make_page.make_page(copy), (HERE / "README.md").read_text(encoding="utf-8"))
            for plot in (HERE / "plots").iterdir():
                self.assertEqual((copy / "plots" / plot.name).read_text(), plot.read_text(), plot.name)

    def test_on_a_gpu_is_what_its_tables_make(self):
        with tempfile.TemporaryDirectory() as scratch:
            copy = pathlib.Path(scratch) / "speed"
            shutil.copytree(HERE, copy)
            self.assertEqual(gpu_page.make_page(copy), (HERE / "gpu.md").read_text(encoding="utf-8"))


class Claims(unittest.TestCase):
    def test_of_peers_follow_the_ratios(self):
        for times, holds in ((12.5, True), (11.9, False)):
            found = verdicts(make_page.step_claims([], [ratio(7, "draw all", times)]))
            self.assertIs(found["EGL, r = 7: at least 12 times as fast as (a)"], holds)
        slow_once = [ratio(5, "embree rays", 0.9), ratio(7, "embree rays", 3.0)]
        self.assertIs(verdicts(make_page.step_claims([], slow_once))["Embree: faster than (b) at every r"], False)

    def test_without_a_measurement_are_not_measured(self):
        self.assertTrue(all(claim.holds is None for claim in make_page.step_claims([], [])))
        self.assertIsNone(make_page.load_claims([])[0].holds)

    def test_of_growth_take_the_greatest_and_count_the_mirror(self):
        rows = [row("detail", 1e4, "embree", 1.0), row("detail", 1e5, "embree", 1.0), row("detail", 1e6, "embree", 1.0)]
        ratios = [ratio(1e5, "embree", 3.1, "detail"), ratio(1e6, "embree", 2.0, "detail")]
        self.assertEqual([claim.holds for claim in make_page.growth_claims(rows, ratios)], [False])
        self.assertEqual([claim.holds for claim in make_page.growth_claims(rows, ratios[1:])], [True])
        rows = [row("movers", 0, "egl", 1.0, 0.1), row("movers", 1000, "egl", 1.9, 0.3)]
        self.assertEqual([claim.holds for claim in make_page.growth_claims(rows, [ratio(1000, "egl", 1.9, "movers")])], [False])
        self.assertEqual([claim.holds for claim in make_page.growth_claims(rows, [ratio(1000, "egl", 1.5, "movers")])], [True])
        for times, holds in ((31.0, True), (33.0, False)):
            ratios = [ratio(2, "egl", 1.0, "targets"), ratio(32, "egl", times, "targets")]
            self.assertEqual([claim.holds for claim in make_page.growth_claims([], ratios)], [holds])


def load(p99_ms, late=0.0, degraded=0.0):
    spread = {"median": 1000 * p99_ms, "min": 0, "max": 0}
    return {"latency_us": {"round_trip": {"p99": spread}}, "service": {"late_share": late, "degraded_share": degraded}}


class ServiceClaims(unittest.TestCase):
    def holds(self, run):
        found = verdicts(service.service_claims({"hundred-plain": run}, make_page.Claim))
        name = service.LOADS["hundred-plain"]
        return ([held for text, held in found.items() if text.startswith(name) and text.endswith("p99 within the tick")] +
                [held for text, held in found.items() if text.startswith(name) and "of the steps degraded" in text])

    def test_of_many_sessions_count_all_late_ticks_and_degraded_steps(self):
        self.assertEqual(self.holds(load(16.0)), [True, True])
        self.assertEqual(self.holds(load(17.0)), [False, False])
        self.assertEqual(self.holds(load(5.0, late=0.02)), [False, False])
        self.assertEqual(self.holds(load(5.0, degraded=0.02)), [True, False])
        self.assertEqual(self.holds(None), [None, None])


class Plot(unittest.TestCase):
    def test_axis_is_logarithmic_and_has_room_for_zero(self):
        axis = LogAxis([0, 10, 1000], 0, 100)
        self.assertEqual(axis.at(0), 0)
        self.assertAlmostEqual(axis.at(1000), 100)
        self.assertAlmostEqual(axis.at(100) - axis.at(10), axis.at(1000) - axis.at(100))

    def test_has_every_line(self):
        text = line_plot("t", "x", "y", {"a & b": [(1, 1), (10, 2)], "c": [(1, 3), (10, 4)]})
        self.assertEqual(text.count("<polyline"), 2)
        self.assertIn("a &amp; b", text)


if __name__ == "__main__":
    unittest.main()
