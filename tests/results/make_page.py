#!/usr/bin/env python3
"""Writes the results pages, README.md and levels.md, from the tables that lie beside them.

    make_page.py [FOLDER]                                   # FOLDER of the page; default: the folder of this script
    make_page.py [FOLDER] --raw DIR --how KEY=VALUE ...
    make_page.py [FOLDER] --renew DIR

With --raw, the page's tables and plots are first made anew from what make.sh measured: DIR/table1.csv by step_bench, and the folders
DIR/hall, DIR/hall-front, DIR/fence and DIR/agile, the same with -embree, DIR/scenes, DIR/keep-shot, DIR/roofs, DIR/named-shots, DIR/worth-ceiling,
DIR/subjects, DIR/motion, DIR/subjects-chase, DIR/subjects-shoulder, DIR/levels and DIR/ceiling by `sightline evaluate`. Any but
hall and fence may be missing; then the page keeps the tables that it has. HOW says how it was measured.
With --renew, the runs of DIR replace those of the same scenes, seeds and policies, as after `make.sh --own`.
"""
import argparse
import json
import math
import pathlib
import shutil

from claims import model_claims, model_name, scene_claims, shot_claims, stability_claims, step_claims, verdict
from figures import distinct, find, image, markdown, mean, number, over_seeds, percent, read_table, select, total, weighted_mean, write_table
from levels_page import former_runs, levels_page
from paper_tables import MODELS, STABILITIES, read_runs, table1, table2, table3
from scene_tables import ceiling_part, scenes_part
from shot_tables import SHOT_COLUMNS, SUBJECT_COLUMNS, TRADE_COLUMNS, TRADES, WORTH_CEILING_COLUMNS, more_shot_parts, shots_part, trade_part, worth_part
from svg_plots import bar_plot, strip_plot

PAPER_TABLES = ("table1.csv", "table2.csv", "table3.csv")
MORE_TABLES = ("table2-front.csv", "table3-agile.csv", "shots.csv", "worth.csv", "keep-shot.csv")
RUN_COLUMNS = ("scene", "seed", "targets", "policy", "pictures", "joint_visible_share", "all_seen", "r_n", "r_p",
               "r_p_tolerant", "mean_hidden_share", "episodes", "longest_blind_s", "longest_blind_with_way_s",
               "sustained_occlusions", "mean_reaction_s", "turns", "mean_turn_answer_s", "d_c_m", "d_s_heights",
               "acceleration_limit_share", "speed_limit_share", "rms_jerk_mps3", "p99_jerk_mps3", "reversals_per_s", "goal_jumps_per_s",
               "body_collisions", "limit_violations", "tracking_while_lost", "lost_called_tracking", "tracking_while_half_hidden",
               "reported_pairs", "reported_hidden_pairs", "false_visible", "false_occluded", "share_error", "filtered_false_visible",
               "filtered_false_occluded", "filtered_share_error")
# The ceiling's runs are fewer, and have a table of their own.
CEILING_COLUMNS = ("scene", "seed", "joint_visible_share", "most_joint", "body_collisions", "limit_violations")
LEVEL_COLUMNS = ("scene", "seed", "policy", "joint_visible_share", "all_seen", "r_n", "episodes", "longest_blind_s", "longest_blind_with_way_s",
                 "acceleration_limit_share", "speed_limit_share", "rms_jerk_mps3", "goal_jumps_per_s", "body_collisions", "limit_violations",
                 "tracking_while_lost", "reported_pairs", "filtered_share_error", "reversals_per_s", "turns", "mean_turn_answer_s")
HOW_KEYS = ("commands", "rate_hz", "seeds", "level_seeds", "paper_every", "scenes_every", "minutes", "cores")


