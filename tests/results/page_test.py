"""The results page on made-up tables: page_test.py. Claims that hold and that do not, and the page as a whole."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

import claims  # noqa: E402
import figures  # noqa: E402
import levels_page  # noqa: E402
import make_page  # noqa: E402
import paper_tables  # noqa: E402
import scene_tables  # noqa: E402
import shot_tables  # noqa: E402


def spread(name, value):
    return {name + part: value for part in ("_mean", "_median", "_least", "_most")}


# ---- made-up tables ----

def stability(name, d_c_ratio, d_s_ratio, reaction_s=0.2):
    row = {"stability": name, "runs": 5.0, "occlusions": 10.0, "mean_reaction_s": reaction_s, "p95_reaction_s": reaction_s,
           "paper_t_c_ms": 2.7, "paper_d_c": 157.0, "paper_d_s": 1.7}
    for figure, value in (("d_c_ratio", d_c_ratio), ("d_s_ratio", d_s_ratio), ("t_c_ms", 1.0), ("d_c_m", 3.0),
                          ("d_s_heights", 0.5), ("mean_visible_share", 0.6), ("joint_visible_share", 0.4)):
        row.update(spread(figure, value))
    return row


def good_table3():
    return [stability("0/0", 1.0, 1.0), stability("3/5", 4.0, 1.4), stability("6/10", 38.0, 17.0),
            stability("8/15", 390.0, 17.0), stability("sightline", 38.0, 20.0)]


PAPER_MODELS = (("Basic", 0.0, 0.1232), ("RobustMove", 0.0, 0.0747), ("Basic", 100.0, 0.0332), ("Basic", 300.0, 0.0112),
                ("Basic", 500.0, 0.0502), ("RobustMove", 100.0, 0.0059), ("RobustMove", 300.0, 0.0),
                ("RobustMove", 500.0, 0.0141))


def model(name, prediction_ms, r_n, r_p, d_c_m, paper_r_n):
    row = {"model": name, "prediction_ms": prediction_ms, "runs": 5.0, "pictures": 100.0, "paper_r_n": paper_r_n,
           "paper_r_p": paper_r_n}
    for figure, value in (("r_n", r_n), ("r_p", r_p), ("d_c_m", d_c_m), ("r_p_tolerant", r_p), ("mean_hidden_share", 0.1),
                          ("d_s_heights", 1.0), ("step_time_ms", 1.0)):
        row.update(spread(figure, value))
    return row


def good_table2():
    """The paper's own shares; the default better than all."""
    rows = [model(name, ms, r_n, 0.02 + r_n, 50.0, r_n) for name, ms, r_n in PAPER_MODELS]
    return rows + [model("sightline", None, 0.00004, 0.01, 50.0, None)]


def run(scene, policy, seed, joint, episodes, **other):
    row = dict.fromkeys(make_page.RUN_COLUMNS, 0.0)
    row.update(scene=scene, policy=policy, seed=seed, joint_visible_share=joint, episodes=episodes, reported_pairs=100.0,
               reported_hidden_pairs=20.0, filtered_share_error=0.05, sustained_occlusions=1.0, mean_reaction_s=0.3)
    row.update(dict.fromkeys(set(make_page.SHOT_COLUMNS) - set(row), 0.25))
    row.update(other)
    return row


def good_runs():
    runs = []
    for scene in ("hall", "forest"):
        for seed in (1.0, 2.0):
            runs += [run(scene, policy, seed, 0.5, 3.0) for policy in claims.RIVALS]
            runs.append(run(scene, "sightline", seed, 0.9, 1.0))
    return runs


def change(rows, new, **wanted):
    """The rows with one changed."""
    found = figures.find(rows, **wanted)
    assert found is not None, wanted
    found.update(new)
    return rows


def failing(some_claims):
    return [claim.text for claim in some_claims if claim.holds is False]


# ---- the paper's tables ----

