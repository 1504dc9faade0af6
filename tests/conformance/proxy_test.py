#!/usr/bin/env python3
"""Each client behind HAProxy, while the daemon that has its session is killed: proxy_test.py SIGHTLINED STUBS NAME=COMMAND...

Three sessions of a client tick 30 times a second. Those of the killed daemon go on in another one, without a jump of the camera, and the
others do not notice. Prints how long the longest gap between two replies was: the table of deploy/haproxy/README.md. The arguments are those
of conformance_test.py, without its README.
"""
import math
import pathlib
import shutil
import sys
import threading
import time
import unittest

HERE = pathlib.Path(__file__).parent
sys.argv.insert(3, "")  # the players' module has its own view of the arguments
from conformance_test import PLAYERS, SIGHTLINED, Player, position_of  # noqa: E402

from daemon import Daemon  # noqa: E402

sys.path.append(str(HERE.parent / "deploy"))
from three_daemons import ThreeDaemons  # noqa: E402

SESSIONS, PERIOD_S = 3, 1 / 30
# A camera at the default limits moves far less between two ticks. A jump to where a new session starts is longer.
FARTHEST_STEP_M = 1.0
PERSON = {"capsule": {"radius": 0.3, "halfHeight": 0.6}}
OPENING = {"camera": {"position": {"y": 1.6, "z": 6.0}}, "targets": [{"id": "1"}, {"id": "2"}],
           "instances": [{"id": "1", "shape": PERSON, "pose": {"position": {"x": -0.6, "y": 0.9}}},
                         {"id": "2", "shape": PERSON, "pose": {"position": {"x": 0.6, "y": 0.9}}}]}


class Game(threading.Thread):
    """A session that ticks until it is stopped."""

    def __init__(self, client, address):
        super().__init__()
        self.player = Player(client)
        self.opened = self.player.run({"open": OPENING, "address": address, "uploads": []})
        self.trouble, self.closed, self.longest_gap_s, self.largest_step_m = None, {}, 0.0, 0.0
        self.going = True

    def run(self):
        last, answered, ticks = None, time.monotonic(), 0
        while self.going:
            time.sleep(PERIOD_S)
            ticks += 1
            x = 3 * math.sin(ticks * PERIOD_S)
            answer = self.player.run({"tick": {"timeS": ticks * PERIOD_S, "transforms": {"ids": ["1", "2"], "positions": [x - 0.6, 0.9, 0, x + 0.6, 0.9, 0]}}})
            if "camera" not in answer:
                self.trouble = answer
                return
            now, here = time.monotonic(), position_of(answer)
            self.longest_gap_s, answered = max(self.longest_gap_s, now - answered), now
            self.largest_step_m, last = max(self.largest_step_m, math.dist(here, last or here)), here
        self.closed = self.player.run({"close": {}})["closed"]

    def end(self):
        self.going = False
        self.join(60)
        self.player.close()


@unittest.skipUnless(shutil.which("haproxy"), "haproxy is not installed")
class Proxied(unittest.TestCase):
    def test_a_session_goes_on_in_another_daemon(self):
        for client in PLAYERS:
            with self.subTest(client), ThreeDaemons(lambda *flags: Daemon(SIGHTLINED, *flags)) as three:
                self.check(client, three)

    def check(self, client, three):
        games = [Game(client, three.address) for _ in range(SESSIONS)]
        self.assertTrue(all("opened" in game.opened for game in games), [game.opened for game in games])
        self.assertEqual([three.sessions_of(i) for i in range(3)], [1, 1, 1], "connections are spread evenly")
        for game in games:
            game.start()
        time.sleep(1)
        three.daemons[0].process.kill()
        three.wait_until_moved(SESSIONS)
        time.sleep(1)
        for game in games:
            game.end()
        self.assertEqual([game.trouble for game in games], [None] * SESSIONS)
        moved = [game for game in games if game.closed["resyncs"]]
        stayed = [game for game in games if not game.closed["resyncs"]]
        self.assertEqual((len(moved), len(stayed)), (1, SESSIONS - 1))
        print(f"| {client} | {moved[0].longest_gap_s:.2f} s | {max(game.longest_gap_s for game in stayed):.2f} s | "
              f"{max(game.largest_step_m for game in games):.2f} m |", flush=True)
        for game in games:
            self.assertLess(game.largest_step_m, FARTHEST_STEP_M)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