def take_over(folder, raw, how):
    (folder / "plots").mkdir(parents=True, exist_ok=True)
    runs_of = lambda name: read_runs(raw / name) if (raw / name).exists() else []
    made = {"table2.csv": table2(runs_of("hall"), runs_of("hall-embree")), "table3.csv": table3(runs_of("fence"), runs_of("fence-embree"))}
    if (raw / "table1.csv").exists():
        made["table1.csv"] = table1(read_table(raw / "table1.csv"))
    if (raw / "hall-front").exists():
        made["table2-front.csv"] = table2(runs_of("hall-front"), runs_of("hall-front-embree"), "hall-front")
    if (raw / "agile").exists():
        made["table3-agile.csv"] = table3(runs_of("agile"), runs_of("agile-embree"), "fence-agile", "agile")
    for name, rows in made.items():
        write_table(folder / name, list(rows[0]), rows)
    plots = {"table2-r_n.svg": models_plot(runs_of("hall")), "table3-offset.svg": offsets_plot(read_table(raw / "fence" / "pictures.csv"))}
    if (raw / "agile").exists():
        plots["table3-agile-offset.svg"] = offsets_plot(read_table(raw / "agile" / "pictures.csv"), "fence-agile", "agile")
    shots = raw / ("shots" if (raw / "shots").exists() else "scenes")
    if shots.exists():
        write_table(folder / "shots.csv", SHOT_COLUMNS, read_table(shots / "runs.csv"))
    if (raw / "keep-shot").exists():
        write_table(folder / "keep-shot.csv", TRADE_COLUMNS, read_table(raw / "keep-shot" / "runs.csv"))
    for name, columns in (("roofs", SHOT_COLUMNS), ("named-shots", SHOT_COLUMNS), ("worth-ceiling", WORTH_CEILING_COLUMNS)):
        if (raw / name).exists():
            write_table(folder / (name + ".csv"), columns, read_table(raw / name / "runs.csv"))
    take_over_subjects(folder, raw)
    if (raw / "scenes").exists():
        runs = read_table(raw / "scenes" / "runs.csv")
        write_table(folder / "scenes.csv", RUN_COLUMNS, runs)
        plots["bars-joint_visible_share.svg"] = joint_plot(runs)
        plots["hall-s1-share.svg"] = shares_plot(read_table(raw / "scenes" / "pictures.csv"))
    if (raw / "ceiling").exists():
        write_table(folder / "ceiling.csv", CEILING_COLUMNS, select(read_table(raw / "ceiling" / "runs.csv"), policy="ceiling"))
    if (raw / "levels").exists():
        write_table(folder / "levels.csv", LEVEL_COLUMNS, read_table(raw / "levels" / "runs.csv"))
    take_over_reasons(folder, raw)
    take_over_sheets(folder, raw)
    for name, plot in plots.items():
        (folder / "plots" / name).write_text(plot, encoding="utf-8")
    (folder / "how.json").write_text(json.dumps(how, indent=2) + "\n", encoding="utf-8")


SUBJECT_FOLDERS = ("subjects", "motion", "subjects-chase", "subjects-shoulder")


def take_over_subjects(folder, raw):
    """The scenes of subjects and of recorded motion make one table."""
    if runs := [row for name in SUBJECT_FOLDERS if (raw / name).exists() for row in read_table(raw / name / "runs.csv")]:
        write_table(folder / "subjects.csv", SUBJECT_COLUMNS, runs)


# The scenes of the page's contact sheets, and what they show.
SHEETS = {"hall": "two walk round a colonnade", "rooms": "one follows the other through nine rooms", "crowd-20": "two cross a plaza among 20 others", "forest": "two on winding ways between trees",
          "roof-two-walk": "two walk under a roof", "roof-four": "four stand in a low room", "level-roofed-row": "one follows the other through rooms under a ceiling",
          "level-halls-crossing": "two in halls with pillars change sides", "street": "a car in a street", "pitch": "footballers", "doors": "two go through doors that shut behind them", "cycle": "six people, one of them the subject for 4 s at a time"}


def take_over_sheets(folder, raw):
    for scene in SHEETS:
        for policy in ("spring-arm", "sightline"):
            name = f"{scene}-1-{policy}.jpg"
            if (raw / "sheets" / "sheets" / name).exists():
                shutil.copyfile(raw / "sheets" / "sheets" / name, folder / "plots" / name)