class PaperTables(unittest.TestCase):
    def test_a_spread_is_mean_median_least_and_greatest(self):
        self.assertEqual(list(paper_tables.spread("x", [5, 1, 3]).values()), [3, 3, 1, 5])
        self.assertEqual(list(paper_tables.spread("x", [4, 1, 2, 9]).values()), [4, 3, 1, 9])
        self.assertEqual(set(paper_tables.spread("x", []).values()), {None})

    def test_printed_times_add_up_as_far_as_the_paper_rounds_them(self):
        for _, render, intersect, select, whole in paper_tables.PAPER_TIMES.values():
            self.assertAlmostEqual(render + intersect + select, whole, delta=0.06)

    def test_table_2_has_every_model(self):
        runs = [run("hall", "robust-300", seed, 0.5, 0.0, r_n=r_n, pictures=10.0, step_ms=1.0) for seed, r_n in ((1.0, 0.25), (2.0, 0.75))]
        rows = paper_tables.table2(runs + [run("fence", "robust-300", 1.0, 0.5, 0.0, r_n=9.0, step_ms=1.0)])
        self.assertEqual([row["paper_r_n"] for row in rows],
                         [0.1232, 0.0747, 0.0332, 0.0112, 0.0502, 0.0059, 0.0, 0.0141] + 8 * [None])
        row = figures.find(rows, model="RobustMove", prediction_ms=300)
        self.assertEqual((row["r_n_mean"], row["r_n_least"], row["pictures"], row["runs"]), (0.5, 0.25, 20, 2))
        self.assertIsNone(figures.find(rows, model="Basic", prediction_ms=0)["r_n_mean"])

    def test_table_2_has_the_other_sampler_and_the_shot_beside(self):
        runs = [run("hall-front", "center", seed, 0.5, 0.0, r_n=0.5, pictures=10.0, step_ms=1.0, pair_volume_share=share, shot_kept_share=0.25)
                for seed, share in ((1.0, 0.5), (2.0, 1.0))]
        embree = [run("hall-front", "center", 1.0, 0.5, 0.0, r_n=0.125), run("hall-front", "robust", 1.0, 0.5, 0.0, r_n=0.75)]
        row = figures.find(paper_tables.table2(runs, embree, "hall-front"), model="RobustMove, centre", prediction_ms=0)
        self.assertEqual((row["r_n_mean"], row["embree_r_n_mean"], row["pair_volume_share"], row["shot_kept_share"]), (0.5, 0.125, 0.75, 0.25))

    def test_table_3_can_be_of_another_fence(self):
        runs = [run("fence-agile", policy, 1.0, 0.5, 0.0, d_c_m=d_c, d_s_heights=1.0, step_ms=1.0, mean_visible_share=1.0)
                for policy, d_c in (("agile-0-0", 20.0), ("agile-6-10", 2.0), ("stability-6-10", 5.0))]
        row = figures.find(paper_tables.table3(runs, [], "fence-agile", "agile"), stability="6/10")
        self.assertEqual((row["d_c_ratio_median"], row["paper_d_c"], row["occlusions"]), (10.0, 4.1, 0))

    def test_table_3_divides_seed_by_seed_and_pools_the_reactions_to_the_board(self):
        fence = lambda seed, policy, d_c, d_s: run("fence", policy, seed, 0.5, 0.0, d_c_m=d_c, d_s_heights=d_s, step_ms=1.0,
                                                   mean_visible_share=1.0, reaction_delays_s="9.0 ")
        board = lambda seed, delays, regain: run("fence-board", "stability-6-10", seed, 0.5, 0.0, d_c_m=1000.0, step_ms=1.0,
                                                 reaction_delays_s=delays, sustained_occlusions=float(len(delays.split())),
                                                 mean_regain_s=regain, unanswered_occlusions=1.0)
        rows = paper_tables.table3([fence(1.0, "stability-0-0", 100, 8), fence(2.0, "stability-0-0", 40, 4),
                                    fence(2.0, "stability-6-10", 20, 1), fence(1.0, "stability-6-10", 10, 0),
                                    board(1.0, "0.1 0.5 ", 2.0), board(2.0, "0.3 ", 5.0)])
        self.assertEqual([row["stability"] for row in rows], ["0/0", "3/5", "6/10", "8/15", "sightline"])
        self.assertEqual([row["runs"] for row in rows], [2, 0, 2, 0, 0])
        row = rows[2]
        self.assertEqual((row["d_c_m_median"], row["d_c_ratio_least"], row["d_c_ratio_median"], row["d_c_ratio_most"]), (15, 2, 6, 10))
        self.assertEqual((row["d_s_ratio_least"], row["d_s_ratio_most"]), (4, float("inf")))
        self.assertEqual((row["occlusions"], row["unanswered"], row["p95_reaction_s"], row["paper_d_c"]), (3, 2, 0.5, 4.1))
        self.assertAlmostEqual(row["mean_reaction_s"], 0.3)
        self.assertAlmostEqual(row["mean_regain_s"], 3.0)
        self.assertEqual(rows[0]["d_c_ratio_mean"], 1)
        self.assertIsNone(rows[0]["mean_reaction_s"], "a camera that was never tried has not reacted at once")
        self.assertIsNone(rows[4]["paper_d_c"])


# ---- claims ----

class StepClaims(unittest.TestCase):
    def found(self, longest_ms):
        rows = [{"sampler": "embree", "settings": settings, "total_p50_ms": 0.5, "total_longest_ms": longest}
                for settings, longest in (("paper", 9.0), ("default", longest_ms))]
        return claims.step_claims(rows)

    def test_a_step_that_takes_longer_than_before_the_plan_fails(self):
        costs = [{"sampler": sampler, "before_ms": 0.5, "with_plan_ms": now} for sampler, now in (("embree", 0.5), ("egl", 0.6))]
        found = claims.step_claims([], costs)
        self.assertEqual([claim.holds for claim in found], [True, False])
        self.assertEqual(found[1].figure, "0.60 against 0.50 ms")

    def test_the_default_takes_three_medians_at_most(self):
        self.assertEqual([claim.holds for claim in self.found(1.5) + self.found(1.51)], [True, False])
        self.assertEqual(self.found(2.0)[0].figure, "2.00 ms, 4.0 medians")


