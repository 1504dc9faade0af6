"""A game with one session: proxied_session.py ADDRESS. It ticks 30 times a second until its standard input closes. Prints "opened", then one JSON object:
{"ticks", "resyncs", "longest_gap_s" (between two replies), "largest_step_m" (of the camera between two replies)}."""
import json
import math
import select
import sys
import time

from sightline_client import Camera, box, capsule

PERIOD_S = 1 / 30


def places(time_s):
    return {1: (3 * math.sin(time_s) - 0.6, 0.9, 0), 2: (3 * math.sin(time_s) + 0.6, 0.9, 0)}


def main():
    person = capsule(radius=0.3, height=1.8)
    at = {3: (0, 2, 2), **places(0)}
    with Camera(sys.argv[1], position=(0, 1.6, 6), targets={1: person, 2: person}, occluders={3: box(1, 4, 1)}, at=at) as camera:
        print("opened", flush=True)
        ticks, longest_s, largest_m, last = 0, 0.0, 0.0, None
        answered = time.monotonic()
        while not select.select([sys.stdin], [], [], PERIOD_S)[0]:
            ticks += 1
            position = camera.tick(ticks * PERIOD_S, places(ticks * PERIOD_S)).pose.position
            now, here = time.monotonic(), (position.x, position.y, position.z)
            longest_s, answered = max(longest_s, now - answered), now
            largest_m, last = max(largest_m, math.dist(here, last or here)), here
        print(json.dumps({"ticks": ticks, "resyncs": camera.resyncs, "longest_gap_s": round(longest_s, 3), "largest_step_m": round(largest_m, 3)}))


if __name__ == "__main__":
    main()