def sheets_part(folder):
    """Eight pictures of each scene at its first seed, evenly over its time."""
    text = """## Pictures

Eight pictures of a run, evenly over its time, first of the spring arm and then of the default. Each target has a colour and an outline, and its hidden part is hatched. The numbers are the share of
each target's whole body that the picture shows.
"""
    shown = [scene for scene in SHEETS if (folder / "plots" / f"{scene}-1-sightline.jpg").exists()]
    for scene in shown:
        text += f"\n**{scene}**, seed 1: {SHEETS[scene]}\n\n" + image(f"{scene}-1-spring-arm.jpg", f"{scene}: the spring arm") + "\n" + image(f"{scene}-1-sightline.jpg", f"{scene}: the default")
    return [text] if shown else []


def take_over_reasons(folder, raw):
    """Sums of the default's claims over all runs. They are those of all scenes, so DIR must hold a run of each."""
    rows = [row for name in ("scenes", "levels", "tiles", "roofs") if (raw / name / "reasons.csv").exists()
            for row in select(read_table(raw / name / "reasons.csv"), policy="sightline")]
    sums = [{"reason": reason, "runs": len(of := select(rows, reason=reason)), "claims": sum(row["claims"] for row in of), "false_claims": sum(row["false_claims"] for row in of)}
            for reason in sorted(distinct(rows, "reason"))]
    shown = read_table(folder / "scenes.csv") if (folder / "scenes.csv").exists() else []
    if sums and {row["scene"] for row in rows} >= {row["scene"] for row in shown}:
        write_table(folder / "reasons.csv", list(sums[0]), sums)


# The tables whose rows are single runs: the folder below DIR, and its columns.
RUN_TABLES = (("scenes", "scenes", RUN_COLUMNS), ("shots", "scenes", SHOT_COLUMNS), ("levels", "levels", LEVEL_COLUMNS), ("levels", "tiles", LEVEL_COLUMNS), ("roofs", "roofs", SHOT_COLUMNS), *(("subjects", source, SUBJECT_COLUMNS) for source in SUBJECT_FOLDERS),
              ("keep-shot", "keep-shot", TRADE_COLUMNS), ("named-shots", "named-shots", SHOT_COLUMNS), ("worth-ceiling", "worth-ceiling", WORTH_CEILING_COLUMNS))


def renew(folder, raw):
    """Puts the runs of DIR in the place of those with the same scene, seed and policy, and beside those of other policies in the same scenes and seeds. All others stay."""
    key = lambda row: (row["scene"], row["seed"], row["policy"])
    newest = {}  # by scene and seed, of the default
    for name, source, columns in RUN_TABLES:
        path = folder / (name + ".csv")
        if not path.exists() or not (raw / source / "runs.csv").exists():
            continue
        new = {key(row): row for row in read_table(raw / source / "runs.csv")}
        newest |= {of[:2]: row for of, row in new.items() if of[2] == "sightline"}
        old = read_table(path)
        rows = {key(row): row for row in old} | {of: row for of, row in new.items() if of[:2] in {key(row)[:2] for row in old}}
        places = [distinct(old + list(rows.values()), name) for name in ("scene", "seed", "policy")]
        write_table(path, columns, sorted(rows.values(), key=lambda row: [place.index(value) for place, value in zip(places, key(row))]))
    if (folder / "worth.csv").exists():
        rows = read_table(folder / "worth.csv")
        write_table(folder / "worth.csv", list(rows[0]), [row if row["build"] != "now" else row | newest.get((row["scene"], row["seed"]), {}) for row in rows])
    take_over_reasons(folder, raw)
    take_over_sheets(folder, raw)
    if (raw / "scenes").exists():
        (folder / "plots" / "bars-joint_visible_share.svg").write_text(joint_plot(read_table(folder / "scenes.csv")), encoding="utf-8")
    if (raw / "hall-s1").exists():
        (folder / "plots" / "hall-s1-share.svg").write_text(shares_plot(read_table(raw / "hall-s1" / "pictures.csv")), encoding="utf-8")


# ---- plots ----

def models_plot(runs):
    shown = {model + (f"+Pred. {ms}" if ms else ""): mean(select(runs, policy=policy, scene="hall"), "r_n") for policy, model, ms, *_ in MODELS}
    return bar_plot("r_N: share of pictures with no target visible", {"hall": {name: value for name, value in shown.items() if value is not None}})