class StabilityClaims(unittest.TestCase):
    def test_all_hold_at_the_very_thresholds(self):
        found = claims.stability_claims(good_table3())
        self.assertEqual(len(found), 8)
        self.assertTrue(all(claim.holds is True for claim in found), failing(found))

    def test_each_ratio_is_held_against_its_own_threshold(self):
        for name, figure, value in (("3/5", "d_c_ratio", 3.99), ("3/5", "d_s_ratio", 1.39), ("6/10", "d_s_ratio", 16.9),
                                    ("8/15", "d_c_ratio", 389.0), ("8/15", "d_s_ratio", 16.9)):
            table = change(good_table3(), spread(figure, value), stability=name)
            found = failing(claims.stability_claims(table))
            self.assertEqual(len(found), 1, found)
            self.assertTrue(found[0].startswith(f"{name}: {figure[:3]}"), found)

    def test_the_default_is_compared_with_what_6_of_10_does(self):
        table = change(good_table3(), spread("d_c_ratio", 41.0), stability="6/10")
        self.assertEqual(failing(claims.stability_claims(table)), ["Default: d_c falls at least as much as with 6/10"])

    def test_a_default_that_answers_late_fails_and_one_never_tried_cannot_be_told(self):
        late = change(good_table3(), {"mean_reaction_s": 0.35}, stability="sightline")
        self.assertEqual(failing(claims.stability_claims(late)),
                         ["Default: mean reaction to a sustained occlusion below 0.35 s"])
        untried = change(good_table3(), {"mean_reaction_s": None}, stability="sightline")
        self.assertIsNone(claims.stability_claims(untried)[-1].holds)

    def test_infinitely_calmer_holds(self):
        table = change(good_table3(), spread("d_c_ratio", float("inf")), stability="8/15")
        self.assertEqual(failing(claims.stability_claims(table)), [])

    def test_a_row_that_is_missing_is_no_success(self):
        table = [row for row in good_table3() if row["stability"] != "8/15"]
        self.assertEqual([claim.holds for claim in claims.stability_claims(table)].count(None), 2)


class ModelClaims(unittest.TestCase):
    def test_the_papers_own_figures_keep_every_claim(self):
        found = claims.model_claims(good_table2())
        self.assertEqual(len(found), 9)
        self.assertTrue(all(claim.holds is True for claim in found), failing(found))

    def test_each_claim_fails_by_its_own_figure(self):
        for wanted, new, text in (
            ({"model": "RobustMove", "prediction_ms": 300.0}, spread("r_p", 0.0229), "RobustMove+Pred. 300: r_P"),
            ({"model": "sightline"}, spread("r_n", 0.00006), "Default: r_N"),
            ({"model": "sightline"}, spread("r_p", 0.0101), "Default: r_P"),
            ({"model": "sightline"}, spread("d_c_m", 50.1), "Default: d_c"),
            ({"model": "Basic", "prediction_ms": 500.0}, spread("r_p", 0.01), "Basic: a prediction of 500 ms"),
        ):
            found = failing(claims.model_claims(change(good_table2(), new, **wanted)))
            self.assertEqual(len(found), 1, found)
            self.assertTrue(found[0].startswith(text), found)

    def test_an_easy_hall_fails(self):
        table = change(good_table2(), spread("r_n", 0.0999), model="Basic", prediction_ms=0.0)
        self.assertEqual(len(failing(claims.model_claims(table))), 1)

    def test_two_rows_the_other_way_round_break_the_order_and_a_tie_does_not(self):
        turned = change(good_table2(), spread("r_n", 0.08), model="Basic", prediction_ms=500.0)
        claim = claims.order_claim(turned)
        self.assertFalse(claim.holds)
        self.assertIn("1 of 28 pairs", claim.figure)
        tied = change(good_table2(), spread("r_n", 0.0747), model="Basic", prediction_ms=500.0)
        self.assertTrue(claims.order_claim(tied).holds)

    def test_as_good_at_500_as_at_300_is_not_worse(self):
        table = good_table2()
        for name in ("r_n", "r_p"):
            change(table, spread(name, 0.0), model="RobustMove", prediction_ms=500.0)
            change(table, spread(name, 0.0), model="RobustMove", prediction_ms=300.0)
        self.assertIn("RobustMove: a prediction of 500 ms is worse than one of 300 ms", failing(claims.model_claims(table)))


