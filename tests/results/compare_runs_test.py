"""compare_runs.py on made-up runs whose differences are known."""
import math
import pathlib
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import compare_runs  # noqa: E402
import figures  # noqa: E402

COLUMNS = ["scene", "seed", "policy"] + [figure.column for figure in compare_runs.FIGURES]


def run(scene, seed, policy="sightline", **values):
    return dict.fromkeys(COLUMNS, 0.0) | {"scene": scene, "seed": float(seed), "policy": policy} | values


def figure_of(column):
    return next(figure for figure in compare_runs.FIGURES if figure.column == column)


class Comparisons(unittest.TestCase):
    def pairs(self, before, after, column="r_n"):
        return compare_runs.pairs_of([run("hall", seed, **{column: v}) for seed, v in enumerate(before)],
                                     [run("hall", seed, **{column: v}) for seed, v in enumerate(after)])

    def test_the_error_is_of_the_paired_differences(self):
        result = compare_runs.compare(self.pairs([0.1, 0.5, 0.9], [0.2, 0.6, 1.3]), "r_n")
        self.assertAlmostEqual(result.before, 0.5)
        self.assertAlmostEqual(result.after, 0.7)
        self.assertAlmostEqual(result.difference, 0.2)
        # Differences of 0.1, 0.1 and 0.4: variance 0.03.
        self.assertAlmostEqual(result.error, math.sqrt(0.03 / 3))

    def test_one_pair_has_no_error_and_no_verdict(self):
        result = compare_runs.compare(self.pairs([0.1], [0.9]), "r_n")
        self.assertIsNone(result.error)
        self.assertEqual(compare_runs.verdict(figure_of("r_n"), result), "")

    def test_seeds_and_scenes_are_paired_and_the_rest_is_left_out(self):
        before = [run("hall", 1, r_n=0.1), run("hall", 2, r_n=0.2), run("rooms", 1, r_n=0.3)]
        after = [run("rooms", 1, r_n=0.4), run("hall", 2, r_n=0.5), run("hall", 3, r_n=0.9)]
        pairs = compare_runs.pairs_of(before, after)
        self.assertEqual([(a["r_n"], b["r_n"]) for a, b in pairs], [(0.3, 0.4), (0.2, 0.5)])

    def test_more_of_worth_and_sight_is_better_and_more_of_the_rest_is_worse(self):
        rising = ("mean_worth", "joint_whole_share", "joint_visible_share")
        for figure in compare_runs.FIGURES:
            result = compare_runs.compare(self.pairs([0.1, 0.1, 0.1], [0.3, 0.3, 0.31], figure.column), figure.column)
            self.assertEqual(compare_runs.verdict(figure, result), "better" if figure.column in rising else "worse")

    def test_a_difference_whose_confidence_interval_holds_0_is_neither(self):
        verdict = lambda after: compare_runs.verdict(figure_of("r_n"), compare_runs.compare(self.pairs([0.0] * len(after), after), "r_n"))
        self.assertEqual(verdict([0.10, 0.05]), "", "0.075 ± 0.025 from two pairs: three errors are too few")
        self.assertEqual(verdict([0.10, 0.05] * 10), "worse", "0.075 ± 0.006 from twenty")
        self.assertEqual(verdict([0.1, -0.1, 0.1] * 7), "", "0.033 ± 0.021")

    def test_a_figure_that_one_side_lacks_is_named_so(self):
        pairs = self.pairs([0.1], [0.2])
        del pairs[0][0]["r_n"]
        self.assertIsNone(compare_runs.compare(pairs, "r_n"))
        self.assertIn("not in both", compare_runs.report(pairs))


class Command(unittest.TestCase):
    def compare(self, path, *arguments):
        return subprocess.run([sys.executable, str(HERE / "compare_runs.py"), str(path / "before"), str(path / "after" / "runs.csv"),
                               *arguments], capture_output=True, text=True, timeout=60)

    def write(self, path, before, after):
        for name, rows in (("before", before), ("after", after)):
            (path / name).mkdir()
            figures.write_table(path / name / "runs.csv", COLUMNS, rows)

    def test_prints_every_scene_and_all_together(self):
        with tempfile.TemporaryDirectory() as name:
            path = pathlib.Path(name)
            before = [run(scene, seed, joint_visible_share=0.5, d_c_m=100.0) for scene in ("hall", "rooms") for seed in (1, 2)]
            after = [run(scene, seed, joint_visible_share=0.6, d_c_m=90.0 + seed) for scene in ("hall", "rooms") for seed in (1, 2)]
            self.write(path, before + [run("hall", 3)], after)
            result = self.compare(path)
            self.assertEqual(result.returncode, 0, result.stderr)
            lines = result.stdout.splitlines()
            heads = [line.split("(")[0].strip() for line in lines if "difference" in line]
            self.assertEqual(heads, ["hall", "rooms", "all scenes"])
            joint = [line.split() for line in lines if "joint share" in line]
            self.assertEqual(joint[0], ["joint", "share", "50.00", "60.00", "%", "+10.00", "±", "0.00", "better"])
            path_m = [line.split() for line in lines if "path length" in line]
            self.assertEqual(path_m[0], ["path", "length", "100.0", "91.5", "m", "-8.5", "±", "0.5", "better"])
            self.assertIn("1 runs have no partner", result.stdout)

    def test_compares_two_policies(self):
        with tempfile.TemporaryDirectory() as name:
            path = pathlib.Path(name)
            self.write(path, [run("hall", 1, r_n=0.5), run("hall", 1, "calm", r_n=0.1)], [run("hall", 1, "calm", r_n=0.25)])
            self.assertIn("25.00", self.compare(path, "--after-policy", "calm").stdout)
            self.assertNotEqual(self.compare(path).returncode, 0, "the default is not in the second file")


if __name__ == "__main__":
    unittest.main()
