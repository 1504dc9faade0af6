#!/usr/bin/env python3
"""Kills streams and daemons at random while cameras film, and counts.

    fault_test.py SIGHTLINED STUBS [--streams N] [--daemons N] [--stops N] [--floods N] [--sessions N] [--seed N] [--most-wait-s S]
                             [--out FILE]

Each session reaches two daemons through relays of its own. A stream is cut between ticks, before a tick arrives, or before its answer does; its
bytes are corrupted; or its network goes silent. A daemon is killed and started again at its address, or stopped for a while. A flood of calls
that are opened and reset goes to a daemon beside. Every session must go on, and no camera may move farther in a tick than its speed limit
allows. Without --most-wait-s the times are only printed. The counts are printed as JSON, and written to FILE.
"""
import argparse
import json
import os
import pathlib
import random
import signal
import struct
import sys
import threading
import time

HERE = pathlib.Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "conformance")]
sys.path.append(str(HERE.parent / "attack"))  # the last, because conformance has a daemon.py too
parser = argparse.ArgumentParser()
parser.add_argument("sightlined")
parser.add_argument("stubs")
for name, standard in (("streams", 60), ("daemons", 3), ("stops", 1), ("floods", 1), ("sessions", 4), ("seed", 1)):
    parser.add_argument("--" + name, type=int, default=standard)
parser.add_argument("--most-wait-s", type=float)
parser.add_argument("--out", type=pathlib.Path)
OPTIONS = parser.parse_args()
sys.path.insert(0, OPTIONS.stubs)

import importlib.util  # noqa: E402

from daemon import Daemon  # noqa: E402
from filmed import Filmed  # noqa: E402
from relay import Relay  # noqa: E402
from waits import too_long  # noqa: E402

spec = importlib.util.spec_from_file_location("attack_daemon", HERE.parent / "attack" / "daemon.py")
attack = importlib.util.module_from_spec(spec)
spec.loader.exec_module(attack)

# How often each thing befalls a stream, relative to the others. A silent network costs a client its reply timeout.
STREAM_FAULTS = {"cut": 30, "lose request": 30, "lose reply": 20, "corrupt": 19, "silent": 1}
BETWEEN_STREAM_FAULTS_S = 0.03
SETTLING_S = 1.0
STOP_S = 1.5
FLOOD_S = 1.0


class Network:
    """The relays of one session, one to each daemon."""

    def __init__(self, daemons):
        self.relays = [Relay(daemon.address) for daemon in daemons]
        self.addresses = [relay.address for relay in self.relays]

    def hurt(self, how):
        for relay in self.relays:
            if how == "cut":
                relay.cut()
            elif how == "silent":
                relay.forget()
            else:
                relay.hurt_next(how)

    def close(self):
        for relay in self.relays:
            relay.close()


def flood(address):
    attacker = attack.RawConnection(address)

    def make():
        frames = b""
        for _ in range(64):
            stream, call = attacker.call(attack.CONTROL)
            frames += call + attack.frame(attack.RST_STREAM, 0, stream, struct.pack(">I", 8))
        return frames
    attack.flood(attacker, make, FLOOD_S)


def wait_for_resume(session, lost, seconds=60):
    """Until the session has met the fault and gone on."""
    end = time.monotonic() + seconds
    while session.is_alive() and session.resumes + session.resyncs <= lost:
        if time.monotonic() > end:
            return False
        time.sleep(0.005)
    return session.is_alive()


def kill_streams(sessions, networks, chance, counts):
    """Each session meets one fault after the other, all sessions at the same time."""
    left = [OPTIONS.streams]
    lock = threading.Lock()

    def befall(session, network, chance):
        while True:
            with lock:
                if left[0] == 0:
                    return
                left[0] -= 1
            how = chance.choices(list(STREAM_FAULTS), STREAM_FAULTS.values())[0]
            time.sleep(chance.uniform(0, 2 * BETWEEN_STREAM_FAULTS_S))
            lost = session.resumes + session.resyncs
            session.fault = how
            network.hurt(how)
            if not wait_for_resume(session, lost):
                session.troubles.append(f"the stream did not come back after: {how}")
                return
            with lock:
                counts[how] = counts.get(how, 0) + 1

    threads = [threading.Thread(target=befall, args=(session, network, random.Random(chance.random())))
               for session, network in zip(sessions, networks, strict=True)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()


def hurt_daemons(sessions, daemons, counts):
    def befalls(fault):
        for session in sessions:
            session.fault = fault
    for number in range(OPTIONS.daemons):
        befalls("daemon killed")
        daemons[number % 2].replace("kill")
        counts["daemon killed"] = number + 1
        time.sleep(SETTLING_S)
    for number in range(OPTIONS.stops):
        process = daemons[number % 2].process
        befalls("daemon stopped")
        process.send_signal(signal.SIGSTOP)
        time.sleep(STOP_S)
        process.send_signal(signal.SIGCONT)
        counts["daemon stopped"] = number + 1
        time.sleep(SETTLING_S)
    for number in range(OPTIONS.floods):
        befalls("flood")
        flood(daemons[number % 2].address)
        counts["flood"] = number + 1
    time.sleep(SETTLING_S)


def share(values, part):
    return sorted(values)[min(len(values) - 1, int(part * len(values)))] if values else 0.0


def verdict(sessions, counts):
    """Prints the counts. Returns what went wrong."""
    waits = [wait for session in sessions for wait in session.waits]
    late = too_long(waits, OPTIONS.most_wait_s, sessions[0].connection.reply_timeout_s)
    trouble = [text for session in sessions for text in session.troubles + session.jumps]
    trouble += [f"a tick waited for {wait.seconds:.2f} s; fault: {wait.fault}" for wait in late]
    killed = sum(counts.get(how, 0) for how in STREAM_FAULTS)
    if killed != OPTIONS.streams:
        trouble.append(f"only {killed} of {OPTIONS.streams} streams were killed")
    report = json.dumps({"faults": counts, "sessions": len(sessions), "ticks": sum(session.ticks for session in sessions),
                         "resumed": sum(session.resumes for session in sessions), "opened_again": sum(session.resyncs for session in sessions),
                         "jumps": sum(len(session.jumps) for session in sessions), "late": len(late), "most_wait_s": OPTIONS.most_wait_s,
                         "wait_ms": {name: round(1e3 * share([wait.seconds for wait in waits], part)) for name, part in (("p50", 0.5), ("p99", 0.99), ("max", 1.0))},
                         "cpus": os.cpu_count(), "passed": not trouble})
    print(report)
    if OPTIONS.out:
        OPTIONS.out.write_text(report + "\n")
    return trouble


def main():
    chance = random.Random(OPTIONS.seed)
    counts = {}
    # The machine may be busy with other tests, so steps may take as long as they like.
    flags = ("--max-maps-ms", "0", "--max-sessions", "100", "--max-sessions-per-client", "100", "--max-connections-per-client", "200")
    with Daemon(OPTIONS.sightlined, *flags) as first, Daemon(OPTIONS.sightlined, *flags) as second:
        networks = [Network((first, second)) for _ in range(OPTIONS.sessions)]
        sessions = [Filmed(network.addresses, number) for number, network in enumerate(networks)]
        for session in sessions:
            session.start()
        for session in sessions:
            session.opened.wait(60)
        kill_streams(sessions, networks, chance, counts)
        hurt_daemons(sessions, (first, second), counts)
        for session in sessions:
            session.stop()
        for network in networks:
            network.close()
    trouble = verdict(sessions, counts)
    print("\n".join(trouble[:50]))
    sys.exit(1 if trouble else 0)


if __name__ == "__main__":
    main()