class SceneClaims(unittest.TestCase):
    def test_all_hold(self):
        found = claims.scene_claims(good_runs())
        self.assertEqual(len(found), 16)
        self.assertTrue(all(claim.holds is True for claim in found), failing(found))

    def test_the_scene_where_a_rival_sees_more_is_named_with_both_figures(self):
        runs = change(good_runs(), {"joint_visible_share": 1.0}, scene="forest", policy="paper", seed=1.0)
        change(runs, {"joint_visible_share": 1.0}, scene="forest", policy="paper", seed=2.0)
        found = [claim for claim in claims.scene_claims(runs) if not claim.holds]
        self.assertEqual([claim.text for claim in found], ["Every scene: a higher joint visible share than paper"])
        self.assertEqual(found[0].figure, "in 1 of 2 scenes; not in forest (90.00 % against 100.00 %)")

    def test_means_over_seeds_decide(self):
        runs = change(good_runs(), {"joint_visible_share": 1.0}, scene="forest", policy="paper", seed=1.0)
        self.assertEqual(failing(claims.scene_claims(runs)), [])

    def test_only_seeds_that_both_played_are_compared(self):
        runs = good_runs() + [run("forest", "sightline", 3.0, 0.0, 9.0)]
        against = claims.scene_claims(runs)[:2 * len(claims.RIVALS)]
        self.assertEqual(failing(against), [])

    def test_a_tie_holds_only_where_nothing_could_be_better(self):
        for share, holds in ((1.0, True), (0.7, False)):
            runs = good_runs()
            for row in figures.select(runs, scene="hall"):
                row["joint_visible_share"] = share
            self.assertIs(claims.scene_claims(runs)[0].holds, holds)
        for episodes, holds in ((0.0, True), (2.0, False)):
            runs = good_runs()
            for row in figures.select(runs, scene="hall"):
                row["episodes"] = episodes
            self.assertIs(claims.scene_claims(runs)[1].holds, holds)

    def test_a_loss_since_the_plan_counts_beyond_two_standard_errors(self):
        for losses, holds in (((0.1, 0.1), False), ((0.1, -0.02), True), ((0.1, 0.06), False), ((0.0, 0.0), True), ((-0.1, -0.1), True)):
            former = [run("hall", "sightline", seed, 0.9 + loss, 1.0) for seed, loss in zip((1.0, 2.0), losses)]
            former.append(run("hall", "sightline", 9.0, 1.0, 1.0))  # no run of now has this seed
            claim = claims.scene_claims(good_runs(), former=former)[-1]
            self.assertIs(claim.holds, holds, losses)
        self.assertEqual(len(claims.scene_claims(good_runs(), former=former)), 17)

    def test_the_loss_is_named_with_both_figures(self):
        former = [run(scene, "sightline", seed, joint, 1.0) for scene, joint in (("hall", 0.95), ("forest", 0.5)) for seed in (1.0, 2.0)]
        self.assertEqual(claims.scene_claims(good_runs(), former=former)[-1].figure, "in 1 of 2 scenes; not in hall (90.00 % against 95.00 %)")

    def test_one_touch_and_one_violation_are_one_too_many(self):
        for name in ("body_collisions", "limit_violations"):
            runs = change(good_runs(), {name: 1.0}, scene="hall", policy="sightline", seed=2.0)
            found = [claim for claim in claims.scene_claims(runs) if not claim.holds]
            self.assertEqual(len(found), 1)
            self.assertIn("not in hall (1)", found[0].figure)
            others = change(good_runs(), {name: 1.0}, scene="hall", policy="follow")
            self.assertEqual(failing(claims.scene_claims(others)), [], "only the default promises it")

    def test_each_limit_of_calm_and_honesty_is_held_against_its_own_figure(self):
        for name, kept, broken in (("longest_blind_with_way_s", 1.0, 1.1), ("tracking_while_lost", 0.0049, 0.005),
                                   ("acceleration_limit_share", 0.199, 0.2), ("rms_jerk_mps3", 149.9, 150.0),
                                   ("goal_jumps_per_s", 1.99, 2.0)):
            for value, fails in ((kept, 0), (broken, 1)):
                runs = good_runs()
                for row in figures.select(runs, scene="hall", policy="sightline"):
                    row[name] = value
                found = [claim for claim in claims.scene_claims(runs) if not claim.holds]
                self.assertEqual(len(found), fails, (name, value, found))
                self.assertTrue(all("not in hall (" in claim.figure for claim in found), found)

    def test_one_seed_that_stays_blind_breaks_the_claim_and_one_restless_seed_does_not(self):
        runs = change(good_runs(), {"longest_blind_with_way_s": 1.5}, scene="hall", policy="sightline", seed=2.0)
        self.assertEqual(len(failing(claims.scene_claims(runs))), 1)
        runs = change(good_runs(), {"goal_jumps_per_s": 3.0}, scene="hall", policy="sightline", seed=2.0)
        self.assertEqual(failing(claims.scene_claims(runs)), [], "the mean over seeds is 1.5")

    def test_figures_that_were_not_measured_are_no_success(self):
        runs = good_runs()
        for row in runs:
            del row["goal_jumps_per_s"]
        found = [claim for claim in claims.scene_claims(runs) if claim.holds is None]
        self.assertEqual([claim.figure for claim in found], [claims.MISSING])

    def test_the_error_of_reports_is_weighted_by_their_number(self):
        runs = change(good_runs(), {"filtered_share_error": 0.2, "reported_pairs": 1.0}, scene="hall", policy="sightline", seed=1.0)
        change(runs, {"filtered_share_error": 0.01}, scene="hall", policy="sightline", seed=2.0)
        self.assertEqual(failing(claims.scene_claims(runs)), [])
        change(runs, {"reported_pairs": 100.0}, scene="hall", policy="sightline", seed=1.0)
        self.assertEqual(len(failing(claims.scene_claims(runs))), 1)


