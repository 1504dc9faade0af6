"""The page's part on the service, from what `sightline bench --json` wrote: one file for each load."""
import json

from figures import markdown, number

# Files in the order of the page, and the names that the page shows.
LOADS = {"one-plain": "one session, plain, one point", "one-default": "one session, default",
         "fifty-plain": "50 sessions, plain, 8 points", "hundred-plain": "100 sessions, plain, 8 points",
         "hundred-default": "100 sessions, default", "twenty-egl": "20 sessions, plain, one point, EGL"}
TICK_MS = 1000 / 60
STAGES = ("round_trip", "queue", "scene", "bound", "sample", "aggregate", "move", "transport")


def read_service(folder):
    return {name: json.loads((folder / f"{name}.json").read_text(encoding="utf-8"))
            for name in LOADS if (folder / f"{name}.json").exists()}


def ms(spread):
    return spread["median"] / 1000


def service_claims(service, claim):
    claims = []
    for name in ("one-plain", "one-default"):
        run = service.get(name)
        echo = run["echo"] if run else None
        claims.append(claim(f"{LOADS[name]}, 60 Hz: the p50 of a round trip is at most 1.2 times that of a bare echo and the step",
                            echo["share"]["median"] <= echo["allowed_share"] if echo else None,
                            echo_figure(run) if echo else ""))
        claims.append(quick_claim(claim, f"{LOADS[name]}: p99 under 4 ms", run, 4.0))
    for name in ("hundred-plain", "hundred-default", "twenty-egl"):
        claims.append(quick_claim(claim, f"{LOADS[name]} at 60 Hz on two cores, shared with the load generator: p99 within the tick",
                                  service.get(name), TICK_MS))
    for name in ("fifty-plain", "hundred-plain", "hundred-default", "twenty-egl"):
        claims.append(whole_claim(claim, f"{LOADS[name]}: within the tick, at most 1 % of the steps degraded", service.get(name)))
    run = service.get("hundred-plain")
    bytes_each = (run or {}).get("daemon_memory") and run["daemon_memory"]["per_session_bytes"]
    claims.append(claim("A further session on a loaded scene: under 1 MiB", bytes_each < 2**20 if bytes_each else None,
                        f"{number(bytes_each / 2**20, 2)} MiB" if bytes_each else ""))
    return claims


def echo_figure(run):
    echo = run["echo"]
    return (f"{number(ms(run['latency_us']['round_trip']['p50']), 3)} ms; echo {number(ms(echo['round_trip_us']['p50']), 3)} ms, "
            f"echo and step {number(ms(echo['floor_us']), 3)} ms: {number(echo['share']['median'], 2)} times "
            f"({number(echo['share']['min'], 2)} to {number(echo['share']['max'], 2)})")


def quick_claim(claim, text, run, limit_ms):
    """The p99 of the median window is within the limit, and at most 1 % of all ticks are late."""
    if run is None:
        return claim(text, None, "")
    p99, late = run["latency_us"]["round_trip"]["p99"], run["service"]["late_share"]
    figure = f"p99 {number(ms(p99), 2)} ms ({number(p99['min'] / 1000, 2)} to {number(p99['max'] / 1000, 2)}), {number(100 * late, 2)} % of all ticks late"
    return claim(text, ms(p99) <= limit_ms and late <= 0.01, figure)


def whole_claim(claim, text, run):
    """As quick_claim, and the daemon degrades at most 1 % of the steps."""
    if run is None:
        return claim(text, None, "")
    share = run["service"]["degraded_share"]
    return claim(text, quick_claim(claim, text, run, TICK_MS).holds and share <= 0.01,
                 f"{number(100 * share, 1)} % of the steps degraded, each flagged")


def service_part(service):
    if not service:
        return ""
    text = """## The service

`sightline bench` sends each tick when it is due, whether or not replies are late (an open loop): 60 Hz over a unix socket, on the city with two
targets, r = 7 and 343 candidates, with client and daemon on the same cores. Figures are medians in milliseconds: over three windows that agree, or,
for 50 and 100 sessions, over all windows of 40 seconds, including the expensive ones. *Stable* says whether windows agree.

"""
    rows = []
    for name, run in service.items():
        latency = run["latency_us"]
        memory = run["daemon_memory"] or {}
        each = memory.get("per_session_bytes")
        rows.append([LOADS[name], "yes" if run["stable"] else "no", number(run["service"]["achieved_hz"], 1)] +
                    [number(ms(latency["round_trip"][p]), 2) for p in ("p50", "p90", "p99", "p99_9")] +
                    [number(100 * run["service"]["late_share"], 2) + " %", number(100 * run["service"]["degraded_share"], 1) + " %",
                     number(ms(run["cpu_us_per_tick"]["daemon"] or {"median": 0}), 3), number(ms(run["cpu_us_per_tick"]["generator"]), 3),
                     number(each / 2**20, 2) if each is not None else ""])
    text += markdown(["<load", "stable", "replies/s", "p50", "p90", "p99", "p99.9", "late", "degraded", "CPU a tick, daemon", "generator",
                      "MiB a session"], rows)
    text += "\nA round trip by its parts, p50 and (p99):\n\n"
    text += markdown(["<load"] + [stage.replace("_", " ") for stage in STAGES],
                     [[LOADS[name]] + [f"{number(ms(run['latency_us'][stage]['p50']), 3)} ({number(ms(run['latency_us'][stage]['p99']), 2)})"
                                       for stage in STAGES] for name, run in service.items()])
    return text
