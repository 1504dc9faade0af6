#!/usr/bin/env python3
"""How soon a daemon that is asked to stop says so: stop_times.py SIGHTLINED STUBS [RUNS].

Prints the times from SIGTERM to NOT_SERVING on a Watch call of grpc.health.v1, and to the drain message on the stream of an open session. The
exit status is 1 when one of them is 100 ms or more. Run it on an idle machine.
"""
import pathlib
import signal
import sys
import threading
import time

SIGHTLINED, STUBS = sys.argv[1:3]
RUNS = int(sys.argv[3]) if len(sys.argv) > 3 else 20
MOST_MS = 100.0
sys.path[:0] = [STUBS, str(pathlib.Path(__file__).parents[1] / "attack")]

import grpc  # noqa: E402
from daemon import HEALTH, Daemon  # noqa: E402
from sessions import open_session  # noqa: E402

NOT_SERVING = b"\x08\x02"
Daemon.path = SIGHTLINED


def times_of_one_stop():
    """Milliseconds to NOT_SERVING and to the drain message."""
    seen = {}
    with Daemon() as daemon, grpc.insecure_channel(daemon.address) as channel:
        session = open_session(daemon.address)
        session.tick()
        watch = channel.unary_stream(HEALTH + "Watch")(b"")
        next(watch)

        def look(name, wait):
            wait()
            seen[name] = time.monotonic()
        threads = [threading.Thread(target=look, args=("not serving", lambda: next(answer for answer in watch if answer == NOT_SERVING))),
                   threading.Thread(target=look, args=("drain", session.waits_for_drain))]
        for thread in threads:
            thread.start()
        asked = time.monotonic()
        daemon.process.send_signal(signal.SIGTERM)
        for thread in threads:
            thread.join(20)
        session.close()
        daemon.process.wait(20)
    return {name: 1e3 * (at - asked) for name, at in seen.items()}


def main():
    runs = [times_of_one_stop() for _ in range(RUNS)]
    late = False
    for name in ("not serving", "drain"):
        times = sorted(run.get(name, float("inf")) for run in runs)
        print(f"{name}: {times[len(times) // 2]:.1f} ms in the median, {times[-1]:.1f} ms at most, of {RUNS} stops")
        late = late or times[-1] >= MOST_MS
    return 1 if late else 0


sys.exit(main())