# ---- the page ----

class Ceiling(unittest.TestCase):
    RUNS = [run("hall", "sightline", seed, joint, 1.0) for seed, joint in ((1.0, 0.4), (2.0, 0.5), (3.0, 0.9))]

    def ceiling(self, seed, joint):
        return {"scene": "hall", "seed": seed, "joint_visible_share": joint, "most_joint": 0.9, "body_collisions": 0.0, "limit_violations": 0.0}

    def test_the_share_is_over_the_seeds_that_both_played(self):
        (part,) = scene_tables.ceiling_part([self.ceiling(1.0, 0.8), self.ceiling(2.0, 0.7)], self.RUNS)
        self.assertIn("| hall | 2 | 45.0 % | 75.0 % | 90.0 % | 60.0 % |", part)

    def test_a_seed_that_only_the_ceiling_played_does_not_count(self):
        (part,) = scene_tables.ceiling_part([self.ceiling(1.0, 0.8), self.ceiling(9.0, 0.2)], self.RUNS)
        self.assertIn("| hall | 1 | 40.0 % | 80.0 % |", part)

    def test_a_ceiling_that_sees_nothing_has_no_share(self):
        (part,) = scene_tables.ceiling_part([self.ceiling(1.0, 0.0)], self.RUNS)
        self.assertIn("| 0.0 % | 90.0 % |  |", part)

    def test_without_measurements_there_is_no_part(self):
        self.assertEqual(scene_tables.ceiling_part([], self.RUNS), [])

    def test_its_claims_name_the_scenes_below_their_share(self):
        runs = self.RUNS + [run("forest", "sightline", 1.0, 0.85, 1.0)]
        ceilings = [self.ceiling(1.0, 0.5), {**self.ceiling(1.0, 1.0), "scene": "forest"}]
        each, together = claims.scene_claims(runs, ceilings)[-2:]
        self.assertEqual((each.holds, each.figure), (False, "in 1 of 2 scenes; not in hall (80.0 %)"))
        self.assertEqual((together.holds, together.figure), (False, "82.5 % over 2 scenes"))
        ceilings[0]["joint_visible_share"] = 0.4
        each, together = claims.scene_claims(runs, ceilings)[-2:]
        self.assertEqual((each.holds, together.holds), (True, True))


