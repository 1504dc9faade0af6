"""Tables of whole bodies and of the shot that was asked for."""
import math

from figures import distinct, image, markdown, mean, number, percent, read_table, select

SHOT_COLUMNS = ("scene", "seed", "policy", "joint_visible_share", "joint_whole_share", "mean_whole_share", "p95_size_pictures", "asked_height_rad",
                "median_height_rad", "high_share", "shot_kept_share", "shot_deviation_side", "shot_deviation_height", "shot_deviation_size",
                "shot_deviation_place", "shot_deviation", "mean_acceleration_mps2", "mean_worth", "mean_sight_loss", "mean_shot_loss", "as_asked_share", "r_n")
TRADE_COLUMNS = ("scene", "seed", "policy", "joint_whole_share", "joint_visible_share", "shot_kept_share", "as_asked_share", "mean_sight_loss", "mean_shot_loss",
                 "mean_worth", "median_height_rad", "r_n")
# keep_shot by policy.
TRADES = {"keep-0": "0", "keep-025": "0.25", "keep-05": "0.5", "sightline": "1", "keep-2": "2"}
CHANGE_COLUMNS = ("target_changes", "mean_change_answer_s", "longest_change_answer_s", "unanswered_changes", "longest_blind_s", "body_collisions")
SUBJECT_COLUMNS = SHOT_COLUMNS + CHANGE_COLUMNS
WORTH_CEILING_COLUMNS = ("scene", "seed", "policy", "mean_worth", "most_worth", "mean_sight_loss", "mean_shot_loss", "joint_whole_share")


def shots_part(runs):
    if not runs:
        return ""
    groups = [(scene, policy, select(runs, scene=scene, policy=policy)) for scene in distinct(runs, "scene") for policy in distinct(runs, "policy")]
    return f"""## Whole bodies, and the shot that was asked for

*Joint* judges the part of a target inside the picture, as the tables below do. *Whole* counts only the pictures in which at least 95 % of every target's outline is inside as well.
A camera that is so near that it shows two pairs of legs has a high joint share, and shows nobody whole. *Size* is the height of the largest target in picture heights, the 95th
percentile over pictures. From 1 on the target is cut off. *Height* is the camera's elevation over the targets in degrees, in the first frame and in the median. *Above 60°* is the share
of the frames. *Shot kept* and *deviation* are those of Table 2. The deviations of side, height, size and place follow. *Acceleration* is the mean size, the paper's sum over the
time (6.2). *Worth* is what a picture is worth, from 0 to 1 (`server/move/picture_worth.h`): 1 less the sight that it lacks, of whole bodies, and less what it departs from the shot.
*As asked* is the share of the pictures that show everybody whole with every property within its free band. Means over {len(distinct(runs, "seed"))} seeds.

""" + markdown(["<scene", "<policy", "worth", "as asked", "whole", "joint", "size", "asked height", "height", "above 60°", "shot kept", "deviation", "side", "height", "size", "place",
                "acceleration m/s²"], [shot_row(*group) for group in groups if group[2]])


def shot_row(scene, policy, runs):
    degrees = lambda name: number(math.degrees(mean(runs, name)), 0)
    size = mean(runs, "p95_size_pictures")
    return [scene, policy, number(mean(runs, "mean_worth"), 2), percent(mean(runs, "as_asked_share"), 0), percent(mean(runs, "joint_whole_share"), 1), percent(mean(runs, "joint_visible_share"), 1), "over 10" if size > 10 else number(size, 2),
            degrees("asked_height_rad"), degrees("median_height_rad"), percent(mean(runs, "high_share"), 0), percent(mean(runs, "shot_kept_share"), 0)] + [
                number(mean(runs, "shot_deviation" + part), 2) for part in ("", "_side", "_height", "_size", "_place")] + [number(mean(runs, "mean_acceleration_mps2"), 2)]


def worth_part(runs):
    """`runs`: the default of today and that of the build before the shot counted, on the same scenes and seeds."""
    if not runs:
        return ""
    scenes = distinct(runs, "scene")
    pairs = {scene: [select(runs, scene=scene, build=build) for build in ("before", "now")] for scene in scenes}
    gains = [mean(now, "mean_worth") - mean(before, "mean_worth") for before, now in pairs.values()]
    worst = min(scenes, key=lambda scene: gains[scenes.index(scene)])
    fell = f"It fell most in {worst}, by {number(-min(gains), 2)}." if min(gains) < -0.005 else "It fell in none of them."
    return f"""## What changed when the shot began to count

The default before it counted whole bodies and the asked shot, and the default now, on the same scenes and seeds (`worth.csv`: one or two of each scene). *Nobody* is the share of the
pictures without a pixel of any target. Over {len(scenes)} scenes the mean worth rose by {number(sum(gains) / len(gains), 3)}, from {number(mean([r for r in runs if r["build"] == "before"], "mean_worth"), 3)} to
{number(mean([r for r in runs if r["build"] == "now"], "mean_worth"), 3)} over all runs. {fell}

""" + markdown(["<scene", "worth before", "now", "whole before", "now", "asked height", "height before", "now", "shot kept before", "now", "nobody before", "now"],
               [worth_row(scene, *pair) for scene, pair in pairs.items()])


