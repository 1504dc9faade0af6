#!/usr/bin/env python3
"""Writes the page on speed, README.md, from the tables beside it: rows.csv, ratios.csv, load.csv, service/*.json, how.json.

    make_page.py [FOLDER]    # FOLDER of the page; default: the folder of this script
"""
import json
import pathlib
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

from figures import distinct, find, markdown, number, read_table, select  # noqa: E402
from svg_plots import line_plot  # noqa: E402
from service import read_service, service_claims, service_part  # noqa: E402

# Names in the tables, and the names that the page shows.
NAMES = {"egl": "Sightline, EGL", "embree": "Sightline, Embree", "egl default": "default, EGL", "embree default": "default, Embree",
         "embree 8 points": "8 points a target", "embree rays": "(b) an Embree ray each", "bullet rays": "(c) a Bullet ray each",
         "draw all": "(a) all drawn, read back"}
GROWTH = {"detail": ("triangles of the same blocks, cut ever finer", "triangles"),
          "blocks": ("triangles, by ever more blocks", "triangles"), "targets": ("targets", "targets"),
          "movers": ("moving occluders of 10,000 instances", "moving occluders")}


class Claim:
    """One line of the page: the claim, whether it holds (None: not measured), and the figure."""

    def __init__(self, text, holds, figure):
        self.text, self.holds, self.figure = text, holds, figure

    def row(self):
        verdict = "not measured" if self.holds is None else "**holds**" if self.holds else "**does not hold**"
        return [self.text, verdict, self.figure]


def at_most(text, value, limit, unit, digits=2):
    if value is None:
        return Claim(text, None, "")
    return Claim(text, value <= limit, f"{number(value, digits)} {unit}")


def ratio_at_least(text, row, limit):
    if row is None:
        return Claim(text, None, "")
    return Claim(text, row["ratio"] >= limit, times(row, 1))


def p50(rows, section, x, row):
    found = find(rows, section=section, x=float(x), row=row)
    return found["p50_ms"] if found else None


# ---- steps ----

def step_claims(rows, ratios):
    against = lambda r, other: find(ratios, section="peers", x=float(r), other=other)
    claims = [at_most("EGL, r = 7: a step takes at most 0.35 ms", p50(rows, "peers", 7, "egl"), 0.35, "ms", 3),
              ratio_at_least("EGL, r = 7: at least 12 times as fast as (a)", against(7, "draw all"), 12),
              at_most("Embree, r = 7: a step takes at most 0.05 ms", p50(rows, "peers", 7, "embree"), 0.05, "ms", 3),
              at_most("The same without the others in turn", p50(rows, "alone", 7, "embree"), 0.05, "ms", 3)]
    for name, other in (("(b)", "embree rays"), ("(c)", "bullet rays")):
        found = [row for row in select(ratios, section="peers", other=other)]
        figure = ", ".join(f"r = {int(row['x'])}: {number(row['ratio'], 2)}" for row in found)
        claims.append(Claim(f"Embree: faster than {name} at every r", all(row["ratio"] > 1 for row in found) if found else None, figure))
    claims.append(ratio_at_least("Embree, r = 15: at least 5 times as fast as (b)", against(15, "embree rays"), 5))
    claims.append(ratio_at_least("Embree, r = 32: at least 15 times as fast as (b)", against(32, "embree rays"), 15))
    claims.append(at_most("4,096 candidates, 8 targets, 8 points each, 16 x 16 maps, Embree: at most 2.0 ms",
                          p50(rows, "wide", 4096, "embree 8 points"), 2.0, "ms"))
    return claims


