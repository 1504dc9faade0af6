#!/usr/bin/env python3
"""Measures what sessions cost on this machine, and writes the table of deploy/SIZING.md: sizing.py SIGHTLINE [SECONDS]. Each row is a run of `sightline bench` of
SECONDS (default 10) with a daemon of its own, on an otherwise idle machine."""
import json
import os
import pathlib
import subprocess
import sys
import tempfile

PAGE = pathlib.Path(__file__).with_name("SIZING.md")
BEGIN, END = "<!-- measured by sizing.py -->\n", "<!-- end -->\n"
# Name, sessions, further flags of `sightline bench`.
LOADS = (("default settings", 1, ()), ("default settings", 10, ()), ("default settings", 25, ()), ("default settings", 50, ()),
         ("8 points on each target, plain lattice", 25, ("--preset", "paper", "--points", "8")),
         ("default settings, 8 targets", 10, ("--targets", "8")),
         ("default settings, 1,000 instances", 10, ("--instances", "1000", "--moving", "100")))
MIB = 1 << 20


def measure(sightline, sessions, flags, seconds):
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder, "bench.json")
        subprocess.run([sightline, "bench", "--sessions", str(sessions), *flags, "--all-windows", "--max-duration", str(seconds),
                        "--json", str(file)], check=True, stdout=subprocess.DEVNULL)
        return json.loads(file.read_text())


def row(name, sessions, result):
    rate = result["load"]["rate_hz"]
    cpu_us, memory, service = result["cpu_us_per_tick"]["daemon"]["median"], result["daemon_memory"], result["service"]
    traffic = (result["message_bytes"]["tick"] + result["message_bytes"]["reply"]) * rate / 1024
    return (f"| {name} | {sessions} | {cpu_us * rate / 1e6:.3f} | {cpu_us * rate * sessions / 1e6:.2f} | {memory['sessions_bytes'] / MIB:.0f} | "
            f"{(memory['per_session_bytes'] or 0) / MIB:.2f} | {traffic:.0f} | {result['latency_us']['round_trip']['p99']['median'] / 1e3:.1f} | "
            f"{100 * service['degraded_share']:.0f} % |")


def processor():
    for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":")[1].strip()
    return "an unknown processor"


def main():
    sightline, seconds = sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else "10"
    rows = ["| settings | sessions | CPUs a session | CPUs in all | memory, MiB | MiB a further session | KiB/s a session | round trip p99, ms | degraded |",
            "|---|--:|--:|--:|--:|--:|--:|--:|--:|"]
    for name, sessions, flags in LOADS:
        rows.append(row(name, sessions, measure(sightline, sessions, flags, seconds)))
        print(rows[-1], flush=True)
    load = os.getloadavg()[0]
    note = (f"Measured for {seconds} s a row on {len(os.sched_getaffinity(0))} CPUs of {processor()}, shared with the load generator; load average of the "
            f"machine at the end {load:.0f}.")
    before, rest = PAGE.read_text().split(BEGIN)
    PAGE.write_text(before + BEGIN + "\n".join(rows) + "\n\n" + note + "\n" + END + rest.split(END)[1])


if __name__ == "__main__":
    main()
