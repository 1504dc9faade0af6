"""Tables of the scenes: what cameras saw there, how they moved, and what was possible. Both pages use them."""
from figures import between, distinct, greatest, image, markdown, mean, number, of_shared_seeds, percent, select, total, weighted_mean


def scenes_part(runs):
    groups = [(scene, policy, select(runs, scene=scene, policy=policy)) for scene in distinct(runs, "scene")
              for policy in distinct(runs, "policy")]
    groups = [group for group in groups if group[2]]
    return """## All scenes

Figures are means over seeds unless said. Follow and the spring arm keep no motion limits and touch or cross geometry, which is one reason for what
they see.

### What the camera saw

*Joint*: share of pictures in which every target is visible to 95 %, with the least and greatest value over seeds. *All seen*: every target has a
visible pixel. *Episodes*: how often in a run a target is lost from sight. *Blind*: the longest stretch of any seed without a visible pixel of any
target. *With a way*: the longest part of one during which a place that sees a target could be reached within 2 s, by an independent search.
*Reaction*: mean over all sustained occlusions, with their number in brackets. *Turn*: from a turn of the targets to half of the camera's answer to
it, mean over all turns, with their number in brackets.

""" + markdown(["<scene", "<policy", "joint", "all seen", "episodes", "r_N", "r_P", "blind s", "with a way s", "reaction s", "turn s"],
               [sight_row(*group) for group in groups]) + "\n" + image(
                   "bars-joint_visible_share.svg", "Joint visible share by scene and policy") + image(
                       "hall-s1-share.svg", "The hall: visible share of the target that is seen least") + """
### How the camera moved

Collisions and violations of the motion limits are frames, summed over seeds. *At a_max* and *at v_max*: share of the frames at the acceleration
limit and at the speed limit. *Reversals*: how often a second the path turns back by more than 90 degrees within 0.5 s. *Goal jumps*: how often a
second the position that the camera heads for moves by more than 0.5 m within 1/30 s.

""" + markdown(["<scene", "<policy", "collisions", "violations", "d_c m", "at a_max", "at v_max", "RMS jerk m/s³", "p99 jerk m/s³",
                "reversals /s", "goal jumps /s"], [motion_row(*group) for group in groups]) + "\n"


def sight_row(scene, policy, runs):
    joint = [run["joint_visible_share"] for run in runs]
    return [scene, policy, percent(mean(runs, "joint_visible_share"), 1) + between(min(joint), max(joint), 1, 100),
            percent(mean(runs, "all_seen"), 1), number(mean(runs, "episodes"), 1), percent(mean(runs, "r_n")),
            percent(mean(runs, "r_p")), number(greatest(runs, "longest_blind_s"), 1),
            number(greatest(runs, "longest_blind_with_way_s"), 1), delay(runs, "mean_reaction_s", "sustained_occlusions"),
            delay(runs, "mean_turn_answer_s", "turns")]


def delay(runs, name, count):
    """A mean delay over all that was counted, with the count; "" where nothing was."""
    seconds = weighted_mean(runs, name, count)
    return "" if seconds is None else f"{number(seconds, 2)} ({int(total(runs, count))})"


def motion_row(scene, policy, runs):
    counts = [int(total(runs, name)) for name in ("body_collisions", "limit_violations")]
    return [scene, policy] + counts + [
        number(mean(runs, "d_c_m"), 1), percent(mean(runs, "acceleration_limit_share"), 1), percent(mean(runs, "speed_limit_share"), 1),
        number(mean(runs, "rms_jerk_mps3"), 0), number(mean(runs, "p99_jerk_mps3"), 0), number(mean(runs, "reversals_per_s"), 2),
        number(mean(runs, "goal_jumps_per_s"), 2)]


# ---- the ceiling ----

def ceiling_part(ceilings, runs):
    """A list of one part, or empty where the ceiling was not measured."""
    rows = [ceiling_row(scene, select(ceilings, scene=scene), select(runs, scene=scene, policy="sightline"))
            for scene in distinct(ceilings, "scene")]
    if not rows:
        return []
    return ["""## What is possible

The ceiling is a camera that knows the whole scenario in advance. It keeps the same motion limits, body, distances and elevations as the default. Its
joint share was reached, so the true ceiling is no lower. *At most* is an upper estimate on a grid, for a camera that accelerates at once. *Of the
ceiling* is the default's joint share as a share of the one that the ceiling reached, over the same seeds. It counts for at most 100 % in means, since the
ceiling's search may miss a way that the default takes.

""" + markdown(["<scene", "seeds", "default", "ceiling", "at most", "of the ceiling"], rows)]


def ceiling_row(scene, ceilings, own_runs):
    own_runs, ceilings = of_shared_seeds(own_runs, ceilings)
    own, reached = (mean(rows, "joint_visible_share") for rows in (own_runs, ceilings))
    share = own / reached if own is not None and reached else None
    return [scene, len(ceilings), percent(own, 1), percent(reached, 1), percent(mean(ceilings, "most_joint"), 1), percent(share, 1)]