def peers_part(rows, ratios):
    text = """## A step and simpler methods

The scene is the city (280 K triangles, two targets), with one point for each target, maps of r x r texels and about r³ candidates (the number in
the lattice). (b) and (c) test the same candidates. Our figure is a whole step, from bound to move; the peers only find what is visible and decide nothing.
(a) draws the whole scene into one map for each target and reads it back by glReadPixels, as the paper did. (b) and (c) trace one ray for each
candidate and target: (b) by Embree's rtcOccluded1 through one flat scene of high quality, (c) by Bullet's rayTest through the collision world that a
game already has. *default* is our default strategy, which looks ahead, searches for other viewpoints and samples eight points of each target.
*alone* runs without the other contenders, which displace it from the caches. Times are medians in milliseconds, with the 95th percentile in brackets.

"""
    radii = distinct(select(rows, section="peers"), "x")
    table = []
    for section, names in (("peers", ("egl", "embree")), ("alone", ("egl", "embree")), ("default", ("egl default", "embree default")),
                           ("peers", ("draw all", "embree rays", "bullet rays"))):
        for name in names:
            cells = [find(rows, section=section, x=r, row=name) for r in radii]
            table.append([NAMES[name] + (", alone" if section == "alone" else "")] + [f"{number(c['p50_ms'], 3)} ({number(c['p95_ms'], 3)})" if c else "" for c in cells])
    text += markdown(["<"] + [f"r = {int(r)}" for r in radii], table)
    text += "\nHow many times as long the peers take: the median of ten runs of frames, and (least to greatest):\n\n"
    table = []
    for other in distinct(select(ratios, section="peers"), "other"):
        cells = [find(ratios, section="peers", x=r, other=other) for r in radii]
        ours = next(c["ours"] for c in cells if c)
        table.append([f"{NAMES[other]} / {NAMES[ours]}"] +
                     [f"{number(c['ratio'], 1)} ({number(c['least'], 1)} to {number(c['greatest'], 1)})" if c else "" for c in cells])
    text += markdown(["<"] + [f"r = {int(r)}" for r in radii], table)
    text += "\nTime by stage, medians:\n\n" + stages_table(select(rows, section="peers") + select(rows, section="default"))
    agree = [row["agreement"] for row in rows if row["agreement"] is not None]
    if agree:
        text += f"\nThe peers' rays and our maps agree on at least {100 * min(agree):.2f} % of all candidates and targets"
        on_rays = [row["agreement_on_rays"] for row in rows if row.get("agreement_on_rays") is not None]
        text += f", and where a candidate lies on a ray of the map on at least {100 * min(on_rays):.2f} %.\n" if on_rays else ".\n"
    return text


def stages_table(rows):
    ours = [row for row in rows if row["sample_p50_ms"]]
    return markdown(["<", "r", "candidates", "sample", "aggregate", "move", "whole step"],
                    [[NAMES[row["row"]], int(row["x"]), int(row["candidates"])] +
                     [number(row[f"{stage}p50_ms"], 3) for stage in ("sample_", "aggregate_", "move_", "")] for row in ours])


def wide_part(rows):
    return """## A wide step

About 4,096 candidates, eight targets with eight points each and maps of 16 x 16 texels, with Embree, on a grid of 400 blocks (315 K triangles).
Times are medians in milliseconds.

""" + markdown(["<", "candidates", "sample", "aggregate", "move", "whole step", "p95"],
               [[NAMES[row["row"]], int(row["candidates"])] +
                [number(row[name], 2) for name in ("sample_p50_ms", "aggregate_p50_ms", "move_p50_ms", "p50_ms", "p95_ms")]
                for row in select(rows, section="wide")])


# ---- growth ----

def growth_claims(rows, ratios):
    claims = []
    for name in ("embree", "egl", "embree default", "egl default"):
        for section, what in (("detail", "cut finer"), ("blocks", "more blocks")):
            line, grown = select(rows, section=section, row=name), select(ratios, section=section, other=name)
            if not grown:
                continue
            most = max(grown, key=lambda row: row["ratio"])
            claims.append(Claim(f"{NAMES[name]}: {line[0]['x']:,.0f} to {line[-1]['x']:,.0f} triangles ({what}): at most 3 times",
                                most["ratio"] <= 3, times(most, 2)))
    for name in ("embree", "egl", "embree default", "egl default"):
        grown = select(ratios, section="targets", other=name)
        if grown:
            claims.append(Claim(f"{NAMES[name]}: 1 to {int(grown[-1]['x'])} targets: at most linearly",
                                grown[-1]["ratio"] <= grown[-1]["x"], times(grown[-1], 1)))
    for name in ("embree", "egl", "embree default", "egl default"):
        line, grown = select(rows, section="movers", row=name), select(ratios, section="movers", other=name)
        if line and grown:
            # The growth of the step against the smallest case, measured in turn, and the growth of the mirror.
            more = line[-1]["p50_ms"] * (1 - 1 / grown[-1]["ratio"]) + line[-1]["scene_p50_ms"] - line[0]["scene_p50_ms"]
            claims.append(Claim(f"{NAMES[name]}: {int(line[-1]['x']):,} moving occluders of 10,000 instances: under 1 ms more",
                                more < 1, f"{number(more, 2)} ms more"))
    return claims


def times(row, digits):
    return f"{number(row['ratio'], digits)} times ({number(row['least'], digits)} to {number(row['greatest'], digits)})"


def with_scene(row):
    """The step, and the mirror's time for the transforms of its tick."""
    return row["p50_ms"] + row["scene_p50_ms"]


