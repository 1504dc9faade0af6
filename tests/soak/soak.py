"""Runs a daemon under load for hours and judges it: soak.py SIGHTLINED SOAK_CLIENT HOURS OUT_JSON.

Sixteen sessions at 60 Hz come and go, change their scenes and upload files (soak_client.cpp). Every ten seconds the daemon's memory and
its descriptors are read. The first part of the run, a tenth but a minute at least, fills caches and is not judged. Verdicts:

  memory       grows by less than 5 % from the start to the end of a line fitted to it
  descriptors  grow by less than 2, likewise
  p99          the median of the last third of the run is at most 1.5 times that of the first
  errors       none that the clients did not cause
"""
import json
import os
import pathlib
import signal
import statistics
import subprocess
import sys
import tempfile
import time

WINDOW_S = 10


def slope(points):
    """Of the straight line with the least squares of differences, for (x, y)."""
    middle_x = statistics.fmean(x for x, _ in points)
    middle_y = statistics.fmean(y for _, y in points)
    spread = sum((x - middle_x) ** 2 for x, _ in points)
    return sum((x - middle_x) * (y - middle_y) for x, y in points) / spread if spread else 0.0


def judge(windows):
    """The verdicts by name, each with a figure in words. `windows` have at_s, memory_mib, descriptors, p99_ms and errors."""
    length = windows[-1]["at_s"]
    judged = [w for w in windows if w["at_s"] > max(60, length / 10)]
    if len(judged) < 6:
        return {"length": {"passed": False, "figure": f"{length:.0f} s are too short for a verdict"}}
    span = judged[-1]["at_s"] - judged[0]["at_s"]
    memory = slope([(w["at_s"], w["memory_mib"]) for w in judged])
    descriptors = slope([(w["at_s"], w["descriptors"]) for w in judged])
    mean = statistics.fmean(w["memory_mib"] for w in judged)
    third = len(judged) // 3
    first, last = (statistics.median(w["p99_ms"] for w in part) for part in (judged[:third], judged[-third:]))
    errors = [error for w in windows for error in w["errors"]]
    return {
        "memory": {"passed": memory * span < 0.05 * mean, "figure": f"{memory * 3600:+.2f} MiB an hour, {mean:.1f} MiB on average"},
        "descriptors": {"passed": descriptors * span < 2, "figure": f"{descriptors * 3600:+.2f} an hour"},
        "p99": {"passed": last <= 1.5 * first, "figure": f"{first:.2f} ms in the first third, {last:.2f} ms in the last"},
        "errors": {"passed": not errors, "figure": f"{len(errors)}" + (f", the first: {errors[0]}" if errors else "")},
    }


def memory_mib(pid):
    text = pathlib.Path(f"/proc/{pid}/status").read_text()
    return int(text.split("VmRSS:")[1].split()[0]) / 1024


def run(sightlined, client, seconds):
    with tempfile.TemporaryDirectory() as folder:
        ready = pathlib.Path(folder, "ready")
        with open(pathlib.Path(folder, "log"), "wb") as log:
            daemon = subprocess.Popen([sightlined, "--listen", "127.0.0.1:0", "--ready-file", str(ready), "--sampler", "embree", "--log-level", "warning"],
                                      stdout=subprocess.DEVNULL, stderr=log)
            while not ready.exists():
                if daemon.poll() is not None:
                    sys.exit("the daemon did not start")
                time.sleep(0.05)
            clients = subprocess.Popen([client, ready.read_text().split()[0], str(seconds), "16"], stdout=subprocess.PIPE, text=True)
            windows = []
            for line in clients.stdout:
                window = json.loads(line)
                window["memory_mib"] = round(memory_mib(daemon.pid), 2)
                window["descriptors"] = len(os.listdir(f"/proc/{daemon.pid}/fd"))
                windows.append(window)
                print(f"{window['at_s']:7.0f} s  {window['answered']:6} answered  p99 {window['p99_ms']:7.2f} ms  {window['memory_mib']:7.1f} MiB  "
                      f"{window['descriptors']:4} descriptors  {len(window['errors'])} errors", flush=True)
            clients.wait()
            daemon.send_signal(signal.SIGTERM)
            code = daemon.wait(30)
    if code != 0:
        windows[-1]["errors"].append(f"the daemon ended with {code}")
    return windows


def main(sightlined, client, hours, out):
    windows = run(sightlined, client, round(float(hours) * 3600))
    verdicts = judge(windows)
    totals = {key: sum(w[key] for w in windows) for key in ("sent", "answered", "merged", "opened", "cut", "resumed", "uploads")}
    result = {"hours": float(hours), "cpus": os.cpu_count(), "totals": totals, "verdicts": verdicts,
              "p99_ms": statistics.median(w["p99_ms"] for w in windows), "windows": windows}
    pathlib.Path(out).parent.mkdir(parents=True, exist_ok=True)
    pathlib.Path(out).write_text(json.dumps(result) + "\n")
    print(", ".join(f"{count} {name}" for name, count in totals.items()))
    for name, verdict in verdicts.items():
        print(f"{name:12} {'passed' if verdict['passed'] else 'FAILED'}  {verdict['figure']}")
    return 0 if all(verdict["passed"] for verdict in verdicts.values()) else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:5]))