class Levels(unittest.TestCase):
    def page(self, runs, ceilings=(), notes=None, **tables):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            (folder / "how.json").write_text('{"rate_hz": 60, "level_seeds": 8, "scenes_every": 10}', encoding="utf-8")
            figures.write_table(folder / "levels.csv", list(runs[0]), runs)
            for table, rows in tables.items():
                figures.write_table(folder / (table.replace("_", "-") + ".csv"), list(rows[0]), rows)
            if notes:
                (folder / "levels-notes.md").write_text(notes, encoding="utf-8")
            return levels_page.levels_page(folder, list(ceilings))

    def test_each_group_has_its_own_claims_and_table(self):
        runs = [run(scene, policy, 1.0, joint, 1.0, r_n=r_n) for scene, r_n in (("level-one", 0.004), ("tile-one", 0.005), ("lift", 0.3))
                for policy, joint in (("follow", 0.25), ("sightline", 0.75))]
        page = self.page(runs)
        self.assertEqual([line for line in page.splitlines() if line.startswith("## ")],
                         ["## Levels of boxes", "## Levels composed of tiles", "## Situations"])
        self.assertIn("| level-one | 25.0 % |  |  |  | 75.0 % | 0.40 % |", page)
        blind = [line for line in page.splitlines() if line.startswith("| Every scene: nobody in sight")]
        self.assertEqual(["**holds**" in line for line in blind], [True, False, False])
        self.assertIn("in 0 of 1 scenes; not in lift (30.00 %)", blind[2])

    def test_the_mean_of_all_scenes_counts_those_of_the_results_page(self):
        ceilings = [{"scene": scene, "seed": 1.0, "joint_visible_share": share, "most_joint": 1.0} for scene, share in (("level-one", 1.0), ("hall", 0.5))]
        page = self.page([run("level-one", "sightline", 1.0, 0.9, 1.0)], ceilings, scenes=[run("hall", "sightline", 1.0, 0.4, 1.0)])
        self.assertIn("90 % of the ceiling's joint share | **does not hold** | 85.0 % over 2 scenes |", page)
        self.assertNotIn("All scenes with a ceiling", self.page([run("level-one", "sightline", 1.0, 0.9, 1.0)], scenes=[run("hall", "sightline", 1.0, 0.4, 1.0)]))

    def test_its_notes_stand_before_the_groups(self):
        self.assertNotIn("Lift: waits", self.page([run("lift", "sightline", 1.0, 0.5, 1.0)]))
        page = self.page([run("lift", "sightline", 1.0, 0.5, 1.0)], notes="- Lift: waits.")
        self.assertIn("- Lift: waits.", page.split("## ", 1)[0])

    def test_a_group_that_was_not_played_is_left_out(self):
        page = self.page([run("lift", "sightline", 1.0, 0.5, 1.0)])
        self.assertNotIn("tiles", page.split("## ", 1)[1])

    def test_a_use_shows_the_build_before_and_now_and_its_tests(self):
        uses = [{"use": "a lift", "expected": "waits", "before": "crushed", "scene": "lift", "test": "Lift.Rides", "now": "it rides"},
                {"use": "an echo", "expected": "the same", "before": "slow", "scene": None, "test": "Echo.Is; Echo.Was", "now": "the same"}]
        former = [run("lift", "sightline", 1.0, 0.1, 1.0, r_n=0.9, longest_blind_s=20.0)]
        now = [run("lift", "sightline", 1.0, 0.5, 1.0, r_n=0.25, longest_blind_s=2.0), run("lift", "sightline", 2.0, 0.7, 1.0, r_n=0.35, longest_blind_s=1.0)]
        page = self.page(now, uses=uses, levels_before_plan=former)
        self.assertIn("| a lift | waits | crushed | `lift`, `Lift.Rides` | joint 10.0 %, nobody 90.0 %, blind 20.0 s | joint 50.0 %, nobody 25.0 %, blind 2.0 s | "
                      "joint 60.0 %, nobody 30.0 %, blind 2.0 s; it rides |", page)
        self.assertIn("| an echo | the same | slow | `Echo.Is`, `Echo.Was` |  |  | the same |", page)


class Worth(unittest.TestCase):
    def row(self, scene, build, worth):
        return {"scene": scene, "seed": 1.0, "build": build, "mean_worth": worth, "joint_whole_share": 0.5, "asked_height_rad": 0.25,
                "median_height_rad": 0.5, "shot_kept_share": 0.75, "r_n": 0.125}

    def test_both_builds_stand_side_by_side_and_the_greatest_fall_is_named(self):
        page = make_page.worth_part([self.row("hall", "before", 0.5), self.row("hall", "now", 0.8), self.row("doors", "before", 0.4), self.row("doors", "now", 0.3)])
        self.assertIn("| hall | 0.50 | 0.80 | 50 % | 50 % | 14 | 29 | 29 | 75 % | 75 % | 12.5 % | 12.5 % |", page)
        self.assertIn("rose by 0.100", page)
        self.assertIn("fell most in doors, by 0.10", page)
        self.assertIn("fell in none", make_page.worth_part([self.row("hall", "before", 0.5), self.row("hall", "now", 0.8)]))

    def test_claims_compare_whole_bodies_and_worth(self):
        runs = [run("hall", policy, 1.0, 0.5, 3.0, joint_whole_share=0.4, mean_worth=0.5) for policy in claims.RIVALS]
        for height_rad, is_near in ((0.3, True), (0.4, False)):
            own = run("hall", "sightline", 1.0, 0.5, 3.0, joint_whole_share=0.5, mean_worth=0.45, asked_height_rad=0.2, median_height_rad=height_rad)
            holds = [claim.holds for claim in claims.shot_claims(runs + [own])]
            self.assertEqual(holds, [True, False] * len(claims.RIVALS) + [is_near])
        self.assertIn("11.5 degrees away, in hall", claims.shot_claims(runs + [own])[-1].figure)