def joint_plot(runs):
    groups = {scene: {policy: mean(select(runs, scene=scene, policy=policy), "joint_visible_share") for policy in distinct(runs, "policy")}
              for scene in distinct(runs, "scene")}
    return bar_plot("Share of pictures with all targets visible to 95 %", groups)


def offsets_plot(pictures, scene="fence", prefix="stability"):
    strips = {}
    for policy, stability, *_ in STABILITIES:
        rows = select(pictures, scene=scene, seed=1.0, policy=policy.replace("stability", prefix))
        places = [tuple(row[f"camera_{axis}_m"] for axis in "xyz") for row in rows]
        offsets = [(row["time_s"], math.dist(place, places[0])) for row, place in zip(rows, places)]
        strips[stability] = (f"at most {max(value for _, value in offsets):.3g} m", offsets)
    return strip_plot(scene + ", seed 1: distance of the camera from its start", "m", strips)


def shares_plot(pictures):
    strips = {}
    for policy in distinct(pictures, "policy"):
        rows = select(pictures, scene="hall", seed=1.0, policy=policy)
        whole = sum(row["least_whole_share"] >= 0.95 for row in rows) / len(rows)
        strips[policy] = (percent(whole, 1) + " whole", [(row["time_s"], row["least_whole_share"]) for row in rows])
    return strip_plot("hall, seed 1: share of its whole body of the target that is shown least", "", strips)


# ---- the page ----

def make_page(folder):
    """The page's text."""
    how = json.loads((folder / "how.json").read_text(encoding="utf-8"))
    times, models, stabilities = (read_table(folder / name) for name in PAPER_TABLES)
    runs = read_table(folder / "scenes.csv")
    ceilings = [row for row in measured_ceilings(folder) if row["scene"] in distinct(runs, "scene")]
    front, agile, shots, worths, trades = (read_table(folder / name) if (folder / name).exists() else [] for name in MORE_TABLES)
    parts = [introduction(how, times), claims_part(times, models, stabilities, shot_claims(shots), scene_claims(runs, ceilings, former_runs(folder, "scenes")), former_costs(folder)), notes_part(folder), *sheets_part(folder), table1_part(times),
             table2_part(models, front), table3_part(stabilities, agile), shots_part(shots), trade_part(trades), worth_part(worths), *more_shot_parts(folder), scenes_part(runs), *ceiling_part(ceilings, runs), reports_part(runs), *reasons_part(folder)]
    return "\n".join(parts)


def measured_ceilings(folder):
    return read_table(folder / "ceiling.csv") if (folder / "ceiling.csv").exists() else []


def former_costs(folder):
    return read_table(folder / "cost-before-plan.csv") if (folder / "cost-before-plan.csv").exists() else []


def notes_part(folder):
    """Findings about claims that do not hold: notes.md beside the tables, where there is one."""
    notes = folder / "notes.md"
    return notes.read_text(encoding="utf-8") if notes.exists() else ""


# ---- how ----

def introduction(how, times):
    egl = find(times, sampler="egl")
    egl_words = f"Table 1 also has EGL ({egl['renderer']})" if egl else "No EGL context could be made for Table 1"
    commands = "\n".join("    " + command.strip() for command in how["commands"].splitlines())
    return f"""# Results

`tests/results/make.sh` makes this page: do not edit it by hand. `tests/results/make_page.py` writes it again from the tables in this
folder. The measurements took {how['minutes']} minutes on {how['cores']} cores:

{commands}

Each scene is played at {how['rate_hz']} Hz with {how['seeds']}. EGL takes the maps of Tables 2 and 3, and Embree those of the scenes. {egl_words}. A judged picture is rendered again
at 512 x 512 with an id for each body. Every {how['paper_every']}th frame of Tables 2 and 3 is judged, and every {how['scenes_every']}th of the scenes. Motion,
collisions and reactions are judged at every frame. The headers in `client/truth` define the figures. *sightline* is the
default; *paper* is the method as printed, with RobustMove, a prediction of 300 ms and the filter 6/10. The tables are `table1.csv`, `table2.csv`,
`table3.csv` and `scenes.csv` (one row a run). On machines of one kind, everything but times is the same
on every run with the same seeds. [Machines of another kind](../replay/README.md) round differently, so a few runs may differ there.

[Levels and situations](levels.md) shows the default in other scenes.

### Seeds

Seeds 1 to 8 are for judging, and seeds from 101 on are for tuning. A change was tuned with those, and then judged. The judgement decided whether it was kept,
so a few were dropped after it; [trials](trials.md) has both. At first, the first seeds of the 19 scenes on this page served for tuning too.
"""


