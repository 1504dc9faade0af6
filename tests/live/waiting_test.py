#!/usr/bin/env python3
"""What each client's LiveCamera sends and shows while its daemon holds its answers back: waiting_test.py STUBS NAME=COMMAND..."""
import contextlib
import math
import sys
import time
import unittest

sys.path.insert(0, sys.argv[1])

from game import opening, xyz  # noqa: E402
from google.protobuf import json_format  # noqa: E402
from held_daemon import HeldDaemon  # noqa: E402
from players import Player, commands_of  # noqa: E402

PLAYERS = commands_of(sys.argv[2:])
TURN = [0.0, 0.6, 0.0, 0.8]


def moved(places, rotations=(), velocities=(), angular_velocities=()):
    return {"ids": [str(id_) for id_ in places], "positions": [value for place in places.values() for value in place],
            "rotations": list(rotations), "velocities": list(velocities), "angularVelocities": list(angular_velocities)}


class Session:
    """A session with an own daemon. Its ticks are numbered from 1."""

    def __init__(self, player, daemon, wait_s):
        self.player, self.daemon = player, daemon
        player.run({"live_open": opening(), "address": daemon.address, "wait_s": wait_s})

    def tick(self, **fields):
        return self.player.run({"live_tick": fields})["view"]

    def until_replies(self):
        """Ticks at 60 Hz until the first answers came and nothing is blended; the game time then."""
        frame = 0
        while self.tick(timeS=frame / 60)["source"] != "reply":
            frame += 1
        return frame / 60

    def sent(self, first):
        return [json_format.MessageToDict(tick) for tick in self.daemon.ticks if tick.sequence >= first]


