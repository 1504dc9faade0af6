"""The verdict of a soak, on series that are made up."""
import unittest

from soak import judge, slope


def windows(count=360, memory=lambda t: 50.0, descriptors=lambda t: 40, p99=lambda t: 3.0, errors=lambda t: []):
    return [{"at_s": 10.0 * n, "memory_mib": memory(10 * n), "descriptors": descriptors(10 * n), "p99_ms": p99(10 * n), "errors": errors(10 * n)}
            for n in range(1, count + 1)]


def failed(series):
    return {name for name, verdict in judge(series).items() if not verdict["passed"]}


class Verdict(unittest.TestCase):
    def test_a_quiet_run_passes(self):
        self.assertEqual(failed(windows()), set())
        noisy = windows(memory=lambda t: 50 + (t // 10 * 7919 % 13) / 10, descriptors=lambda t: 40 + t // 10 % 5, p99=lambda t: 3 + t // 10 % 3)
        self.assertEqual(failed(noisy), set())

    def test_each_fault_fails_its_own_verdict(self):
        self.assertEqual(failed(windows(memory=lambda t: 50 + t / 1000)), {"memory"})
        self.assertEqual(failed(windows(descriptors=lambda t: 40 + t // 900)), {"descriptors"})
        self.assertEqual(failed(windows(p99=lambda t: 3 if t < 1800 else 9)), {"p99"})
        self.assertEqual(failed(windows(errors=lambda t: ["a session ended"] if t == 500 else [])), {"errors"})

    def test_the_start_is_not_judged(self):
        self.assertEqual(failed(windows(memory=lambda t: min(t, 300) / 3)), set())

    def test_a_short_run_is_no_verdict(self):
        self.assertEqual(failed(windows(count=8)), {"length"})

    def test_the_slope_is_that_of_a_line(self):
        self.assertAlmostEqual(slope([(x, 3 * x + 1) for x in range(10)]), 3)
        self.assertAlmostEqual(slope([(0, 1), (1, 0), (2, 1)]), 0)


if __name__ == "__main__":
    unittest.main()