# ---- claims ----

def claims_part(times, models, stabilities, of_shots, of_scenes, former_costs):
    text = "## Claims\n\nComputed from the tables in this folder.\n"
    for title, claims in (("Whole bodies and the shot", of_shots), ("Table 3: stability", stability_claims(stabilities)),
                          ("Table 2: occlusion", model_claims(models)),
                          ("Table 1: what a step costs", step_claims(times, former_costs)), ("All scenes", of_scenes)):
        rows = [[claim.text, verdict(claim), claim.figure] for claim in claims]
        text += f"\n### {title}\n\n" + markdown(["<claim", "<verdict", "<figure"], rows)
    return text


# ---- table 1 ----

def table1_part(times):
    text = """## Table 1: what a step costs

The city has 280 K triangles and two targets; maps have r x r texels, and there are about r³ candidates; of pair volumes at most r³. Nothing else ran. Times are medians in
milliseconds, with the 95th percentile in brackets. *Longest* is the longest step, with the number of medians that it takes in brackets. Each step
was taken three times for it, and the shortest time counts, because the machine interrupts a step now and then. *paper* is the preset paper with Basic,
without filter and prediction. *sightline* is the default with about r³ candidates, and *default* the default as it is. Render, intersect and select
are our sample, aggregate and move. The paper's machine was an Intel Core 2 T7600 at 2.33 GHz with an NVidia FX 3500.
"""
    for sampler in distinct(times, "sampler"):
        rows = select(times, sampler=sampler)
        text += f"\n{sampler}: {rows[0]['renderer']}, {int(rows[0]['frames'])} frames a row\n\n"
        text += markdown(["<settings", "r", "candidates", "render", "intersect", "select", "total", "longest", "the paper: samples",
                          "render", "intersect", "select", "total"], [timing_row(row) for row in rows])
    return text


def timing_row(row):
    stage = lambda name: f"{number(row[name + '_p50_ms'], 3)} ({number(row[name + '_p95_ms'], 3)})"
    return [row["settings"], int(row["r"]), int(row["samples"])] + [
        stage(name) for name in ("sample", "aggregate", "move", "total")
    ] + [longest_step(row), int(row["paper_samples"])] + [number(row[f"paper_{name}_ms"], 2) for name in ("render", "intersect", "select", "total")]


def longest_step(row):
    return f"{number(row['total_longest_ms'], 3)} ({number(row['total_longest_ms'] / row['total_p50_ms'], 1)})"


# ---- table 2 ----

def table2_part(models, front):
    text = """## Table 2: strategies and predictions

The scene is the hall: two targets walk beside each other, and the camera is behind them. r_N: no pixel of any target is visible. r_P: some pixel is
visible, but a target is partly hidden or outside the picture. The first figure of each is over all frames of all seeds; then follows the median over
seeds with the least and the greatest value. The paper's eight rows have no filter over time; the others are for comparison. *RobustMove* goes to the
member of the largest group that is farthest from hidden places, *RobustMove, centre* to the group's centre, as printed. *Pair volume*: share of the
steps whose candidates are those of a pair volume. *Shot kept*: share of the frames in which side, height, size and place each deviate from the first
frame's by at most 0.5, where 1 is the limit; *deviation* is the mean over all four. The step's time includes the scene's own movement and was taken
while other runs went on.

""" + table2_rows(models) + "\n" + image("table2-r_n.svg", "r_N by model")
    if front:
        text += """
The same hall seen from before the targets (`hall-front`):

""" + table2_rows(front)
    return text


