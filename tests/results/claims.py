"""The claims about the results. A claim is computed from the tables alone; no outcome is written down here."""
import collections
import math
import operator
import statistics

from figures import distinct, find, greatest, mean, number, of_shared_seeds, over_seeds, percent, select, standard_error, total, weighted_mean

# `holds` is None where the tables lack a figure that the claim needs.
Claim = collections.namedtuple("Claim", "text holds figure")

RIVALS = ("follow", "spring-arm", "raycast", "paper")
MISSING = "not measured"


def verdict(claim):
    return {True: "**holds**", False: "**does not hold**", None: "cannot be told"}[claim.holds]


def claim_if(text, needed, test, figure):
    """A claim about figures, any of which may be missing."""
    if any(value is None for value in needed):
        return Claim(text, None, MISSING)
    return Claim(text, bool(test(*needed)), figure(*needed))


# ---- table 1 ----

def step_claims(table1, costs=()):
    """By sampler. `costs`: the medians of a step before and with the plan, measured in turns."""
    claims = [claim_if(f"Default with {row['sampler']}: no step takes longer than three medians", [row["total_longest_ms"], row["total_p50_ms"]],
                       lambda longest, median: longest <= 3 * median,
                       lambda longest, median: f"{number(longest, 2)} ms, {number(longest / median, 1)} medians")
              for row in select(table1, settings="default")]
    return claims + [claim_if(f"Default with {row['sampler']}: a step takes no longer than before the plan, in turns", [row["before_ms"], row["with_plan_ms"]],
                              lambda before, now: now <= before, lambda before, now: f"{number(now, 2)} against {number(before, 2)} ms") for row in costs]


# ---- table 3 ----

def stability_claims(table3):
    claims = []
    for stability, d_c_times, d_s_times in (("3/5", 4, 1.4), ("6/10", 38, 17), ("8/15", 390, 17)):
        row = find(table3, stability=stability)
        for name, symbol, times in (("d_c_ratio", "d_c", d_c_times), ("d_s_ratio", "d_s", d_s_times)):
            claims.append(_ratio_claim(row, name, f"{stability}: {symbol} falls at least {times} times", times))
    return claims + _default_stability_claims(table3)


def _ratio_claim(row, name, text, times):
    ratio = row and row[name + "_median"]
    return claim_if(text, [ratio], lambda r: r >= times, lambda _: over_seeds(row, name, 2) + " times, median")


def _default_stability_claims(table3):
    default, filtered = find(table3, stability="sightline"), find(table3, stability="6/10")
    ratios = [row and row["d_c_ratio_median"] for row in (default, filtered)]
    reaction = default and default["mean_reaction_s"]
    return [
        claim_if("Default: d_c falls at least as much as with 6/10", ratios, lambda own, other: own >= other,
                 lambda own, other: f"{number(own, 2)} times against {number(other, 2)}, medians"),
        claim_if("Default: mean reaction to a sustained occlusion below 0.35 s", [reaction], lambda s: s < 0.35,
                 lambda s: f"{number(s, 3)} s over {int(default['occlusions'])} occlusions"),
    ]


# ---- table 2 ----

def model_claims(table2):
    basic = find(table2, model="Basic", prediction_ms=0.0)
    best = find(table2, model="RobustMove", prediction_ms=300.0)
    default = find(table2, model="sightline")
    share = lambda row, name: row and row[name + "_mean"]
    shares = lambda row, name: f"{percent(share(row, name))} in the mean; median {over_seeds(row, name, 2, 100)} %"
    claims = [
        claim_if("Basic: r_N at least 10 %, so that the hall is as hard as the paper's", [share(basic, "r_n")],
                 lambda r_n: r_n >= 0.10, lambda _: shares(basic, "r_n")),
        order_claim(table2),
    ]
    for name, row, most_r_p in (("RobustMove+Pred. 300", best, 0.0228), ("Default", default, 0.01)):
        claims.append(claim_if(f"{name}: r_N = 0.00 %", [share(row, "r_n")], rounds_to_zero, lambda _: shares(row, "r_n")))
        claims.append(claim_if(f"{name}: r_P at most {percent(most_r_p)}", [share(row, "r_p")],
                               lambda r_p: r_p <= most_r_p, lambda _: shares(row, "r_p")))
    for model in ("Basic", "RobustMove"):
        claims.append(_longer_is_worse(table2, model))
    claims.append(claim_if("Default: d_c no more than RobustMove+Pred. 300's",
                           [share(default, "d_c_m"), share(best, "d_c_m")], lambda own, other: own <= other,
                           lambda own, other: f"{number(own, 1)} m against {number(other, 1)} m, means"))
    return claims