class Waiting(unittest.TestCase):
    @contextlib.contextmanager
    def session(self, name, wait_s=1.0):
        with self.subTest(client=name), HeldDaemon() as daemon:
            with Player(name, PLAYERS[name]) as player:
                yield Session(player, daemon, wait_s), daemon
                player.run({"live_close": {}})

    def test_ticks_of_places_fold_and_others_are_kept(self):
        for name in PLAYERS:
            with self.session(name) as (session, daemon):
                self.assertEqual("reply", session.tick(timeS=0.0)["source"])
                daemon.hold()
                began = time.monotonic()
                session.tick(timeS=0.1)  # 2: it waits for its answer in vain
                took_s = time.monotonic() - began
                self.assertGreater(took_s, 0.9)
                session.tick(timeS=0.2, dtS=0.02, transforms=moved({1: (1, 0, 0), 2: (2, 0, 0)}, rotations=2 * TURN))
                session.tick(timeS=0.3, transforms=moved({2: (2, 1, 0), 3: (3, 1, 0)}, velocities=[0, 1, 0, 0, 2, 0]))
                session.tick(timeS=0.5, transforms=moved({1: (1, 2, 0)}))
                session.tick(timeS=0.6, settings={"minDistanceM": 3.0})  # 6
                session.tick(timeS=0.7, observedCamera={"pose": {"position": xyz((5.0, 5.0, 5.0))}})
                session.tick(timeS=0.8, transforms=moved({1: (1, 3, 0)}), observedCamera={"pose": {"position": xyz((6.0, 6.0, 6.0))}})
                session.tick(timeS=0.9, observedCamera={"pose": {"position": xyz((7.0, 7.0, 7.0))}, "cut": True})  # 9
                session.tick(timeS=1.0, transforms=moved({1: (1, 4, 0), 2: (2, 4, 0)}) | {"ids": ["1", "1"]})  # 10: a daemon would refuse it
                daemon.let_go()
                daemon.wait_for(10)
                ticks = session.sent(3)
                self.assertEqual([3, 4, 5, 6, 8, 9, 10], [int(tick["sequence"]) for tick in ticks])
                first, second, third, kept, observed, cut, wrong = ticks
                self.assertEqual([0.5] * 3, [tick["timeS"] for tick in ticks[:3]])
                self.assert_near([0.02 + 0.1 + 0.2, 0.0, 0.0], [tick["dtS"] for tick in ticks[:3]])
                self.assert_moved(first, 1, (1, 2, 0), TURN, None)
                self.assert_moved(second, 2, (2, 1, 0), TURN, (0, 1, 0))
                self.assert_moved(third, 3, (3, 1, 0), None, (0, 2, 0))
                self.assertEqual({"minDistanceM": 3.0}, kept["settings"])
                self.assertEqual((6.0, 0.8), (observed["observedCamera"]["pose"]["position"]["x"], observed["timeS"]))
                self.assertNotIn("dtS", observed)
                self.assertTrue(cut["observedCamera"]["cut"])
                self.assertEqual(["1", "1"], wrong["transforms"]["ids"])

    def assert_near(self, expected, got):
        for a, b in zip(expected, got, strict=True):
            self.assertAlmostEqual(a, b, places=6)

    def assert_moved(self, tick, id_, place, rotation, velocity, angular_velocity=None):
        moved = tick["transforms"]
        self.assertEqual([str(id_)], moved["ids"])
        self.assert_near(place, moved["positions"])
        self.assert_near(rotation or [], moved.get("rotations", []))
        self.assert_near(velocity or [], moved.get("velocities", []))
        self.assert_near(angular_velocity or [], moved.get("angularVelocities", []))

    def test_the_newest_angular_velocity_of_each_instance_is_sent(self):
        for name in PLAYERS:
            with self.session(name, wait_s=0.1) as (session, daemon):
                now = session.until_replies()  # game time
                daemon.hold()
                session.tick(timeS=now + 0.1)  # under way
                first = session.tick(timeS=now + 0.2, transforms=moved(
                    {1: (1, 0, 0), 2: (2, 0, 0), 3: (3, 0, 0)}, rotations=3 * TURN, angular_velocities=[0, 1, 0, 0, 2, 0, 0, 3, 0]))["sequence"]
                session.tick(timeS=now + 0.3, transforms=moved(
                    {2: (2, 1, 0), 4: (4, 1, 0)}, velocities=[0, 2, 0, 0, 4, 0], angular_velocities=[2, 0, 0, 4, 0, 0]))
                session.tick(timeS=now + 0.4, transforms=moved({1: (1, 2, 0)}))
                session.tick(timeS=now + 0.5, transforms=moved({1: (1, 3, 0)}))
                session.tick(timeS=now + 0.6, transforms=moved({1: (1, 4, 0)}, angular_velocities=[0, 1]))  # a daemon would refuse it
                session.tick(timeS=now + 0.7, transforms=moved({1: (1, 5, 0)}, angular_velocities=[0, "Infinity", 0]))  # and this one
                daemon.let_go()
                daemon.wait_for(first + 5)
                ticks = session.sent(first)
                self.assertEqual(list(range(first, first + 6)), [int(tick["sequence"]) for tick in ticks])
                self.assert_moved(ticks[0], 1, (1, 3, 0), TURN, None)
                self.assert_moved(ticks[1], 2, (2, 1, 0), TURN, (0, 2, 0), (2, 0, 0))
                self.assert_moved(ticks[2], 3, (3, 0, 0), TURN, None, (0, 3, 0))
                self.assert_moved(ticks[3], 4, (4, 1, 0), None, (0, 4, 0), (4, 0, 0))
                self.assertEqual([0, 1], ticks[4]["transforms"]["angularVelocities"])
                self.assertEqual([0, "Infinity", 0], ticks[5]["transforms"]["angularVelocities"])

    def test_few_ticks_of_many_kinds_go_as_they_came(self):
        for name in PLAYERS:
            with self.session(name, wait_s=0.1) as (session, daemon):
                now = session.until_replies()  # game time
                daemon.hold()
                session.tick(timeS=now + 0.1)  # under way
                first = session.tick(timeS=now + 0.2, transforms=moved(
                    {1: (1, 0, 0), 2: (2, 0, 0)}, rotations=2 * TURN, angular_velocities=[0, 1, 0, 0, 2, 0]))["sequence"]
                session.tick(timeS=now + 0.3, transforms=moved({2: (2, 1, 0), 3: (3, 1, 0)}))
                daemon.let_go()
                daemon.wait_for(first + 1)
                ticks = session.sent(first - 1)
                self.assertEqual([first - 1, first, first + 1], [int(tick["sequence"]) for tick in ticks])
                self.assertEqual([["1", "2"], ["2", "3"]], [tick["transforms"]["ids"] for tick in ticks[1:]])
                self.assertLess(ticks[1]["timeS"], ticks[2]["timeS"])

    def test_the_daemon_hears_what_the_player_sees_and_goes_on_from_there(self):
        for name in PLAYERS:
            with self.session(name) as (session, daemon):
                for frame in range(4):
                    session.tick(timeS=frame / 60, transforms=moved({1: (0, 0.9, 0), 2: (1, 0.9, 0)}))
                daemon.hold()
                views = [session.tick(timeS=0.1 + frame / 60, transforms=moved({1: (frame / 10, 0.9, 0), 2: (1 + frame / 10, 0.9, 0)}))
                         for frame in range(30)]
                self.assertEqual("fallback", views[-1]["source"])
                self.assertAlmostEqual(views[-1]["position"][0] - views[-11]["position"][0], 1.0, places=3)  # with the targets
                self.assertLess(max(view["took_s"] for view in views[1:]), 0.9, "only the first call waits for a second")
                daemon.camera = (9.0, 2.5, 9.0)
                daemon.let_go()
                daemon.wait_for(34)
                observed = daemon.ticks[-1].observed_camera
                for got, shown in zip((observed.pose.position.x, observed.pose.position.y, observed.pose.position.z), views[-1]["position"]):
                    self.assertAlmostEqual(got, shown, places=9)
                self.assertFalse(observed.cut)
                self.assertAlmostEqual(observed.velocity.x, 6.0, delta=0.5)  # the targets' 0.1 m in 1/60 s
                self.blends(session, views[-1], 0.1 + 30 / 60)

    def blends(self, session, last, time_s):
        """From where the fallback was to the daemon's camera, in half a second, smoothly."""
        still = moved({1: (2.9, 0.9, 0), 2: (3.9, 0.9, 0)})
        seen = [last, *(session.tick(timeS=time_s + frame / 60, transforms=still) for frame in range(45))]
        self.assertEqual("blend", seen[2]["source"])
        self.assertEqual("reply", seen[-1]["source"])
        ends = [view["source"] for view in seen].index("reply")
        self.assertTrue(27 <= ends <= 34, ends)
        self.assertAlmostEqual(seen[-1]["position"][0], 9.0, places=6)
        steps = [math.dist(a["position"], b["position"]) for a, b in zip(seen, seen[1:])]
        self.assertLess(max(steps), 1.6 * math.dist(last["position"], seen[-1]["position"]) / 30 + 0.05)

    def test_a_cut_ends_the_fallback_at_once(self):
        for name in PLAYERS:
            with self.session(name) as (session, daemon):
                session.tick(timeS=0.0)
                daemon.hold()
                session.tick(timeS=0.1)
                session.tick(timeS=0.2)
                daemon.camera = (50.0, 2.5, 9.0)
                daemon.let_go()
                daemon.wait_for(3)
                daemon.cut = True
                view = session.tick(timeS=0.3)
                self.assertEqual(([50.0, 2.5, 9.0], True, "reply"), (view["position"], view["cut"], view["source"]))

    def test_a_new_origin_of_the_world_moves_what_is_shown(self):
        for name in PLAYERS:
            with self.session(name, wait_s=0.1) as (session, daemon):
                now = session.until_replies()  # game time
                number = daemon.ticks[-1].sequence
                daemon.hold()
                session.tick(timeS=now + 0.02)  # in the old world
                shown = [session.tick(timeS=now + 0.04, worldShift=xyz((1000.0, 0.0, -50.0)))]
                daemon.answer_one()
                daemon.wait_for(number + 2)
                shown.append(session.tick(timeS=now + 0.06))
                self.assertEqual((number + 1, "predicted"), (shown[-1]["reply"], shown[-1]["source"]))
                time.sleep(0.4)
                shown.append(session.tick(timeS=now + 0.08))
                self.assertEqual("fallback", shown[-1]["source"])
                daemon.let_go()
                daemon.wait_for(number + 4)
                self.assertAlmostEqual(1000.0, daemon.ticks[-1].observed_camera.pose.position.x)
                shown += [session.tick(timeS=now + 0.1 + frame / 60) for frame in range(3)]
                self.assertIn(shown[-1]["source"], ("blend", "reply"))
                for view in shown:
                    self.assert_near((1000.0, 2.5, -41.0), view["position"])

    def test_refusals_come_with_the_next_view_and_change_nothing_else(self):
        for name in PLAYERS:
            with self.session(name) as (session, daemon):
                daemon.refused = {2}
                self.assertEqual([], session.tick(timeS=0.0)["refusals"])
                view = session.tick(timeS=0.1)
                self.assertEqual(([2], 1, "predicted"), (view["refusals"], view["reply"], view["source"]))
                self.assertAlmostEqual(view["age_s"], 0.1)
                view = session.tick(timeS=0.2)
                self.assertEqual(([], 3, "reply", 0), (view["refusals"], view["reply"], view["source"], view["age_s"]))
                self.assertEqual(1, daemon.openings)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
