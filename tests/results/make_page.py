#!/usr/bin/env python3
"""Writes the results page, README.md, from the tables that lie beside it.

    make_page.py [FOLDER]                      # FOLDER: of the page; default: that of this script
    make_page.py [FOLDER] --paper DIR --scenes DIR --how KEY=VALUE ...

With --paper and --scenes, what `sightline evaluate` wrote there is first taken over into FOLDER: the paper's tables, those
figures of the runs that the page shows, the plots, and `how` it was done. See make.sh.
"""
import argparse
import json
import pathlib
import shutil

from claims import model_claims, model_name, scene_claims, stability_claims, verdict
from figures import (between, distinct, find, markdown, mean, number, over_seeds, percent, read_table, select, total,
                     weighted_mean, write_table)

PAPER_TABLES = ("table1.csv", "table2.csv", "table3.csv")
PAPER_PLOTS = ("table2-r_n.svg", "table3-offset.svg")
SCENE_PLOTS = ("bars-joint_visible_share.svg", "hall-s1-share.svg", "hall-s1-path.svg")
RUN_COLUMNS = ("scene", "seed", "targets", "policy", "pictures", "joint_visible_share", "all_seen", "r_n", "r_p",
               "r_p_tolerant", "mean_hidden_share", "episodes", "lasting_occlusions", "mean_reaction_s", "d_c_m",
               "d_s_heights", "rms_jerk_mps3", "body_collisions", "limit_violations", "pops", "reported_pairs",
               "reported_hidden_pairs", "false_visible", "false_occluded", "share_error", "filtered_false_visible",
               "filtered_false_occluded", "filtered_share_error")
HOW_KEYS = ("paper_command", "scenes_command", "rate_hz", "seeds", "paper_every", "scenes_every", "minutes", "cores")


def take_over(folder, paper, scenes, how):
    folder.mkdir(parents=True, exist_ok=True)
    for name in PAPER_TABLES:
        shutil.copyfile(paper / name, folder / name)
    write_table(folder / "scenes.csv", RUN_COLUMNS, read_table(scenes / "runs.csv"))
    plots = folder / "plots"
    plots.mkdir(exist_ok=True)
    for name in PAPER_PLOTS:
        shutil.copyfile(paper / "plots" / name, plots / name)
    for name in SCENE_PLOTS:
        shutil.copyfile(scenes / "plots" / name, plots / name)
    (folder / "how.json").write_text(json.dumps(how, indent=2) + "\n", encoding="utf-8")


def make_page(folder):
    """The page's text."""
    how = json.loads((folder / "how.json").read_text(encoding="utf-8"))
    table1, table2, table3 = (read_table(folder / name) for name in PAPER_TABLES)
    runs = read_table(folder / "scenes.csv")
    parts = [introduction(how, table1), claims_part(table2, table3, runs), notes_part(folder), table1_part(table1),
             table2_part(table2), table3_part(table3), scenes_part(runs), words_part(runs)]
    return "\n".join(parts)


def notes_part(folder):
    """What a person found out about claims that do not hold: notes.md beside the tables, where there is one."""
    notes = folder / "notes.md"
    return notes.read_text(encoding="utf-8") if notes.exists() else ""


# ---- how ----

def introduction(how, table1):
    egl = find(table1, sampler="egl")
    egl_words = f"also EGL: {egl['renderer']}" if egl else "no EGL context could be made"
    return f"""# Results

Made by `tests/results/make.sh` and never edited by hand; `tests/results/make_page.py` makes this page again from the tables in this
folder. It took {how['minutes']} minutes on {how['cores']} cores to run

    {how['paper_command']}
    {how['scenes_command']}

Each scene is played at {how['rate_hz']} Hz under {how['seeds']} seed(s), with Embree as the sampler (in Table 1 {egl_words}). Every
{how['paper_every']}th frame of Tables 2 and 3 and every {how['scenes_every']}th of the scenes is judged by re-rendering it at 512 x 512 with an id for each
body, which is what takes the time; motion, collisions and reactions are judged at every frame. What each figure means: `client/truth/metrics.h` and `client/truth/reaction.h`. *Sightline* is the default; *paper* is the method
as printed with RobustMove, a prediction of 300 ms and the filter 6/10. Tables: `table1.csv`, `table2.csv`, `table3.csv`, `scenes.csv` (a row a run).
All but times is the same on every run with the same seeds.
"""


# ---- claims ----