def rounds_to_zero(share):
    return percent(share) == "0.00 %"


def order_claim(table2):
    """No two of the paper's rows are in the opposite order here; equal ones count as kept."""
    rows = [row for row in table2 if row["paper_r_n"] is not None]
    text = "The rows come in the paper's order by r_N"
    if not rows or any(row["r_n_mean"] is None for row in rows):
        return Claim(text, None, MISSING)
    rows.sort(key=lambda row: row["paper_r_n"])
    pairs = [(a, b) for i, a in enumerate(rows) for b in rows[i + 1:]]
    turned = sum(a["r_n_mean"] > b["r_n_mean"] for a, b in pairs)
    ours = sorted(rows, key=lambda row: row["r_n_mean"])
    order = ", ".join(f"{model_name(row)} {percent(row['r_n_mean'])}" for row in ours)
    return Claim(text, turned == 0, f"{turned} of {len(pairs)} pairs are the other way round; ours: {order}")


def model_name(row):
    ahead = row["prediction_ms"]
    return row["model"] + (f"+Pred. {int(ahead)}" if ahead else "")


def _longer_is_worse(table2, model):
    short, long = (find(table2, model=model, prediction_ms=ms) for ms in (300.0, 500.0))
    values = [row and row[name + "_mean"] for name in ("r_n", "r_p") for row in (short, long)]
    return claim_if(
        f"{model}: a prediction of 500 ms is worse than one of 300 ms", values,
        lambda n300, n500, p300, p500: n500 >= n300 and p500 >= p300 and (n500, p500) != (n300, p300),
        lambda n300, n500, p300, p500: f"r_N {percent(n300)} and {percent(n500)}, r_P {percent(p300)} and {percent(p500)}")


# ---- all scenes ----

def scene_claims(runs, ceilings=(), former=()):
    """`former`: runs of the default of the builds before the plan."""
    claims = []
    for rival in RIVALS:
        claims.append(_against(runs, rival, "joint_visible_share", "a higher joint visible share",
                               operator.gt, 1.0, percent))
        claims.append(_against(runs, rival, "episodes", "fewer episodes of lost sight", operator.lt, 0.0,
                               lambda n: number(n, 1)))
    for name, text in (("body_collisions", "no frame in which the body touches a collider"),
                       ("limit_violations", "no frame beyond the limits of speed, acceleration or turning")):
        claims.append(_none_of(runs, name, text))
    claims += _calm_claims(runs) + [_report_claim(runs)]
    if former:
        claims.append(_no_loss_claim(runs, former))
    return claims + (ceiling_claims(runs, ceilings) if ceilings else [])


def shot_claims(runs):
    """Of the runs that were judged by whole bodies and by the shot."""
    return [_against(runs, rival, name, text, operator.gt, 1.0, format_of) for rival in RIVALS
            for name, text, format_of in (("joint_whole_share", "everybody whole in more pictures", percent),
                                          ("mean_worth", "pictures of more worth", lambda worth: number(worth, 2)))] + _height_claims(runs)


# Scenes in which a camera near the asked height sees everybody.
OPEN_SCENES = ("hall", "city", "crowd-0", "crowd-10", "crowd-20")


def _height_claims(runs):
    own = {scene: select(_own(runs), scene=scene) for scene in OPEN_SCENES}
    away = {scene: abs(math.degrees(mean(rows, "median_height_rad") - mean(rows, "asked_height_rad"))) for scene, rows in own.items() if rows}
    if not away:
        return []
    worst = max(away, key=away.get)
    return [Claim(f"{', '.join(away)}: the median height is within 10 degrees of the asked one", away[worst] <= 10,
                  f"at most {number(away[worst], 1)} degrees away, in {worst}")]


def _calm_claims(runs):
    seconds, rate = lambda s: number(s, 1) + " s", lambda n: number(n, 2)
    return [
        _at_most(runs, "longest_blind_with_way_s", "never more than 1 s with nobody in sight while a free way exists", operator.le,
                 1.0, greatest, seconds),
        _at_most(runs, "tracking_while_lost", "status TRACKING with nobody in sight in under 0.5 % of the pictures", operator.lt,
                 0.005, mean, percent),
        _at_most(runs, "acceleration_limit_share", "under 20 % of the frames at the acceleration limit", operator.lt, 0.2, mean,
                 percent),
        _at_most(runs, "rms_jerk_mps3", "RMS jerk under 150 m/s³", operator.lt, 150.0, mean, lambda n: number(n, 0) + " m/s³"),
        _at_most(runs, "goal_jumps_per_s", "fewer than 2 jumps of the goal a second", operator.lt, 2.0, mean, rate),
    ]


