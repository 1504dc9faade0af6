"""A healthy session at 60 Hz beside each attack, and the daemon's memory a minute later:

  measure.py SIGHTLINED STUBS [--out FILE] [--probes-out FILE] [--after SECONDS] [--seconds N] [--only NUMBER...]

Prints a line an attack and writes the figures to FILE as JSON. Each daemon has a control group with 512 MiB, where one can be made. Run it on an
idle machine: attacker and healthy client share its CPUs with the daemon. An attack passes when every tick of the healthy session was answered, its p99 is
under 33 ms beyond the time for which the attack stops the daemon itself, and the memory is back within 10 % of what it was before, but for uploads
that stay. With --probes-out, the gRPC health service and /livez are asked ten times a second meanwhile (prober.py).
"""
import argparse
import contextlib
import json
import os
import sys
import time

import daemon as attack

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("sightlined")
parser.add_argument("stubs")
parser.add_argument("--out", help="file for the figures")
parser.add_argument("--probes-out", help="file for the figures of the probes")
parser.add_argument("--after", type=float, default=60.0, help="seconds from the attack's end to the last look at the memory")
parser.add_argument("--seconds", type=float, default=8.0, help="length of an attack")
parser.add_argument("--only", nargs="+", default=[], metavar="NUMBER", help="numbers of the attacks to run, such as 30 or 31a")
options = parser.parse_args()
attack.Daemon.path = options.sightlined
attack.in_containers()
sys.path.insert(0, options.stubs)

import attacks  # noqa: E402
import careless_files  # noqa: E402
import endless_work  # noqa: E402
import foreign_frames  # noqa: E402
import held_probes  # noqa: E402
import legal_numbers  # noqa: E402
from daemon import Daemon, Healthy, Prober  # noqa: E402
from probing import free_address, operators_of  # noqa: E402

LIMIT_MS, SLACK = 33.0, 0.10
attacks.ATTACK_S = legal_numbers.ATTACK_S = options.seconds
ATTACKS = sorted(attacks.ATTACKS + legal_numbers.ATTACKS + foreign_frames.ATTACKS + endless_work.ATTACKS + held_probes.ATTACKS + careless_files.ATTACKS,
                 key=lambda one: (int(str(one.number).rstrip("abcdefgh")), str(one.number)))
PROBES = []


def measured(one):
    """Runs the attack; returns its figures and the daemon, which still runs."""
    with contextlib.ExitStack() as files:
        made = one.options()
        more = files.enter_context(made) if made else {}
        if "skip" in more:
            return {"number": one.number, "skipped": more["skip"]}, None
        stack = contextlib.ExitStack()
        where = {"listen": more["listen"]} if "listen" in more else {}
        # Not every daemon of these has a log that says where its metrics port is.
        operators = free_address() if options.probes_out and "--metrics-listen" not in one.flags else None
        metrics = ("--metrics-listen", operators) if operators else ()
        daemon = stack.enter_context(Daemon(*one.flags, *metrics, *more.get("more", ()), limits=one.limits, stderr=more.get("stderr"),
                                            environment=more.get("environment"), **where))
        daemon.recordings, daemon.files = more.get("recordings"), more.get("files")
        address = daemon.ready.read_text().split()[-1 if one.beside_is_another_client else 0]
        Healthy(address, 2).result()
        before = daemon.memory_mib()
        healthy = Healthy(address, options.seconds + 1)
        # Where there is a unix socket, TCP may be encrypted.
        prober = Prober(daemon.ready.read_text().split()[-1], operators or operators_of(daemon), options.seconds + 1) if options.probes_out else None
        seen = one.run(daemon)
        result = healthy.result()
        if prober:
            PROBES.append({"number": one.number, "name": one.name, **prober.result()})
            print(f"    {one.number} {PROBES[-1]}", flush=True)
        figures = {"number": one.number, "name": one.name, "before": one.before, "seen": seen, **result, "memory_before_mib": before,
                   "memory_most_mib": daemon.most_memory_mib(), "stays_mib": one.stays_mib, "stopped_ms": one.stopped_ms}
        if one.options is not dict:  # its folder goes away now
            time.sleep(options.after)
            return finished(figures, daemon, stack), None
        return figures, (daemon, stack, time.monotonic() + options.after)


def finished(figures, daemon, stack):
    figures["memory_after_mib"] = daemon.memory_mib()
    figures["alive"] = daemon.process.poll() is None
    stack.close()
    back = figures["memory_after_mib"] <= figures["memory_before_mib"] * (1 + SLACK) + figures["stays_mib"]
    figures["passed"] = bool(figures["alive"] and back and not figures["error"] and figures["answered"] == figures["ticks"] and
                             figures["p99_ms"] < LIMIT_MS + figures["stopped_ms"])
    p99 = figures["p99_ms"] if figures["p99_ms"] is not None else float("inf")
    print(f"{figures['number']:>3} {figures['name'][:44]:44} p99 {p99:7.2f} ms  {figures['answered']} of {figures['ticks']} answered  memory "
          f"{figures['memory_before_mib']:4.0f} MiB, {figures['memory_most_mib']:4.0f} at most, {figures['memory_after_mib']:4.0f} after  "
          f"{'passed' if figures['passed'] else 'FAILED'}  {figures['seen']}  {figures['error']}", flush=True)
    return figures


def main():
    wanted = [one for one in ATTACKS if not options.only or str(one.number) in options.only]
    rows, waiting = [], []
    for one in wanted:
        figures, running = measured(one)
        # The memory of one daemon is looked at while the next one is under attack.
        waiting.append((figures, running)) if running else rows.append(figures)
        if "skipped" in figures:
            print(f"{one.number:>3} {one.name[:44]:44} skipped: {figures['skipped']}", flush=True)
    for figures, (daemon, stack, due) in waiting:
        time.sleep(max(0.0, due - time.monotonic()))
        rows.append(finished(figures, daemon, stack))
    order = [one.number for one in ATTACKS]
    rows.sort(key=lambda row: order.index(row["number"]))
    if options.out:
        with open(options.out, "w") as file:
            json.dump({"cpus": os.cpu_count(), "seconds": options.seconds, "after_s": options.after, "memory_limit_mib": attack.Daemon.memory_limit_mib,
                       "rows": rows}, file, indent=1)
            file.write("\n")
    if options.probes_out:
        with open(options.probes_out, "w") as file:
            json.dump({"cpus": os.cpu_count(), "seconds": options.seconds, "rows": PROBES}, file, indent=1)
            file.write("\n")
    return 0 if all(row.get("passed", True) for row in rows) else 1


sys.exit(main())