def trade_part(runs):
    if not runs:
        return ""
    rows = [[value, *(percent(mean(own, name), 1) for name in ("joint_whole_share", "shot_kept_share", "as_asked_share")),
             *(number(mean(own, name), 3) for name in ("mean_sight_loss", "mean_shot_loss", "mean_worth")), number(math.degrees(mean(own, "median_height_rad")), 0)]
            for policy, value in TRADES.items() for own in [select(runs, policy=policy)] if own]
    return f"""## What keep_shot trades

The setting `keep_shot` from sight first to shot first, over the {len(distinct(runs, "scene"))} scenes (number of seeds: {len(distinct(runs, "seed"))}). The default is 1. The losses are those of worth: of sight and of the shot.

""" + markdown(["<keep_shot", "whole", "shot kept", "as asked", "sight loss", "shot loss", "worth", "height"], rows)


def worth_row(scene, before, now):
    both = lambda text: [text(before), text(now)]
    degrees = lambda runs, name: number(math.degrees(mean(runs, name)), 0)
    return ([scene] + both(lambda runs: number(mean(runs, "mean_worth"), 2)) + both(lambda runs: percent(mean(runs, "joint_whole_share"), 0)) +
            [degrees(now, "asked_height_rad")] + both(lambda runs: degrees(runs, "median_height_rad")) +
            both(lambda runs: percent(mean(runs, "shot_kept_share"), 0)) + both(lambda runs: percent(mean(runs, "r_n"), 1)))



# ---- low ceilings, the ceiling of worth, shots by name ----

def more_shot_parts(folder):
    tables = {name: read_table(folder / f"{name}.csv") if (folder / f"{name}.csv").exists() else [] for name in ("roofs", "subjects", "worth-ceiling", "named-shots")}
    parts = (roofs_part(tables["roofs"]), subjects_part(tables["subjects"]), worth_ceiling_part(tables["worth-ceiling"]), named_shots_part(tables["named-shots"]))
    return [part for part in parts if part]


def roofs_part(runs):
    if not runs:
        return ""
    groups = [(scene, policy, select(runs, scene=scene, policy=policy)) for scene in distinct(runs, "scene") for policy in distinct(runs, "policy")]
    own = [(scene, mean(rows, "joint_whole_share")) for scene, policy, rows in groups if policy == "sightline" and rows]
    short = [f"{scene} ({percent(share, 0)})" for scene, share in own if share < 0.95]
    verdict = "in all of them" if not short else f"in {len(own) - len(short)} of {len(own)} scenes; not in " + ", ".join(short)
    sheet = "\n" + image("roof-four-walk.png", "Pictures of roof-four-walk, one every 1.3 s: four people who walk about, all in each picture, seen from a little above their eyes")
    return f"""## Under low ceilings

Two to four people, 1.5 to 5 m apart, in furnished rooms and corridors under ceilings of 2.5 to 4 m ([roofs](../../scenes/README.md#roofs)). Above them there is no room for a picture. The default
shows everybody whole in at least 95 % of the pictures {verdict}. *Least* is the seed with the fewest such pictures. The columns are those of the tables above.

""" + markdown(["<scene", "<policy", "seeds", "worth", "whole", "least", "size", "asked height", "height", "sight loss", "shot loss"],
               [roof_row(*group) for group in groups if group[2]]) + sheet


def roof_row(scene, policy, runs):
    degrees = lambda name: number(math.degrees(mean(runs, name)), 0)
    return [scene, policy, len(runs), number(mean(runs, "mean_worth"), 3), percent(mean(runs, "joint_whole_share"), 1), percent(min(run["joint_whole_share"] for run in runs), 0),
            number(mean(runs, "p95_size_pictures"), 2), degrees("asked_height_rad"), degrees("median_height_rad"), number(mean(runs, "mean_sight_loss"), 3),
            number(mean(runs, "mean_shot_loss"), 3)]