def claims_part(table2, table3, runs):
    text = "## Claims\n\nComputed from the tables in this folder.\n"
    for title, claims in (("Table 3: stability", stability_claims(table3)), ("Table 2: occlusion", model_claims(table2)),
                          ("All scenes", scene_claims(runs))):
        rows = [[claim.text, verdict(claim), claim.figure] for claim in claims]
        text += f"\n### {title}\n\n" + markdown(["<claim", "<verdict", "<figure"], rows)
    return text


# ---- table 1 ----

def table1_part(table1):
    text = """## Table 1: what a step costs

On the city, 280 K triangles, two targets, maps of r x r texels and about r³ candidates, alone on the machine. Milliseconds: the median, and in
brackets the 95th percentile. *Paper*: preset paper with Basic, without filter and prediction. Render, intersect and select are our sample,
aggregate and move. The paper's machine: Intel Core 2 T7600 at 2.33 GHz, NVidia FX 3500.
"""
    for sampler in distinct(table1, "sampler"):
        rows = select(table1, sampler=sampler)
        text += f"\n{sampler}: {rows[0]['renderer']}, {int(rows[0]['frames'])} frames a row\n\n"
        text += markdown(["<settings", "r", "candidates", "render", "intersect", "select", "total", "the paper: samples",
                          "render", "intersect", "select", "total"], [timing_row(row) for row in rows])
    return text


def timing_row(row):
    stage = lambda name: f"{number(row[name + '_p50_ms'], 3)} ({number(row[name + '_p95_ms'], 3)})"
    return [row["settings"], int(row["r"]), int(row["samples"])] + [
        stage(name) for name in ("sample", "aggregate", "move", "total")
    ] + [int(row["paper_samples"])] + [number(row[f"paper_{name}_ms"], 2) for name in ("render", "intersect", "select", "total")]


# ---- table 2 ----

def table2_part(table2):
    rows = [[model_name(row), percent(row["r_n_mean"]), over_seeds(row, "r_n", 2, 100), percent(row["paper_r_n"]),
             percent(row["r_p_mean"]), over_seeds(row, "r_p", 2, 100), percent(row["paper_r_p"]),
             percent(row["r_p_tolerant_mean"]), percent(row["mean_hidden_share_mean"]), over_seeds(row, "d_c_m", 1),
             over_seeds(row, "d_s_heights", 2), number(row["step_time_ms_mean"], 2)] for row in table2]
    return """## Table 2: strategies and predictions

In the hall. r_N: no pixel of any target is visible. r_P: not that, and at least one pixel of a target is hidden, or a target is outside
the picture. The first of each is over all frames of all seeds; then the median over seeds, with the least and the most. The paper's eight
rows have no filter over time; the others are for comparison. The step's time includes the scene's own movement, while other runs go on.

""" + markdown(["<model", "r_N", "over seeds, %", "paper's r_N", "r_P", "over seeds, %", "paper's r_P", "r_P, 5 % tolerance",
                "hidden pixels", "d_c m", "d_s heights", "step ms"], rows) + "\n" + image("table2-r_n.svg", "r_N by model")


# ---- table 3 ----

def table3_part(table3):
    rows = [[row["stability"], over_seeds(row, "t_c_ms", 2), number(row["paper_t_c_ms"], 2), over_seeds(row, "d_c_m", 2),
             over_seeds(row, "d_c_ratio", 2), paper_ratio(table3, row, "paper_d_c"), over_seeds(row, "d_s_heights", 2),
             over_seeds(row, "d_s_ratio", 2), paper_ratio(table3, row, "paper_d_s"),
             percent(row["mean_visible_share_median"], 1), percent(row["joint_visible_share_median"], 1),
             int(row["occlusions"]), number(row["mean_reaction_s"], 3), number(row["p95_reaction_s"], 3)]
            for row in table3]
    return """## Table 3: stability

On the fence: Basic without prediction under the paper's filters, and the default. Medians over seeds, with the least and the most; *falls*: by
how many times d_c and d_s are smaller than without a filter at the same seed. A camera that stands still falls the most, so what it saw
stands beside it, and how soon it answers to an occlusion that lasts: a board that comes before the targets and stays (scene
`fence-board`, all seeds together; the time until the camera leaves its course by 0.25 m/s or sees the target again).

""" + markdown(["<stability", "t_c ms", "paper's", "d_c m", "falls", "paper's", "d_s heights", "falls", "paper's", "visible share",
                "joint", "lasting occlusions", "mean reaction s", "p95 s"], rows) + "\n" + image(
                    "table3-offset.svg", "How far the camera strays, by stability")


