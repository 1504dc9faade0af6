"""The paper's Tables 1 to 3 beside the figures that the paper prints: from what step_bench and `sightline evaluate` wrote."""
import math
import statistics

from figures import find, mean, read_table, select, total

# Table 1 as printed: by r; milliseconds.
PAPER_TIMES = {5: (75, 0.70, 0.91, 0.16, 1.77), 7: (343, 0.80, 2.10, 0.72, 3.62), 10: (1000, 0.80, 5.20, 1.81, 7.83),
               15: (3375, 1.00, 19.30, 4.28, 24.63)}
PAPER_TIME_NAMES = ("paper_samples", "paper_render_ms", "paper_intersect_ms", "paper_select_ms", "paper_total_ms")
# Table 2: policy, model, prediction in ms, and the paper's r_N and r_P. The policies are those of paper_settings.txt and built-in ones.
MODELS = (("basic", "Basic", 0, 0.1232, 0.0841), ("robust", "RobustMove", 0, 0.0747, 0.0712),
          ("basic-100", "Basic", 100, 0.0332, 0.0940), ("basic-300", "Basic", 300, 0.0112, 0.0633),
          ("basic-500", "Basic", 500, 0.0502, 0.0971), ("robust-100", "RobustMove", 100, 0.0059, 0.0308),
          ("robust-300", "RobustMove", 300, 0.0, 0.0228), ("robust-500", "RobustMove", 500, 0.0141, 0.0589),
          ("center", "RobustMove, centre", 0, None, None), ("center-100", "RobustMove, centre", 100, None, None),
          ("center-300", "RobustMove, centre", 300, None, None), ("center-500", "RobustMove, centre", 500, None, None),
          ("sightline", "sightline", None, None, None), ("follow", "follow", None, None, None),
          ("spring-arm", "spring-arm", None, None, None), ("raycast", "raycast", None, None, None))
# Table 3: policy, stability, and the paper's t_c in ms, d_c and d_s in its own units, which it does not name. The first row is
# without a filter: the others are compared with it.
STABILITIES = (("stability-0-0", "0/0", 2.69, 157.0, 1.7), ("stability-3-5", "3/5", 2.75, 38.4, 1.2),
               ("stability-6-10", "6/10", 2.87, 4.1, 0.1), ("stability-8-15", "8/15", 2.91, 0.4, 0.1),
               ("sightline", "sightline", None, None, None))


def read_runs(folder):
    """The rows of runs.csv, each with the step_ms of timing.csv."""
    timing = {(row["scene"], row["seed"], row["policy"]): row["step_ms"] for row in read_table(folder / "timing.csv")}
    runs = read_table(folder / "runs.csv")
    for run in runs:
        run["step_ms"] = timing[run["scene"], run["seed"], run["policy"]]
    return runs


def spread(name, values):
    """The columns of one figure over seeds; all None without values."""
    parts = (statistics.fmean, statistics.median, min, max) if values else (lambda _: None,) * 4
    return {f"{name}_{part}": of(values) for part, of in zip(("mean", "median", "least", "most"), parts)}


def table1(rows):
    """`rows`: of step_bench --csv."""
    return [row | dict(zip(PAPER_TIME_NAMES, PAPER_TIMES[int(row["r"])])) for row in rows]


def table2(runs, embree_runs=(), scene="hall"):
    """`embree_runs`: the same runs with the other sampler."""
    rows = []
    for policy, model, prediction_ms, paper_r_n, paper_r_p in MODELS:
        own = select(runs, policy=policy, scene=scene)
        row = {"model": model, "prediction_ms": prediction_ms, "runs": len(own), "pictures": int(total(own, "pictures"))}
        for name in ("r_n", "r_p", "r_p_tolerant", "mean_hidden_share", "joint_visible_share", "d_c_m", "d_s_heights"):
            row |= spread(name, [run[name] for run in own])
        row |= spread("step_time_ms", [run["step_ms"] for run in own])
        row |= coherence(own) | {"embree_r_n_mean": mean(select(embree_runs, policy=policy, scene=scene), "r_n")}
        rows.append(row | {"paper_r_n": paper_r_n, "paper_r_p": paper_r_p})
    return rows


def coherence(runs):
    """How the shot was kept (paper 6.2), and the share of the steps with the candidates of pair volumes."""
    return {name: mean(runs, name) for name in ("pair_volume_share", "shot_kept_share", "shot_deviation", "mean_acceleration_mps2")}


def table3(runs, embree_runs=(), scene="fence", prefix="stability"):
    """`runs`: in the scenes `scene` and fence-board. Reactions are of fence-board, all seeds together. `prefix`: of the policies."""
    stabilities = [(policy.replace("stability", prefix), *rest) for policy, *rest in STABILITIES]
    rows, unfiltered = [], select(runs, policy=stabilities[0][0], scene=scene)
    for policy, stability, *paper in stabilities:
        own = select(runs, policy=policy, scene=scene)
        row = {"stability": stability, "runs": len(own)} | spread("t_c_ms", [run["step_ms"] for run in own])
        for name in ("d_c_m", "d_s_heights", "mean_visible_share", "joint_visible_share"):
            row |= spread(name, [run[name] for run in own])
        for ratio, name in (("d_c_ratio", "d_c_m"), ("d_s_ratio", "d_s_heights")):
            row |= spread(ratio, [times_less(find(unfiltered, seed=run["seed"])[name], run[name]) for run in own])
        row |= reactions(select(runs, policy=policy, scene="fence-board"))
        row |= coherence(own) | {"embree_d_c_m_mean": mean(select(embree_runs, policy=policy, scene=scene), "d_c_m")}
        rows.append(row | dict(zip(("paper_t_c_ms", "paper_d_c", "paper_d_s"), paper)))
    return rows


def times_less(reference, value):
    """How many times less; two that both stand still are equal."""
    if value > 0:
        return reference / value
    return math.inf if reference > 0 else 1.0


def reactions(runs):
    # One delay is a cell that reads as a number.
    delays = sorted(float(delay) for run in runs for delay in str(run["reaction_delays_s"] or "").split())
    regain = sum(run["mean_regain_s"] * run["sustained_occlusions"] for run in runs)
    row = {"occlusions": len(delays), "unanswered": int(total(runs, "unanswered_occlusions"))}
    if not delays:
        return row | {"mean_reaction_s": None, "p95_reaction_s": None, "mean_regain_s": None}
    nearest_rank = delays[math.ceil(0.95 * len(delays)) - 1]
    return row | {"mean_reaction_s": statistics.fmean(delays), "p95_reaction_s": nearest_rank, "mean_regain_s": regain / len(delays)}