class Shots(unittest.TestCase):
    def row(self, scene, policy, seed=1.0, **figures):
        return {name: 0.25 for name in shot_tables.SHOT_COLUMNS + shot_tables.WORTH_CEILING_COLUMNS} | {"scene": scene, "policy": policy, "seed": seed} | figures

    def test_scenes_under_roofs_in_which_somebody_is_cut_off_are_named(self):
        part = shot_tables.roofs_part([self.row("roof-two", "sightline", joint_whole_share=0.97), self.row("roof-four", "sightline", joint_whole_share=0.9),
                                       self.row("roof-four", "sightline", 2.0, joint_whole_share=0.7), self.row("roof-four", "raycast", joint_whole_share=0.1)])
        self.assertIn("in 1 of 2 scenes; not in roof-four (80 %)", part)
        self.assertIn("| roof-four | sightline | 2 | 0.250 | 80.0 % | 70 % |", part)
        self.assertEqual(shot_tables.roofs_part([]), "")

    def test_answers_to_changes_are_means_over_changes_and_the_longest_of_any_run(self):
        row = lambda seed, **figures: self.row("cycle", "sightline", seed, **{"body_collisions": 0.0, "longest_blind_s": 0.25} | figures)
        part = shot_tables.subjects_part([row(1.0, target_changes=1.0, mean_change_answer_s=1.0, longest_change_answer_s=1.0),
                                          row(2.0, target_changes=3.0, mean_change_answer_s=2.0, longest_change_answer_s=5.0, longest_blind_s=0.5),
                                          self.row("cycle", "follow"), self.row("runner", "sightline", target_changes=0.0, body_collisions=0.0, longest_blind_s=0.0)])
        self.assertIn("| 4 | 1.8 | 5.0 | 0.5 | 0 |", part)
        self.assertIn("|  |  |  | 0.0 | 0 |", part)
        self.assertNotIn("follow", part)

    def test_the_default_is_compared_with_the_ceiling_on_shared_seeds(self):
        part = shot_tables.worth_ceiling_part([self.row("hall", "sightline", 1.0, mean_worth=0.6), self.row("hall", "sightline", 2.0, mean_worth=0.1),
                                               self.row("hall", "ceiling-worth", 1.0, mean_worth=0.8, most_worth=0.9), self.row("city", "sightline")])
        self.assertIn("| hall | 1 | 0.60 | 0.80 | 0.90 | 75 % |", part)
        self.assertNotIn("city", part)
        self.assertNotIn("tuning seeds", part)

    def test_shots_stand_beside_each_other_with_their_means(self):
        part = shot_tables.named_shots_part([self.row("hall", "chase", mean_worth=0.9), self.row("hall", "orbit", mean_worth=0.5), self.row("city", "chase", mean_worth=0.7),
                                             self.row("city", "orbit", mean_worth=0.5), self.row("city", "follow", mean_worth=0.1)])
        self.assertIn("| scene | chase | orbit |", part)
        self.assertIn("| mean | 0.80 | 0.50 |", part)


