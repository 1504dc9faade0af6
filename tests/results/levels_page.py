"""The page about levels and situations, levels.md: what the default does there, and what builds before it did."""
import json

from claims import RIVALS, ceiling_claims, rarely_blind_claim, scene_claims, verdict
from figures import distinct, greatest, markdown, mean, number, of_shared_seeds, percent, read_table, select, total
from scene_tables import ceiling_part, delay

GROUPS = (("level-", "Levels of boxes"), ("tile-", "Levels composed of tiles"), ("", "Situations"))


def levels_page(folder, ceilings):
    """The page's text, from levels.csv and uses.csv in the folder, and how.json."""
    runs = read_table(folder / "levels.csv")
    how = json.loads((folder / "how.json").read_text(encoding="utf-8"))
    parts = [introduction(how)] + notes(folder)
    former = former_runs(folder, "levels")
    for prefix, title in GROUPS:
        parts += group_parts(title, of_group(runs, prefix), of_group(ceilings, prefix), of_group(former, prefix))
    study = folder / "scenes.csv"
    if study.exists():
        parts += all_scenes_part(read_table(study) + runs, ceilings)
    uses = folder / "uses.csv"
    if uses.exists():
        parts.append(uses_part(read_table(uses), runs, former))
    return "\n".join(parts)


def of_group(rows, prefix):
    """The rows of the scenes with this prefix; without one, those that have none of the others."""
    others = tuple(other for other, _ in GROUPS if other)
    return [row for row in rows if (row["scene"].startswith(prefix) if prefix else not row["scene"].startswith(others))]


def former_runs(folder, name):
    """The runs of the builds before the plan. They were kept from then, so `make.sh` does not make them."""
    former = folder / f"{name}-before-plan.csv"
    return read_table(former) if former.exists() else []


def notes(folder):
    """Findings about claims that do not hold: levels-notes.md beside the tables, where there is one."""
    kept = folder / "levels-notes.md"
    return [kept.read_text(encoding="utf-8")] if kept.exists() else []


def introduction(how):
    return f"""# Levels and situations

The scenes of the groups `levels`, `tiles` and `situations` were made to judge with. [Seeds](README.md#seeds) says what they were used for. They are played at
{how['rate_hz']} Hz with {how['level_seeds']}, and every {how['scenes_every']}th picture is judged. [scenes/README.md](../../scenes/README.md) says what each scene is, and
[the results page](README.md) what the figures mean. `tests/results/make.sh` makes both pages; `levels.csv` has one row a run.

*Before the plan* are builds whose routes no longer lead through walls, and which have no flight plan yet. In levels and situations the build is of 23 November
2026, and in the 19 scenes of the results page of 22 November. Their runs are kept in `levels-before-plan.csv` and `scenes-before-plan.csv`.
"""


def group_parts(title, runs, ceilings, former):
    """The parts about one group of scenes; none if it was not played."""
    if not runs:
        return []
    ceilings = [row for row in ceilings if row["scene"] in distinct(runs, "scene")]
    claims = [[claim.text, verdict(claim), claim.figure] for claim in [rarely_blind_claim(runs), *scene_claims(runs, ceilings, former)]]
    text = f"## {title}\n\n" + markdown(["<claim", "<verdict", "<figure"], claims) + """
*Joint*: share of the pictures in which every target is visible to 95 %, by policy. The other columns are about the default. *With a way*: the longest
time with nobody in sight during which the camera could have flown, from rest and within 2 s, to a place that sees a target.

""" + markdown(["<scene", *RIVALS, "sightline", "r_N", "blind s", "with a way s", "at a_max", "RMS jerk m/s³", "goal jumps /s", "reversals /s", "turn s", "collisions"],
               [scene_row(scene, select(runs, scene=scene)) for scene in distinct(runs, "scene")])
    return [text] + [part.replace("## What is possible", "### What is possible") for part in ceiling_part(ceilings, runs)]


def all_scenes_part(runs, ceilings):
    """The part about these scenes and those of the results page together; none without a ceiling."""
    if not ceilings:
        return []
    _, claim = ceiling_claims(runs, ceilings, "all scenes, those of the results page included")
    return ["## All scenes with a ceiling\n\n" + markdown(["<claim", "<verdict", "<figure"], [[claim.text, verdict(claim), claim.figure]])]


def scene_row(scene, runs):
    own = select(runs, policy="sightline")
    joints = [percent(mean(select(runs, policy=policy), "joint_visible_share"), 1) for policy in (*RIVALS, "sightline")]
    return [scene, *joints, percent(mean(own, "r_n")), number(greatest(own, "longest_blind_s"), 1),
            number(greatest(own, "longest_blind_with_way_s"), 1), percent(mean(own, "acceleration_limit_share"), 1),
            number(mean(own, "rms_jerk_mps3"), 0), number(mean(own, "goal_jumps_per_s"), 2),
            number(mean(own, "reversals_per_s"), 2), delay(own, "mean_turn_answer_s", "turns"), int(total(own, "body_collisions"))]


# ---- one use each ----

def uses_part(uses, runs, former):
    rows = [use_row(use, runs, former) for use in uses]
    return """## Uses that went wrong once

Each row was a complaint about an early build. It is now a scene of its own, played here, or a test, or both. *Before*: what that build did. Figures are means
over seeds; *blind* is the longest stretch of any seed without a visible pixel. The build before the plan played fewer seeds, so *same seeds* is the present build
with those alone, and *now* with all. What a test asserts or shows stands in words.

""" + markdown(["<use", "<expected", "<before", "<scene or test", "<before the plan", "<same seeds", "<now"], rows)


def use_row(use, runs, former):
    tests = (use["test"] or "").split("; ")
    places = [f"`{place}`" for place in (use["scene"], *tests) if place]
    own, before = (select(rows, scene=use["scene"], policy="sightline") for rows in (runs, former))
    before, same = of_shared_seeds(before, own)
    now = [text for text in (sights(own), use["now"]) if text]
    return [use["use"], use["expected"], use["before"], ", ".join(places), sights(before), sights(same), "; ".join(now)]


def sights(runs):
    if not runs:
        return ""
    return (f"joint {percent(mean(runs, 'joint_visible_share'), 1)}, nobody {percent(mean(runs, 'r_n'), 1)}, "
            f"blind {number(greatest(runs, 'longest_blind_s'), 1)} s")
