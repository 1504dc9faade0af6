#!/usr/bin/env python3
"""Writes gpu.md from the tables in gpu/, which hold one measurement on a machine with a GPU. The page names the commands.

    gpu_page.py [FOLDER]    # FOLDER of gpu/ and the page; default: the folder of this script
"""
import json
import pathlib
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.path.append(str(HERE.parent))

from figures import find, markdown, number, read_table  # noqa: E402

HEAD = """# On a GPU

`gpu_page.py` writes this page from the tables in `gpu/`: do not edit it by hand. Measured on 26 November 2026 on a virtual machine with one NVIDIA H100 80GB HBM3 (driver 580.159.04, OpenGL 4.5.0
over EGL's device platform, headless) and 16 processors (Intel Xeon, 2.1 GHz), Ubuntu 24.04. The programs were built on Debian 12.

**OpenGL on this GPU works, and it is slower than Embree on the processor.** The default step takes {factor} times as long. So the daemon takes Embree unless it is told
otherwise, on a GPU node too.

## Tests

`gl_test`, `egl_test` (maps of both samplers compared with each other and with rays), `samplers_test`, `replay_test`, `daemon_test` (with the choice of the sampler) and `Fault_injected`'s lost context passed. The context is
robust. The golden recording's hash is for llvmpipe and Embree only; that test skipped.

## A step

`step_bench`: the city (280 K triangles, two targets), 1,200 steps in each row, medians in milliseconds with the 95th percentile in brackets. *plain* is
the paper's basic way: one point for each target, and no filter. *default, r³* is the default strategy with about r³ candidates, *default* the same with its own number of candidates.
"""

REASON = """
## Why

A take of two maps of 7 x 7 texels takes {two_egl} us with OpenGL and {two_embree} us with Embree. Timers that were put into the sampler for this measurement gave, in the mean of 1,360 takes of two maps, of 138 us each at the median:

{parts}

- **The processor finds the triangles.** That alone takes longer than Embree's rays of the same maps. A map has 49 texels, so there is little to draw: the GPU is idle nearly all the time.
- **A GPU that finds them itself** would still need about {gpu_part} us for a take: the context, the draw and the wait. Embree takes {sixteen_embree} us for 16 maps, so such a sampler could win with many maps
  in one take. It was not built: depth maps are {sample_share} % of a default step with Embree, so it could make the step shorter by that at most.
- **All triangles drawn**, as in the paper: `speed_bench` on the same machine, two maps of 7 x 7, takes {draw_all} ms for that alone, {draw_all_times} times as long as a whole step with Embree.
- Sessions that are taken together cost less: 20 sessions with two maps each take {together} us a session in one round, and {alone} us one after the other (`sample_bench`, `egl_sessions`).

## Depth maps

`sample_bench`, `egl_city` and `embree_city`: one take over 283 K triangles with moving occluders, medians in microseconds.
"""

SESSIONS = """
## Sessions

`sightline bench --rate 60 --targets 2 --resolution 7 --candidates 343`, the daemon and the load on the same 16 processors, for 14 s at most. *Merged* ticks were answered together with a later one, because the daemon
did not keep up. All sessions with OpenGL share one context and take turns.
"""


def step_table(steps):
    names = {"paper": "plain", "sightline": "default, r³", "default": "default"}
    rows = []
    for egl in (row for row in steps if row["sampler"] == "egl"):
        embree = find(steps, sampler="embree", settings=egl["settings"], r=egl["r"])
        rows.append([names[egl["settings"]], str(int(egl["r"])), with_p95(egl), with_p95(embree),
                     number(egl["total_p50_ms"] / embree["total_p50_ms"], 1)])
    return markdown(["<settings", "r", "OpenGL on the GPU", "Embree", "times as long"], rows)


def with_p95(row):
    return f"{number(row['total_p50_ms'], 3)} ({number(row['total_p95_ms'], 3)})"


def part_table(parts):
    return markdown(["<part of a take", "us"], [[row["part"], number(row["us"], 0)] for row in parts]).rstrip()


def map_table(maps):
    rows = []
    for egl in (row for row in maps if row["sampler"] == "egl"):
        embree = find(maps, sampler="embree", maps=egl["maps"], r=egl["r"])
        if embree:
            rows.append([str(int(egl["maps"])), str(int(egl["r"])), number(egl["p50_us"], 0), number(embree["p50_us"], 1)])
    return markdown(["maps", "r", "OpenGL on the GPU", "Embree"], rows)


def session_table(folder):
    loads = {"one-default": "1 session, default", "many-default": "50 sessions, default", "many-plain": "50 sessions, plain"}
    rows = []
    for name, words in loads.items():
        for sampler, shown in (("egl", "OpenGL on the GPU"), ("embree", "Embree")):
            run = json.loads((folder / f"{name}-{sampler}.json").read_text(encoding="utf-8"))
            trip, ticks = run["latency_us"]["round_trip"], run["ticks"]
            rows.append([words, shown, number(trip["p50"]["median"] / 1000, 2), number(trip["p99"]["median"] / 1000, 2),
                         number(run["latency_us"]["sample"]["p50"]["median"] / 1000, 2), f"{number(100 * ticks['merged'] / ticks['sent'], 1)} %",
                         number(run["cpu_us_per_tick"]["daemon"]["median"] / 1000, 2)])
    return markdown(["<load", "<sampler", "round trip p50, ms", "p99, ms", "depth maps p50, ms", "ticks merged", "daemon's CPU time a tick, ms"], rows)


def make_page(folder):
    data = folder / "gpu"
    steps, maps, peers, parts, sessions = (read_table(data / name)
                                           for name in ("step.csv", "maps.csv", "rows.csv", "take.csv", "sessions.csv"))
    default = {sampler: find(steps, sampler=sampler, settings="default", r=7) for sampler in ("egl", "embree")}
    two = {sampler: find(maps, sampler=sampler, maps=2, r=7) for sampler in ("egl", "embree")}
    draw_all, embree_step = (find(peers, section="peers", x=7, row=name) for name in ("draw all", "embree"))
    reason = REASON.format(two_egl=number(two["egl"]["p50_us"], 0), two_embree=number(two["embree"]["p50_us"], 1), parts=part_table(parts), together=number(find(sessions, taken="in one round")["us"], 0),
                           alone=number(find(sessions, taken="one after the other")["us"], 0),
                           gpu_part=number(sum(row["us"] for row in parts if "(processor)" not in row["part"]), 0),
                           sixteen_embree=number(find(maps, sampler="embree", maps=16, r=7)["p50_us"], 0),
                           sample_share=number(100 * default["embree"]["sample_p50_ms"] / default["embree"]["total_p50_ms"], 0),
                           draw_all=number(draw_all["p50_ms"], 2), draw_all_times=number(draw_all["p50_ms"] / embree_step["p50_ms"], 0))
    page = (HEAD.format(factor=number(default["egl"]["total_p50_ms"] / default["embree"]["total_p50_ms"], 1)) + "\n" + step_table(steps) + reason
            + "\n" + map_table(maps) + SESSIONS + "\n" + session_table(data / "service"))
    (folder / "gpu.md").write_text(page, encoding="utf-8")
    return page


if __name__ == "__main__":
    make_page(pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