def paper_ratio(table3, row, name):
    reference = table3[0][name]
    return number(reference / row[name], 1) if row[name] else ""


# ---- all scenes ----

def scenes_part(runs):
    rows = []
    for scene in distinct(runs, "scene"):
        for policy in distinct(runs, "policy"):
            of_both = select(runs, scene=scene, policy=policy)
            if of_both:
                rows.append(scene_row(scene, policy, of_both))
    return """## All scenes

Means over seeds; of the joint visible share the least and the most as well. *Joint*: pictures in which every target is visible to 95 %.
*All seen*: every target has a visible pixel. *Episodes*: times a run in which one target is wholly out of sight. Collisions, limit
violations and pops are frames, summed over seeds. *Reaction*: over all lasting occlusions, in brackets how many. Follow and the spring arm
keep no limits and touch or cross geometry, which is part of how they see what they see.

""" + markdown(["<scene", "<policy", "joint", "all seen", "episodes", "r_N", "r_P", "collisions", "violations", "pops", "d_c m",
                "jerk m/s³", "reaction s"], rows) + "\n" + image(
                    "bars-joint_visible_share.svg", "Joint visible share by scene and policy") + image(
                        "hall-s1-share.svg", "The hall: the visible share of the target seen least") + image(
                            "hall-s1-path.svg", "The hall from above: the ways of the cameras")


def scene_row(scene, policy, runs):
    joint = [run["joint_visible_share"] for run in runs]
    occlusions = int(total(runs, "lasting_occlusions"))
    reaction = weighted_mean(runs, "mean_reaction_s", "lasting_occlusions")
    counts = [int(total(runs, name)) for name in ("body_collisions", "limit_violations", "pops")]
    return [scene, policy, percent(mean(runs, "joint_visible_share"), 1) + between(min(joint), max(joint), 1, 100),
            percent(mean(runs, "all_seen"), 1), number(mean(runs, "episodes"), 1), percent(mean(runs, "r_n")),
            percent(mean(runs, "r_p"))] + counts + [number(mean(runs, "d_c_m"), 1), number(mean(runs, "rms_jerk_mps3"), 0),
            f"{number(reaction, 2)} ({occlusions})" if occlusions else ""]


# ---- its own word ----

def words_part(runs):
    own = select(runs, policy="sightline")
    rows = [word_row(scene, select(own, scene=scene)) for scene in distinct(own, "scene")]
    return """## The service's own word

What the default says of each target against the truth, over all judged pictures that hold a pixel of it: first of the frame, then of the
last steps, as the filter has them. *Error*: mean absolute, of the visible share. *False visible*: said to be visible (a share of one half at least) of
those truly not; *false occluded*: said not to be, of those truly visible.

""" + markdown(["<scene", "words", "truly hidden", "error", "false visible", "false occluded", "filtered: error",
                "false visible", "false occluded"], rows)


def word_row(scene, runs):
    for run in runs:
        run["word_visible_pairs"] = (run["reported_pairs"] or 0) - (run["reported_hidden_pairs"] or 0)
    cells = [scene, int(total(runs, "reported_pairs")), int(total(runs, "reported_hidden_pairs"))]
    for kind in ("", "filtered_"):
        cells += [number(weighted_mean(runs, kind + "share_error", "reported_pairs"), 3),
                  percent(weighted_mean(runs, kind + "false_visible", "reported_hidden_pairs"), 1),
                  percent(weighted_mean(runs, kind + "false_occluded", "word_visible_pairs"), 1)]
    return cells


def image(name, words):
    return f"![{words}](plots/{name})\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=pathlib.Path, default=pathlib.Path(__file__).resolve().parent)
    parser.add_argument("--paper", type=pathlib.Path)
    parser.add_argument("--scenes", type=pathlib.Path)
    parser.add_argument("--how", action="append", default=[], metavar="KEY=VALUE", help=", ".join(HOW_KEYS))
    options = parser.parse_args()
    if (options.paper is None) != (options.scenes is None):
        parser.error("--paper and --scenes go together")
    if options.paper:
        how = dict(pair.split("=", 1) for pair in options.how)
        if set(how) != set(HOW_KEYS):
            parser.error("--how must give " + ", ".join(HOW_KEYS))
        take_over(options.folder, options.paper, options.scenes, how)
    (options.folder / "README.md").write_text(make_page(options.folder), encoding="utf-8")


if __name__ == "__main__":
    main()
