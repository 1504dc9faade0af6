"""Attacks with mixes of frames, one after another on one daemon, beside one healthy session of another client that ticks all the while:

  mixes.py SIGHTLINED STUBS [--first N] [--mixes N] [--seconds S] [--only N...] [--out FILE] [-- FLAGS OF SIGHTLINED]

Each mix floods for some seconds, and connects again when it is cut. Before each one the daemon has a quiet time. A mix is late when it delays the
session by more than 33 ms at the 99th percentile, and by more than three times what the session waited in the quiet times of the last minute, so
that a busy machine does not count. A late mix is played twice more at the end, and counts when it is late each time. Prints a line for each late
one, and the figures of all. The exit status is 1 when a mix counts, when a tick was not answered, or when the memory is not back within 10 % a
minute later.
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
from daemon import HealthyAllAlong

LIMIT_MS, LIMIT_RATIO, SLACK = 33.0, 3.0, 0.10
# After a mix the daemon has some calls and connections to end, which belongs to the attack.
AFTERMATH_S = 0.5
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
    return round(values[min(len(values) - 1, int(share * len(values)))], 2) if values else float("inf")


class Series:
    """Mixes on one daemon, and the quiet times between them."""

    def __init__(self, daemon, options):
        self.daemon, self.options, self.quiet = daemon, options, []
        self.port = int(daemon.address.rsplit(":", 1)[1])
        self.session = HealthyAllAlong(daemon.address)
        self.rest(10)

    def rest(self, seconds):
        begin = time.monotonic()
        time.sleep(seconds)
        self.quiet.append((begin, self.session.waits_ms(begin, begin + seconds)))

    def quiet_ms(self):
        """The round trips of the quiet times of the last minute."""
        return [wait for begin, waits in self.quiet if begin > time.monotonic() - 60 for wait in waits]

    def play(self, number):
        self.rest(self.options.rest)
        begin = time.monotonic()
        row = play(number, self.port, self.options.seconds)
        time.sleep(AFTERMATH_S)
        waits, quiet = self.session.waits_ms(begin, time.monotonic()), percentile(self.quiet_ms(), 0.99)
        row.update(p50_ms=percentile(waits, 0.5), p99_ms=percentile(waits, 0.99), max_ms=percentile(waits, 1), quiet_p99_ms=quiet)
        row["ratio"] = round(row["p99_ms"] / quiet, 2)
        row["late"] = row["p99_ms"] >= LIMIT_MS and row["ratio"] >= LIMIT_RATIO
        if row["late"]:
            print(f"{number:5} p50 {row['p50_ms']} p99 {row['p99_ms']} most {row['max_ms']} ms, {row['ratio']} times the quiet {quiet} ms; "
                  f"{row['sent_mb']} MB on {row['connections']}: {row['what']}", flush=True)
        return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sightlined")
    parser.add_argument("stubs")
    parser.add_argument("--first", type=int, default=1, help="number of the first mix")
    parser.add_argument("--mixes", type=int, default=1000)
    parser.add_argument("--only", type=int, nargs="+", help="numbers of the mixes, instead of the two above")
    parser.add_argument("--seconds", type=float, default=1.0, help="length of each mix")
    parser.add_argument("--rest", type=float, default=1.0, help="length of the quiet time before each mix, in seconds")
    parser.add_argument("--after", type=float, default=60.0, help="seconds from the last mix to the last look at the memory")
    parser.add_argument("--out", help="file for the figures")
    parser.add_argument("flags", nargs="*", help="of sightlined")
    options = parser.parse_args()
    attack.Daemon.path = os.path.abspath(options.sightlined)
    attack.in_containers()
    sys.path.insert(0, options.stubs)
    rows, quiet, failed = run(options)
    counting = [row for row in rows if row["late"]]
    print(f"{len(rows)} mixes: {len(counting)} delayed the session beyond {LIMIT_MS} ms each time; p99 {percentile([r['p99_ms'] for r in rows], 0.5)} ms in the "
          f"median, {percentile([r['p99_ms'] for r in rows], 0.99)} ms at the 99th percentile, {percentile([r['p99_ms'] for r in rows], 1)} at most, and "
          f"{percentile(quiet, 0.99)} ms in all quiet times; {sum(r['sent_mb'] for r in rows):.0f} MB sent{'; ' + failed if failed else ''}")
    if options.out:
        with open(options.out, "w") as file:
            json.dump({"seconds": options.seconds, "failed": failed, "quiet_p99_ms": percentile(quiet, 0.99), "rows": rows}, file, indent=1)
            file.write("\n")
    return 1 if failed or counting else 0


def run(options):
    with attack.Daemon(*options.flags) as daemon:
        series, rows, failures = Series(daemon, options), [], []
        before = daemon.memory_mib()
        for number in options.only or range(options.first, options.first + options.mixes):
            rows.append(series.play(number))
            if daemon.process.poll() is not None:
                return rows, [], f"mix {number} ended the daemon"
        for row in rows:
            row["again"] = [series.play(row["mix"]) for _ in range(2)] if row["late"] else []
            row["late"] = row["late"] and all(again["late"] for again in row["again"])
        result = series.session.result()
        if result["error"] or result["answered"] != result["ticks"]:
            failures.append(f"{result['answered']} of {result['ticks']} ticks answered {result['error']}")
        most = daemon.most_memory_mib()
        time.sleep(options.after)
        after = daemon.memory_mib()
        print(f"memory {before:.0f} MiB, {most:.0f} at most, {after:.0f} after")
        if after > before * (1 + SLACK):
            failures.append(f"the memory is {after:.0f} MiB, and was {before:.0f}")
        return rows, [wait for _, waits in series.quiet for wait in waits], "; ".join(failures)


if __name__ == "__main__":
    sys.exit(main())