def table2_rows(models):
    rows = [[model_name(row), percent(row["r_n_mean"]), over_seeds(row, "r_n", 2, 100), percent(row["paper_r_n"]), percent(row.get("embree_r_n_mean")),
             percent(row["r_p_mean"]), over_seeds(row, "r_p", 2, 100), percent(row["paper_r_p"]),
             percent(row["r_p_tolerant_mean"]), percent(row["mean_hidden_share_mean"]), percent(row.get("pair_volume_share"), 1)] + kept(row) +
            [over_seeds(row, "d_c_m", 1), over_seeds(row, "d_s_heights", 2), number(row["step_time_ms_mean"], 2)] for row in models]
    return markdown(["<model", "r_N", "over seeds, %", "paper's r_N", "r_N, Embree", "r_P", "over seeds, %", "paper's r_P", "r_P, 5 % tolerance",
                     "hidden pixels", "pair volume", "shot kept", "deviation", "acceleration m/s²", "d_c m", "d_s heights", "step ms"], rows)


def kept(row):
    return [percent(row.get("shot_kept_share"), 1), number(row.get("shot_deviation"), 3), number(row.get("mean_acceleration_mps2"), 2)]


# ---- table 3 ----

def table3_part(stabilities, agile):
    text = """## Table 3: stability

The scene is the fence. The rows are Basic without prediction under the paper's filters, and the default. Figures are medians over seeds with the
least and the greatest value. The columns *falls* say by how many times d_c and d_s are smaller than without a filter at the same seed. A camera
that never moves has the greatest fall. The table therefore also shows what the camera saw and how soon it reacts to a sustained occlusion. In the
scene `fence-board`, a board comes up before the targets and stays. The reaction is the time until the camera's velocity changes by 0.25 m/s or until it
sees the target again; all seeds count together.

""" + table3_rows(stabilities, True) + "\n" + image("table3-offset.svg", "Distance of the camera from its start, by stability")
    if agile:
        text += """
A camera that accelerates by 10 m/s² has hardly begun to move when a picket has passed, so it moves by decimetres. In the paper the camera may be anywhere
in the bound at the next frame. In the scene `fence-agile` it may accelerate by 1,000 m/s², and the pickets are 7 cm wide instead of 4. The bound is as
large as before (`bound.paper_n` is 3 instead of 300).

""" + table3_rows(agile, False) + "\n" + image("table3-agile-offset.svg", "Distance of the camera without inertia from its start, by stability")
    return text


def table3_rows(stabilities, with_reactions):
    rows = [[row["stability"], over_seeds(row, "t_c_ms", 2), number(row["paper_t_c_ms"], 2), over_seeds(row, "d_c_m", 2),
             over_seeds(row, "d_c_ratio", 2), paper_ratio(stabilities, row, "paper_d_c"), number(row.get("embree_d_c_m_mean"), 2), over_seeds(row, "d_s_heights", 2),
             over_seeds(row, "d_s_ratio", 2), paper_ratio(stabilities, row, "paper_d_s"), percent(row.get("pair_volume_share"), 1)] + kept(row) +
            [percent(row["mean_visible_share_median"], 1), percent(row["joint_visible_share_median"], 1)] +
            ([int(row["occlusions"]), number(row["mean_reaction_s"], 3), number(row["p95_reaction_s"], 3)] if with_reactions else [])
            for row in stabilities]
    columns = ["<stability", "t_c ms", "paper's", "d_c m", "falls", "paper's", "d_c m, Embree, mean", "d_s heights", "falls", "paper's", "pair volume", "shot kept",
               "deviation", "acceleration m/s²", "visible share", "joint"]
    return markdown(columns + (["sustained occlusions", "mean reaction s", "p95 s"] if with_reactions else []), rows)


def paper_ratio(stabilities, row, name):
    reference = stabilities[0][name]
    return number(reference / row[name], 1) if row[name] else ""


# ---- what the service reports ----

