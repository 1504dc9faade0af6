"""Attacks with mixes of frames, one after another on one daemon, beside a healthy session of another client:

  mixes.py SIGHTLINED STUBS [--first N] [--mixes N] [--seconds S] [--out FILE] [-- FLAGS OF SIGHTLINED]

Each mix floods for some seconds, and connects again when it is cut. Prints a line for each mix that delayed the healthy session by more than
33 ms at the 99th percentile, and the figures of all. The exit status is 1 when there is such a mix, when a tick was not answered, or when the
memory is not back within 10 % a minute later.
"""
import argparse
import itertools
import json
import os
import socket
import sys
import threading
import time

import daemon as attack

LIMIT_MS, SLACK = 33.0, 0.10
ADDRESSES = itertools.cycle([f"127.0.0.{n}" for n in range(2, 250)])


class Attacker:
    """One connection of a mix after another, from an address of its own."""

    def __init__(self, mix, port, address, end):
        self.mix, self.port, self.address, self.end = mix, port, address, end
        self.sent = self.connections = 0
        self.thread = threading.Thread(target=self.run, daemon=True)
        self.thread.start()

    def run(self):
        while time.monotonic() < self.end:
            try:
                with socket.create_connection(("127.0.0.1", self.port), 2, source_address=(self.address, 0)) as connection:
                    self.connections += 1
                    self.flood(connection)
            except OSError:
                time.sleep(0.01)

    def flood(self, connection):
        from frame_mixes import PREFACE
        connection.sendall(PREFACE)
        reader = threading.Thread(target=drain, args=(connection,), daemon=True)
        reader.start()
        calls = -1
        while time.monotonic() < self.end:
            data, calls = self.mix.round(calls)
            # A round is made in about the time in which it is sent some times, so that the attack is not as slow as Python.
            for _ in range(8):
                if time.monotonic() > self.end:
                    return
                connection.sendall(data)
                self.sent += len(data)


def drain(connection):
    try:
        while connection.recv(65536):
            pass
    except OSError:
        pass


def play(number, port, seconds):
    """Runs one mix. Returns what it was, and how much it sent."""
    from frame_mixes import Mix
    end, mix = time.monotonic() + seconds, Mix(number)
    addresses = [next(ADDRESSES) for _ in range(mix.addresses)]
    attackers = [Attacker(Mix(number), port, addresses[n % mix.addresses], end) for n in range(mix.connections)]
    for attacker in attackers:
        attacker.thread.join(seconds + 5)
    return {"mix": number, "what": str(mix), "sent_mb": round(sum(a.sent for a in attackers) / 1e6, 2),
            "connections": sum(a.connections for a in attackers)}


def percentile(values, share):
    values = sorted(values)
    return round(values[min(len(values) - 1, int(share * len(values)))], 2)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sightlined")
    parser.add_argument("stubs")
    parser.add_argument("--first", type=int, default=1, help="number of the first mix")
    parser.add_argument("--mixes", type=int, default=1000)
    parser.add_argument("--seconds", type=float, default=1.0, help="length of each mix")
    parser.add_argument("--after", type=float, default=60.0, help="seconds from the last mix to the last look at the memory")
    parser.add_argument("--out", help="file for the figures")
    parser.add_argument("flags", nargs="*", help="of sightlined")
    options = parser.parse_args()
    attack.Daemon.path = os.path.abspath(options.sightlined)
    attack.in_containers()
    sys.path.insert(0, options.stubs)
    rows, failed = run(options)
    late = [row for row in rows if row["p99_ms"] is None or row["p99_ms"] >= LIMIT_MS]
    print(f"{len(rows)} mixes: {len(late)} delayed the session beyond {LIMIT_MS} ms; p99 {percentile([r['p99_ms'] or 1e9 for r in rows], 0.5)} ms in the "
          f"median, {percentile([r['p99_ms'] or 1e9 for r in rows], 1)} at most; {sum(r['sent_mb'] for r in rows):.0f} MB sent{'; ' + failed if failed else ''}")
    if options.out:
        with open(options.out, "w") as file:
            json.dump({"seconds": options.seconds, "failed": failed, "rows": rows}, file, indent=1)
            file.write("\n")
    return 1 if failed or late else 0


def run(options):
    from daemon import Daemon, Healthy
    with Daemon(*options.flags) as daemon:
        port = int(daemon.address.rsplit(":", 1)[1])
        Healthy(daemon.address, 2).result()
        before, rows, failures = daemon.memory_mib(), [], []
        for number in range(options.first, options.first + options.mixes):
            healthy = Healthy(daemon.address, options.seconds + 0.2)
            row = play(number, port, options.seconds)
            result = healthy.result()
            row.update({key: result[key] for key in ("p50_ms", "p99_ms", "max_ms", "error")})
            rows.append(row)
            if daemon.process.poll() is not None:
                return rows, f"mix {number} ended the daemon"
            if result["error"] or result["answered"] != result["ticks"]:
                failures.append(f"mix {number}: {result['answered']} of {result['ticks']} ticks answered {result['error']}")
            if failures[-1:] and failures[-1].startswith(f"mix {number}:") or row["p99_ms"] is None or row["p99_ms"] >= LIMIT_MS:
                print(f"{number:5} p50 {row['p50_ms']} p99 {row['p99_ms']} most {row['max_ms']} ms  {row['sent_mb']} MB on {row['connections']}: {row['what']}", flush=True)
        most = daemon.most_memory_mib()
        time.sleep(options.after)
        after = daemon.memory_mib()
        print(f"memory {before:.0f} MiB, {most:.0f} at most, {after:.0f} after")
        if after > before * (1 + SLACK):
            failures.append(f"the memory is {after:.0f} MiB, and was {before:.0f}")
        return rows, "; ".join(failures)


if __name__ == "__main__":
    sys.exit(main())