def _no_loss_claim(runs, former):
    """A loss counts if it is greater than two standard errors of its mean over the seeds that both played."""
    failing, scenes = [], []
    for scene in distinct(former, "scene"):
        both = of_shared_seeds(select(_own(runs), scene=scene), select(former, scene=scene))
        own, before = ({row["seed"]: row["joint_visible_share"] for row in rows} for rows in both)
        losses = [before[seed] - own[seed] for seed in own]
        if not losses:
            continue
        scenes.append(scene)
        if statistics.mean(losses) > 2 * standard_error(losses) + 1e-6:
            failing.append(f"{scene} ({percent(statistics.mean(own.values()))} against {percent(statistics.mean(before.values()))})")
    return _in_scenes("Every scene: no lower joint visible share than before the plan, beyond two standard errors", scenes, failing)


def rarely_blind_claim(runs):
    return _at_most(runs, "r_n", "nobody in sight in under 0.5 % of the pictures", operator.lt, 0.005, mean, percent)


def ceiling_claims(runs, ceilings, scenes="the scenes"):
    """Two claims about the default's share of the ceiling: in every scene, and in the mean of `scenes`, where it counts for at most 1."""
    shares = {}
    for scene in distinct(ceilings, "scene"):
        both = of_shared_seeds(select(_own(runs), scene=scene), select(ceilings, scene=scene))
        own, reached = (mean(rows, "joint_visible_share") for rows in both)
        if own is not None and reached:
            shares[scene] = own / reached
    whole = sum(min(share, 1.0) for share in shares.values()) / len(shares) if shares else None
    return [
        _in_scenes("Every scene: at least 85 % of the ceiling's joint share", list(shares),
                   [f"{scene} ({percent(share, 1)})" for scene, share in shares.items() if share < 0.85]),
        claim_if(f"Mean of {scenes}: at least 90 % of the ceiling's joint share", [whole], lambda share: share >= 0.9,
                 lambda share: f"{percent(share, 1)} over {len(shares)} scenes"),
    ]


def _own(runs):
    return select(runs, policy="sightline")


def _in_scenes(text, scenes, failing, equal=()):
    """`failing`: a text for each scene where the claim fails; `equal`: one for each scene where neither is better."""
    if not scenes:
        return Claim(text, None, MISSING)
    figure = f"in {len(scenes) - len(failing) - len(equal)} of {len(scenes)} scenes"
    if failing:
        figure += "; not in " + ", ".join(failing)
    if equal:
        figure += "; equal in " + ", ".join(equal)
    return Claim(text, not failing and not equal, figure)


def _against(runs, rival, name, what, better, best, show):
    """Compares means over the seeds that both played. A tie counts as kept only where both are as good as possible."""
    failing, equal, scenes = [], [], []
    for scene in distinct(_own(runs), "scene"):
        both = of_shared_seeds(*(select(runs, scene=scene, policy=policy) for policy in ("sightline", rival)))
        own, other = (mean(rows, name) for rows in both)
        if own is None or other is None:
            continue
        scenes.append(scene)
        ties = math.isclose(own, other, abs_tol=1e-6)  # the tables are rounded
        if ties and other != best:
            equal.append(f"{scene} ({show(own)})")
        elif not ties and not better(own, other):
            failing.append(f"{scene} ({show(own)} against {show(other)})")
    return _in_scenes(f"Every scene: {what} than {rival}", scenes, failing, equal)


def _none_of(runs, name, text):
    scenes = distinct(_own(runs), "scene")
    counts = {scene: total(select(_own(runs), scene=scene), name) for scene in scenes}
    return _in_scenes(f"Every scene: {text}", scenes, [f"{scene} ({int(n)})" for scene, n in counts.items() if n])


def _at_most(runs, name, text, within, limit, over_seeds_of, show):
    """The default's figure of every scene is within a limit; `over_seeds_of` takes the mean or the greatest over seeds."""
    values = {scene: over_seeds_of(select(_own(runs), scene=scene), name) for scene in distinct(_own(runs), "scene")}
    values = {scene: value for scene, value in values.items() if value is not None}
    return _in_scenes(f"Every scene: {text}", list(values),
                      [f"{scene} ({show(value)})" for scene, value in values.items() if not within(value, limit)])


def _report_claim(runs):
    errors = {scene: weighted_mean(select(_own(runs), scene=scene), "filtered_share_error", "reported_pairs")
              for scene in distinct(_own(runs), "scene")}
    errors = {scene: error for scene, error in errors.items() if error is not None}
    return _in_scenes("Every scene: mean absolute error of the filtered share at most 0.05", list(errors),
                      [f"{scene} ({number(error, 3)})" for scene, error in errors.items() if error > 0.05])
