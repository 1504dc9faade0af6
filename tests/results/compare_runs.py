#!/usr/bin/env python3
"""Compares two evaluations, before and after a change, scene by scene.

    compare_runs.py BEFORE AFTER [--policy NAME] [--after-policy NAME] [--scene NAME ...]

BEFORE and AFTER are the files runs.csv of `sightline evaluate`, or the folders that hold them. A run of AFTER is paired with the run of BEFORE that
has the same scene and seed; runs without a partner are left out. Each figure is shown as its mean over the paired seeds before and after,
and as the mean of the paired differences with the standard error of that mean (sample standard deviation / sqrt(n), from n = 2). A
difference is called better or worse where its 95 % confidence interval by Student's t leaves out 0. The last part pairs the runs of all
scenes alike.
"""
import argparse
import collections
import math
import pathlib
import statistics
import sys

from figures import distinct, read_table, select

# `factor` turns the column's unit into the one that is shown; `rising` says that more is better.
Figure = collections.namedtuple("Figure", "column title unit factor digits rising")
FIGURES = (
    Figure("mean_worth", "worth", "%", 100, 2, True),
    Figure("joint_whole_share", "everybody whole", "%", 100, 2, True),
    Figure("mean_sight_loss", "sight loss", "%", 100, 2, False),
    Figure("mean_shot_loss", "shot loss", "%", 100, 2, False),
    Figure("joint_visible_share", "joint share", "%", 100, 2, True),
    Figure("r_n", "r_N, nobody seen", "%", 100, 2, False),
    Figure("longest_blind_s", "longest blind stretch", "s", 1, 2, False),
    Figure("longest_blind_with_way_s", "  while a free way exists", "s", 1, 2, False),
    Figure("tracking_while_lost", "TRACKING while lost", "%", 100, 2, False),
    Figure("acceleration_limit_share", "at acceleration limit", "%", 100, 1, False),
    Figure("rms_jerk_mps3", "RMS jerk", "m/s3", 1, 0, False),
    Figure("goal_jumps_per_s", "goal jumps", "1/s", 1, 2, False),
    Figure("reversals_per_s", "reversals", "1/s", 1, 2, False),
    Figure("d_c_m", "path length", "m", 1, 1, False),
    Figure("body_collisions", "collisions", "frames", 1, 1, False),
    Figure("limit_violations", "limit violations", "frames", 1, 1, False),
)

# 97.5 % quantiles of Student's t for 1, 2, ... degrees of freedom; beyond them, the last one is a little too wide.
STUDENT = (12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14, 2.13)

# The means before and after, the mean difference and its standard error (None for a single pair), and the number of pairs.
Comparison = collections.namedtuple("Comparison", "before after difference error pairs")


def pairs_of(before, after):
    """(before, after) for each scene and seed that both have, in the order of AFTER."""
    partner = {(row["scene"], row["seed"]): row for row in before}
    return [(partner[key], row) for row in after if (key := (row["scene"], row["seed"])) in partner]


def compare(pairs, column):
    """None where no pair has the figure in both."""
    values = [(a[column], b[column]) for a, b in pairs if a.get(column) is not None and b.get(column) is not None]
    if not values:
        return None
    differences = [b - a for a, b in values]
    error = statistics.stdev(differences) / math.sqrt(len(values)) if len(values) > 1 else None
    before, after = (statistics.fmean(side) for side in zip(*values))
    return Comparison(before, after, statistics.fmean(differences), error, len(values))


def verdict(figure, result):
    if result.error is None or abs(result.difference) <= STUDENT[min(result.pairs - 1, len(STUDENT)) - 1] * result.error:
        return ""
    return "better" if (result.difference > 0) == figure.rising else "worse"


def line(figure, result):
    if result is None:
        return f"  {figure.title:26}      not in both"
    show = lambda value: f"{figure.factor * value:{10}.{figure.digits}f}"
    error = "" if result.error is None else f" ± {figure.factor * result.error:.{figure.digits}f}"
    change = f"{figure.factor * result.difference:+.{figure.digits}f}{error}"
    return f"  {figure.title:26}{show(result.before)}{show(result.after)} {figure.unit:7}{change:>18}  {verdict(figure, result)}".rstrip()


def part(title, pairs):
    head = f"{title} ({len(pairs)} run{'' if len(pairs) == 1 else 's'})"
    columns = f"{head:28}{'before':>10}{'after':>10} {'':7}{'difference':>18}"
    return [columns] + [line(figure, compare(pairs, figure.column)) for figure in FIGURES]


def report(pairs):
    """The whole text."""
    scenes = distinct([after for _, after in pairs], "scene")
    parts = [part(scene, [pair for pair in pairs if pair[1]["scene"] == scene]) for scene in scenes]
    if len(scenes) > 1:
        parts.append(part("all scenes", pairs))
    return "\n\n".join("\n".join(lines) for lines in parts) + "\n"


def runs_in(path, policy, scenes):
    rows = select(read_table(path / "runs.csv" if path.is_dir() else path), policy=policy)
    return [row for row in rows if not scenes or row["scene"] in scenes]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", type=pathlib.Path)
    parser.add_argument("after", type=pathlib.Path)
    parser.add_argument("--policy", default="sightline", help="the policy that is compared (default: sightline)")
    parser.add_argument("--after-policy", help="the policy in AFTER, where it has another name (default: that of --policy)")
    parser.add_argument("--scene", action="append", default=[], help="only this scene; may be repeated (default: all)")
    options = parser.parse_args()
    before = runs_in(options.before, options.policy, options.scene)
    after = runs_in(options.after, options.after_policy or options.policy, options.scene)
    pairs = pairs_of(before, after)
    if not pairs:
        sys.exit(f"compare_runs.py: no scene and seed is in both files ({len(before)} runs before, {len(after)} after)")
    print(report(pairs), end="")
    left_out = len(before) + len(after) - 2 * len(pairs)
    if left_out:
        print(f"\n{left_out} runs have no partner and are left out.")


if __name__ == "__main__":
    main()