def reports_part(runs):
    own = select(runs, policy="sightline")
    rows = [report_row(scene, select(own, scene=scene)) for scene in distinct(own, "scene")]
    return """## What the service reports

The visible share that the default reports of each target, against the truth, over all judged pictures that hold a pixel of the target. The
first columns are of the share in one step, the next ones of the share that is filtered over the last steps. *Error*: mean absolute error of the share.
A target counts as visible from a share of one half. *False visible*: part of the truly hidden targets that were reported visible. *False occluded*:
part of the truly visible ones that were reported hidden. The last columns are of the status, over all judged pictures. *TRACKING, lost*: share of the
pictures that have this status and no visible pixel of any target. *Lost, TRACKING*: share of the pictures without a visible pixel that have this
status. *TRACKING, half hidden*: share of the pictures that have this status although less than half of a required target is visible.

""" + markdown(["<scene", "reports", "truly hidden", "error", "false visible", "false occluded", "filtered: error",
                "false visible", "false occluded", "TRACKING, lost", "lost, TRACKING", "TRACKING, half hidden"], rows)


# What each claim says, in the order of the page.
CLAIMS = {"at_desired_place": "all targets are visible from where the camera goes, which keeps the shot", "other_shot": "all are, from another side than the asked one",
          "best_all_visible": "all are, in another shot", "nearest_view": "some target is", "best_partial": "no position in reach is known to see all targets", "horizon_grown": "none is known to see any",
          "on_trail": "none is known to see any", "obstruction_expected": "a target will be hidden from the place of the shot in so many seconds",
          "obstruction_not_expected": "nothing, and a target was hidden from there for 0.2 s and more"}


def reasons_part(folder):
    if not (folder / "reasons.csv").exists():
        return []
    counts = {row["reason"]: row for row in read_table(folder / "reasons.csv")}
    rows = [[claim, words, int(counts[claim]["claims"]), int(counts[claim]["false_claims"]), percent(counts[claim]["false_claims"] / counts[claim]["claims"], 2)]
            for claim, words in CLAIMS.items() if claim in counts]
    return ["""## Are the reasons true?

What the default's reasons say of places, against 32 rays to each target in the true scene, in runs of the scenes, levels and roofs (`reasons.csv`). A place that is
said to see a target is false if no ray is free. "No position in reach" is false if half of the rays are free from one: to every target, or to any. An expected obstruction is false if the ray from
there to the target's middle is not blocked within 0.2 s of the time that was told. It was not expected if no reply had named the target and this time, to within 0.2 s, at least 0.2 s before.

""" + markdown(["<claim", "<it says", "claims", "false", "share"], rows)]


def report_row(scene, runs):
    for run in runs:
        run["reported_visible_pairs"] = (run["reported_pairs"] or 0) - (run["reported_hidden_pairs"] or 0)
        run["lost_pictures"] = run["r_n"] * run["pictures"]
    cells = [scene, int(total(runs, "reported_pairs")), int(total(runs, "reported_hidden_pairs"))]
    for kind in ("", "filtered_"):
        cells += [number(weighted_mean(runs, kind + "share_error", "reported_pairs"), 3),
                  percent(weighted_mean(runs, kind + "false_visible", "reported_hidden_pairs"), 1),
                  percent(weighted_mean(runs, kind + "false_occluded", "reported_visible_pairs"), 1)]
    return cells + [percent(mean(runs, "tracking_while_lost")), percent(weighted_mean(runs, "lost_called_tracking", "lost_pictures"), 1),
                    percent(mean(runs, "tracking_while_half_hidden"))]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=pathlib.Path, default=pathlib.Path(__file__).resolve().parent)
    parser.add_argument("--raw", type=pathlib.Path)
    parser.add_argument("--renew", type=pathlib.Path)
    parser.add_argument("--how", action="append", default=[], metavar="KEY=VALUE", help=", ".join(HOW_KEYS))
    options = parser.parse_args()
    if options.raw:
        how = dict(pair.split("=", 1) for pair in options.how)
        if set(how) != set(HOW_KEYS):
            parser.error("--how must give " + ", ".join(HOW_KEYS))
        take_over(options.folder, options.raw, how)
    if options.renew:
        renew(options.folder, options.renew)
    (options.folder / "README.md").write_text(make_page(options.folder), encoding="utf-8")
    if (options.folder / "levels.csv").exists():
        (options.folder / "levels.md").write_text(levels_page(options.folder, measured_ceilings(options.folder)), encoding="utf-8")


if __name__ == "__main__":
    main()