class Page(unittest.TestCase):
    def make_raw(self, raw):
        """What make.sh leaves: rows by name of policy, every figure the same for all."""
        for folder in ("hall", "hall-front", "fence", "agile", "agile-embree", "scenes", "keep-shot"):
            (raw / folder).mkdir(parents=True)
        timing = {"sampler": "embree", "renderer": "rays, by the CPU", "settings": "paper", "r": 5, "frames": 10, "samples": 100}
        for stage in ("sample", "aggregate", "move", "total"):
            timing.update({f"{stage}_p50_ms": 0.25, f"{stage}_p95_ms": 0.5})
        timing["total_longest_ms"] = 0.75
        figures.write_table(raw / "table1.csv", list(timing), [timing])
        runs = good_runs()
        for row in figures.select(runs, policy="sightline"):
            row.update(d_c_m=12.0, acceleration_limit_share=0.1, speed_limit_share=0.01, rms_jerk_mps3=100.0, p99_jerk_mps3=400.0,
                       reversals_per_s=0.25, goal_jumps_per_s=1.5, pictures=100.0, r_n=0.01, filtered_false_occluded=0.2,
                       tracking_while_lost=0.005, lost_called_tracking=0.6, tracking_while_half_hidden=0.02)
        figures.write_table(raw / "scenes" / "runs.csv", list(runs[0]), runs)
        self.write_pictures(raw / "scenes", {"hall"}, ("follow", "sightline"))
        self.write_runs(raw / "hall", {"hall"}, [policy for policy, *_ in paper_tables.MODELS])
        self.write_runs(raw / "fence", {"fence", "fence-board"}, [policy for policy, *_ in paper_tables.STABILITIES])
        self.write_runs(raw / "keep-shot", {"hall"}, make_page.TRADES)
        agile = [policy.replace("stability", "agile") for policy, *_ in paper_tables.STABILITIES]
        self.write_runs(raw / "hall-front", {"hall-front"}, [policy for policy, *_ in paper_tables.MODELS])
        self.write_runs(raw / "agile", {"fence-agile"}, agile)
        self.write_runs(raw / "agile-embree", {"fence-agile"}, agile)
        self.write_pictures(raw / "agile", {"fence-agile"}, agile)
        self.write_pictures(raw / "fence", {"fence"}, [policy for policy, *_ in paper_tables.STABILITIES])

    def write_runs(self, folder, scenes, policies):
        runs = [run(scene, policy, 1.0, 0.5, 3.0, reaction_delays_s="0.016 0.5 ", mean_regain_s=1.0, unanswered_occlusions=0.0,
                    mean_visible_share=0.9) for scene in scenes for policy in policies]
        figures.write_table(folder / "runs.csv", list(runs[0]), runs)
        timing = [{"scene": row["scene"], "seed": 1, "policy": row["policy"], "step_ms": 0.25} for row in runs]
        figures.write_table(folder / "timing.csv", list(timing[0]), timing)

    def write_pictures(self, folder, scenes, policies):
        rows = [{"scene": scene, "seed": 1, "policy": policy, "time_s": t, "camera_x_m": t, "camera_y_m": 0.0, "camera_z_m": 0.0,
                 "least_whole_share": 1.0} for scene in scenes for policy in policies for t in (0.0, 1.0, 2.0)]
        figures.write_table(folder / "pictures.csv", list(rows[0]), rows)

    def make(self, path, *arguments):
        return subprocess.run([sys.executable, str(HERE / "make_page.py"), str(path / "page"), *arguments],
                              capture_output=True, text=True, timeout=60)

    def test_is_written_from_the_measurements_and_again_from_the_tables(self):
        with tempfile.TemporaryDirectory() as name:
            path = pathlib.Path(name)
            self.make_raw(path / "raw")
            how = [f"--how={key}=5" for key in make_page.HOW_KEYS]
            result = self.make(path, "--raw", str(path / "raw"), *how)
            self.assertEqual(result.returncode, 0, result.stderr)
            page = (path / "page" / "README.md").read_text(encoding="utf-8")
            self.assertIn("| paper | 5 | 100 | 0.250 (0.500) |", page)
            self.assertIn("| RobustMove+Pred. 300 | 0.00 % | 0.00 | 0.00 % |", page)
            self.assertIn("| 3/5 | 0.25 | 2.75 | 0.00 | 1.00 | 4.1 |", page)
            self.assertIn("| hall | sightline | 90.0 % | 0.0 % | 1.0 |", page)
            self.assertIn("| hall | sightline | 0 | 0 | 12.0 | 10.0 % | 1.0 % | 100 | 400 | 0.25 | 1.50 |", page)
            self.assertIn("| 20.0 % | 0.50 % | 60.0 % | 2.00 % |", page)
            self.assertIn("| hall | sightline | 0.25 | 25 % | 25.0 % | 90.0 % | 0.25 | 14 | 14 | 25 % | 25 % | 0.25 |", page)
            self.assertIn("| 0.5 | 25.0 % | 25.0 % | 25.0 % | 0.250 | 0.250 | 0.250 | 14 |", page)
            self.assertEqual(page.count("!["), 5)
            for line in page.splitlines():
                if line.startswith("!["):
                    self.assertTrue((path / "page" / line.split("(")[1].rstrip(")")).is_file(), line)
            self.assertEqual(self.make(path).returncode, 0)
            self.assertEqual((path / "page" / "README.md").read_text(encoding="utf-8"), page)

    def test_refuses_to_say_nothing_about_the_measurements(self):
        with tempfile.TemporaryDirectory() as name:
            self.assertNotEqual(self.make(pathlib.Path(name), "--raw", name).returncode, 0)

    @unittest.skipUnless((HERE / "how.json").is_file(), "no results are kept here")
    def test_the_page_that_is_kept_says_what_the_tables_beside_it_say(self):
        self.assertEqual(make_page.make_page(HERE), (HERE / "README.md").read_text(encoding="utf-8"))
        if (HERE / "levels.csv").exists():
            self.assertEqual(levels_page.levels_page(HERE, make_page.measured_ceilings(HERE)), (HERE / "levels.md").read_text(encoding="utf-8"))


# ---- runs that are played again ----

class Reasons(unittest.TestCase):
    """Their sums are those of all scenes."""

    def sums_after(self, *scenes):
        with tempfile.TemporaryDirectory() as name:
            folder, raw = pathlib.Path(name, "page"), pathlib.Path(name, "raw")
            folder.mkdir(), (raw / "scenes").mkdir(parents=True)
            (folder / "scenes.csv").write_text("scene\nhall\ndoors\n")
            (folder / "reasons.csv").write_text("reason,runs,claims,false_claims\nother_shot,9,90,3\n")
            rows = "".join(f'"{scene}",1,2,"sightline",other_shot,5,1\n' for scene in scenes)
            (raw / "scenes" / "reasons.csv").write_text("scene,seed,targets,policy,reason,claims,false_claims\n" + rows)
            make_page.take_over_reasons(folder, raw)
            row, = figures.read_table(folder / "reasons.csv")
            return row["runs"], row["claims"], row["false_claims"]

    def test_one_scene_alone_leaves_them(self):
        self.assertEqual(self.sums_after("doors"), (9, 90, 3))

    def test_all_scenes_replace_them(self):
        self.assertEqual(self.sums_after("doors", "hall"), (2, 10, 2))


if __name__ == "__main__":
    unittest.main()