def growth_part(rows, folder):
    text = """## Growth

r = 7, 343 candidates and two targets, unless said otherwise; the scene is a grid of blocks with streets between them. Times are medians of the whole
step; with moving occluders they include the mirror's part. The claims above compare a larger case with the smallest one, measured in turn. The
columns here were measured once each, and this machine is not equally fast at all times. Both axes of the plots are logarithmic.

"""
    for section, (title, x_name) in GROWTH.items():
        lines = {}
        for row in select(rows, section=section):
            lines.setdefault(NAMES[row["row"]], []).append((row["x"], with_scene(row) if section == "movers" else row["p50_ms"]))
        if not lines:
            continue
        (folder / "plots").mkdir(exist_ok=True)
        (folder / "plots" / f"{section}.svg").write_text(line_plot(f"A step by {title}", x_name, "ms", lines), encoding="utf-8")
        text += f"![A step by {title}](plots/{section}.svg)\n\n"
        xs = distinct(select(rows, section=section), "x")
        text += markdown(["<ms"] + [f"{x:,.0f}" for x in xs],
                         [[name] + [number(dict(line).get(x), 3) for x in xs] for name, line in lines.items()]) + "\n"
    return text


# ---- loading ----

def ready_s(row, sampler):
    return row["scene_s"] + row[f"{sampler}_s"]


def load_claims(load):
    if not load:
        return [Claim("Loading", None, "")]
    small, large = load[0], load[-1]
    size = lambda row: f"{row['triangles'] / 1e6:.2g} million"
    # The memory that the process holds, for scene and sampler.
    total = lambda row, sampler: row["scene_resident"] + row[f"{sampler}_resident"]
    return [at_most(f"A .glb of {size(small)} triangles is ready (Embree) in under 0.5 s", ready_s(small, "embree"), 0.5, "s"),
            at_most(f"A .glb of {size(large)} triangles is ready (Embree) in under 20 s", ready_s(large, "embree"), 20, "s", 1),
            at_most("Bytes a triangle in all with Embree under 160", max(total(row, "embree") for row in load), 160, "B", 0),
            at_most("Bytes a triangle in all with EGL, geometry on the device, under 160", max(total(row, "egl") for row in load), 160, "B", 0)]


def load_part(load):
    if not load:
        return ""
    text = """## Loading

The file is a binary glTF, half of it one landscape and half 64 separate meshes. Times run from the file (in the page cache) until the first map is
taken. *EGL* is the pipeline that keeps geometry on the device, as on a GPU; the one that is fast on a software renderer keeps none. Bytes a triangle
are what each part reports of itself; in brackets stands the growth of the process. A sampler takes memory only when it is used.

"""
    names = ["triangles", "file MB", "scene s", "and Embree s", "or EGL s", "positions, indices", "clusters", "scene", "Embree", "EGL"]
    rows = [[f"{row['triangles']:,.0f}", number(row["file_mb"], 1), number(row["scene_s"], 2), number(row["embree_s"], 2),
             number(row["egl_s"], 2), number(row["source_bytes"], 1), number(row["cluster_bytes"], 1), f"({number(row['scene_resident'], 1)})",
             f"{number(row['embree_bytes'], 1)} ({number(row['embree_resident'], 1)})",
             f"{number(row['egl_bytes'], 1)} ({number(row['egl_resident'], 1)})"] for row in load]
    return text + markdown(names, rows)


# ---- the page ----

def introduction(how):
    return f"""# Speed

`tests/results/speed/make.sh` makes this page: do not edit it by hand. `make_page.py` writes it again from the tables in this folder. It was measured on
{how['cores']} cores ({how['cpu']}) without a GPU, in {how['minutes']} minutes, at commit {how['commit']}. Samplers: {how['samplers']}.
All contenders of a table run frame by frame in turn, over the same scene at the same time, so ratios are more reliable than single figures. There
is a [page of its own](gpu.md) on a GPU.
"""


def claims_part(claims):
    return "## Claims\n\nComputed from the tables in this folder.\n\n" + markdown(["<claim", "<verdict", "<figure"], [claim.row() for claim in claims])


def make_page(folder):
    how = json.loads((folder / "how.json").read_text(encoding="utf-8"))
    rows, ratios = read_table(folder / "rows.csv"), read_table(folder / "ratios.csv")
    load = read_table(folder / "load.csv") if (folder / "load.csv").exists() else []
    service = read_service(folder / "service")
    claims = step_claims(rows, ratios) + service_claims(service, Claim) + growth_claims(rows, ratios) + load_claims(load)
    notes = folder / "notes.md"
    parts = [introduction(how), claims_part(claims), notes.read_text(encoding="utf-8") if notes.exists() else "",
             peers_part(rows, ratios), wide_part(rows), service_part(service), growth_part(rows, folder), load_part(load)]
    return "\n".join(part for part in parts if part)


def main():
    folder = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else HERE
    (folder / "README.md").write_text(make_page(folder), encoding="utf-8")


if __name__ == "__main__":
    main()