def subjects_part(runs):
    if not runs:
        return ""
    groups = [(scene, policy, select(runs, scene=scene, policy=policy)) for scene in distinct(runs, "scene") for policy in distinct(runs, "policy") if policy != "follow"]
    return """## Other subjects, and recorded motion

The subject changes, turns back, talks, or stands too far away ([subjects](../../scenes/README.md#subjects)); people and footballers move as they were recorded ([recorded motion](../../scenes/README.md#recorded-motion)).
*Answer* is the time from a change of targets to the first picture that shows the new ones whole with every property of the shot within half of its limit; *longest* is that of any run. In `cycle-far` the limits of the camera
allow 3.5 s at best. *Blind* is the longest time of any run without a pixel of any target. `chase` and `over-right-shoulder` are shots by name, judged against themselves; a runner who turns back at 5 m/s
every 1.6 s is faster round than a camera 5 m behind with 10 m/s. The spring arm has no limits of speed: it jumps to the new subject at once, also through bodies and walls.

""" + markdown(["<scene", "<policy", "seeds", "worth", "whole", "shot kept", "sight loss", "shot loss", "asked height", "height", "changes", "answer s", "longest s", "blind s", "collisions"],
               [subject_row(*group) for group in groups if group[2]])


def subject_row(scene, policy, runs):
    degrees = lambda name: number(math.degrees(mean(runs, name)), 0)
    changes = sum(run["target_changes"] for run in runs)
    answers = [number(sum(run["mean_change_answer_s"] * run["target_changes"] for run in runs) / changes, 1), number(max(run["longest_change_answer_s"] for run in runs), 1)] if changes else ["", ""]
    return [scene, policy, len(runs), number(mean(runs, "mean_worth"), 2), percent(mean(runs, "joint_whole_share"), 0), percent(mean(runs, "shot_kept_share"), 0), number(mean(runs, "mean_sight_loss"), 2),
            number(mean(runs, "mean_shot_loss"), 2), degrees("asked_height_rad"), degrees("median_height_rad"), number(changes, 0) if changes else "", *answers,
            number(max(run["longest_blind_s"] for run in runs), 1), number(sum(run["body_collisions"] for run in runs), 0)]


def worth_ceiling_part(runs):
    scenes = [scene for scene in distinct(runs, "scene") if select(runs, scene=scene, policy="ceiling-worth") and select(runs, scene=scene, policy="sightline")]
    if not scenes:
        return ""
    return """## What the asked shot could be worth

The ceiling of worth knows the whole scenario in advance and plans for pictures of as much worth as it can, under the default's limits (`--policy ceiling-worth`). Its worth was reached, so the
true ceiling is no lower. *At most* is an estimate on a grid, for a camera that accelerates at once. Means over the seeds that both played""" + ("; these are tuning seeds, from 101 on" if min(run["seed"] for run in runs) > 100 else "") + """.

""" + markdown(["<scene", "seeds", "default", "ceiling", "at most", "of the ceiling", "sight loss", "ceiling's", "shot loss", "ceiling's", "whole", "ceiling's"],
               [worth_ceiling_row(scene, runs) for scene in scenes])


def worth_ceiling_row(scene, runs):
    reached = select(runs, scene=scene, policy="ceiling-worth")
    own = [run for run in select(runs, scene=scene, policy="sightline") if run["seed"] in {other["seed"] for other in reached}]
    both = lambda name, text: [text(mean(own, name)), text(mean(reached, name))]
    worth = mean(own, "mean_worth"), mean(reached, "mean_worth")
    return ([scene, len(reached), number(worth[0], 2), number(worth[1], 2), number(mean(reached, "most_worth"), 2), percent(worth[0] / worth[1], 0)] +
            both("mean_sight_loss", lambda value: number(value, 2)) + both("mean_shot_loss", lambda value: number(value, 2)) +
            both("joint_whole_share", lambda value: percent(value, 0)))


def named_shots_part(runs):
    if not runs:
        return ""
    names = [name for name in distinct(runs, "policy") if name != "follow"]
    rows = [[scene] + [number(mean(select(runs, scene=scene, policy=name), "mean_worth"), 2) for name in names] for scene in distinct(runs, "scene")]
    rows.append(["mean"] + [number(mean(select(runs, policy=name), "mean_worth"), 2) for name in names])
    for label, column in (("everybody whole", "joint_whole_share"), ("shot kept", "shot_kept_share")):
        rows.append([label] + [percent(mean(select(runs, policy=name), column), 0) for name in names])
    return """## Shots by name

The worth of the pictures when a client asks for one of the shots that `sightline shots` lists, each judged against that shot (`client/truth/asked_frames.h`): the judge finds from the scene alone where the
camera should be at each moment. The subject is the first target, the other the second. The last rows are means over these scenes.

""" + markdown(["<scene"] + names, rows)
