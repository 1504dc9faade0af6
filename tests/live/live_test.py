#!/usr/bin/env python3
"""Plays a game at 60 Hz with each client's LiveCamera while its daemon is away, stopped, killed, and far.

    live_test.py SIGHTLINED STUBS NAME=COMMAND...

Prints the figures by client. The limits of time leave room for a busy machine of two cores; a call that blocks for a second fails.
"""
import concurrent.futures
import pathlib
import socket
import sys
import unittest

HERE = pathlib.Path(__file__).parent
SIGHTLINED, STUBS = sys.argv[1:3]
sys.path[:0] = [STUBS, str(HERE.parent / "conformance"), str(HERE.parent / "fault")]

from daemon import Daemon  # noqa: E402
from game import ANNA, BEN, CRATE, Game, Starting, Stopped, fastest, fastest_turn, opening, places, transforms, xyz  # noqa: E402
from google.protobuf import json_format  # noqa: E402
from players import Player, commands_of  # noqa: E402
from relay import Relay  # noqa: E402
from sightline.v1.errors_pb2 import TickError  # noqa: E402
from sightline.v1.session_pb2 import OpenSession, Tick  # noqa: E402
from sightline_client import Camera  # noqa: E402

PLAYERS = commands_of(sys.argv[3:])
WAIT_S = 0.1
SPARE_S = 0.1  # a call may take so much longer than the wait
FASTEST_MPS, FASTEST_RADPS = 16.0, 3.0  # the seen camera; the targets run at 5 m/s, and the blend adds to that
AT_ONCE = 3  # clients
DAEMONS = ("reply", "predicted")  # the sources of a daemon's camera


def free_address():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return "127.0.0.1:%d" % probe.getsockname()[1]


def sources(frames):
    return [frame.view["source"] for frame in frames]


def refusals(frames):
    return [int(number) for frame in frames for number in frame.view["refusals"]]


class Trial(unittest.TestCase):
    """One client, with a daemon of its own, which is not started yet."""

    def __init__(self, name, *flags):
        super().__init__()
        self.name, self.daemon = name, Daemon(SIGHTLINED, *flags)
        self.daemon.address = free_address()

    def __enter__(self):
        self.player = Player(self.name, PLAYERS[self.name]).__enter__()
        return self

    def __exit__(self, *error):
        try:
            self.player.__exit__(*error)
        finally:
            if self.daemon.process and self.daemon.process.poll() is None:
                self.daemon.stop("kill")
            self.daemon.folder.cleanup()

    def game(self, wait_s=WAIT_S, address=None):
        return Game(self.player, address or self.daemon.address, wait_s)

    def check_calls(self, frames, wait_s=WAIT_S):
        if frames[0].view["sequence"] == 1:  # it also compiles the client under Mono and Node
            self.assertLess(frames[0].view["took_s"], wait_s + 5 * SPARE_S, "the first call")
            frames = frames[1:]
        slowest = max(frames, key=lambda frame: frame.view["took_s"])
        self.assertLess(slowest.view["took_s"], wait_s + SPARE_S, f"a call at {slowest.time_s:.2f} s")

    def check_calm(self, frames):
        self.assertLess(fastest(frames)[0], FASTEST_MPS, f"the camera jumps at {fastest(frames)[1]:.2f} s")
        self.assertLess(fastest_turn(frames)[0], FASTEST_RADPS, f"the camera turns at {fastest_turn(frames)[1]:.2f} s")

    def check_shot(self, frames, edge=1.0):
        worst = max(frames, key=lambda frame: frame.farthest)
        self.assertLess(worst.farthest, edge, f"a target leaves the picture at {worst.time_s:.2f} s ({worst.view['source']})")

    def back_after(self, frames, since_s):
        """How long after the daemon was there the camera is its own again."""
        away = [frame for frame in frames if frame.view["source"] not in DAEMONS]
        self.assertIn(frames[-1].view["source"], DAEMONS)
        return max(away[-1].wall_s - since_s, 0.0) if away else 0.0

    def report(self, what, frames, back_s):
        print(f"{self.name:12} {what:8} longest call {max(f.view['took_s'] for f in frames) * 1e3:4.0f} ms, back after {back_s:4.2f} s, "
              f"farthest target {max(f.farthest for f in frames):4.2f} of the way to the edge, fastest camera {fastest(frames)[0]:4.1f} m/s, "
              f"{fastest_turn(frames)[0]:3.1f} rad/s", flush=True)

    def await_daemon(self, what, game, first):
        starting = Starting(self.daemon)
        while starting.ready_s is None:
            game.play(0.1)
        self.finish(what, game, starting.ready_s, first)

    def finish(self, what, game, since_s, first):
        """The daemon is there: the camera blends back, and keeps the shot. first: of the frames that count."""
        game.play(2.5)
        frames = game.frames[first:]
        back_s = self.back_after(frames, since_s)
        self.report(what, frames, back_s)
        self.assertLess(back_s, 1.5)
        self.assertIn("blend", sources(frames))
        self.assertEqual(0, game.frames[-1].view["age_s"])
        asked = game.frames[0]  # it shows the opening's shot
        self.assertLess(abs(game.frames[-1].distance - asked.distance), 3.0)
        self.assertLess(abs(game.frames[-1].height - asked.height), 0.2)

    def absent_stopped_and_killed(self):
        game = self.game()
        absent = game.play(1.0)  # there is no daemon so far
        self.assertEqual("fallback", absent[-1].view["source"])
        self.assertTrue(absent[-1].view["trouble"])
        self.assertGreater(absent[-1].view["age_s"], 0.8)
        self.assertLess(max(abs(frame.distance - absent[0].distance) for frame in absent), 0.01)
        self.await_daemon("absent", game, 0)

        first = len(game.frames)
        with Stopped(self.daemon):
            stopped = game.play(3.0)
        self.assertEqual("fallback", stopped[-1].view["source"])
        self.assertGreater(sources(stopped).count("fallback"), 2.3 * 60)
        self.assertLess(sum(frame.view["took_s"] > 0.05 for frame in stopped), 5, "only a few calls wait")
        self.finish("stopped", game, game.frames[-1].wall_s, first)

        first = len(game.frames)
        self.daemon.stop("kill")
        game.play(2.0)
        self.assertEqual("fallback", game.frames[-1].view["source"])
        self.await_daemon("killed", game, first)

        self.check_calls(game.frames)
        self.check_calm(game.frames)
        self.check_shot(game.frames)
        closed = game.close()
        self.assertLess(closed["took_s"], 2.0)
        self.assertGreaterEqual(closed["resyncs"], 1)

    def far(self):
        self.daemon.start()
        with Relay(self.daemon.address, delay_s=0.025) as relay:
            game = self.game(0.0, relay.address)
            game.play(5.0)
            # A runtime that compiles as it goes takes longer to open its session on a busy machine.
            opened = sources(game.frames).index("predicted")
            self.assertLess(opened, 3 * 60)
            frames = game.frames[opened:]
            self.report("far", frames, 0.0)
            self.check_calls(frames, 0.0)
            self.check_calm(frames)
            self.check_shot(frames)
            self.assertLess(max(frame.view["age_s"] for frame in frames), 0.3)
            self.assertEqual({"predicted"}, set(sources(frames)))
            game.close()

    def what_waits_is_not_lost(self):
        self.daemon.start()
        game = self.game()
        game.play(0.5)
        first = game.sent
        with Stopped(self.daemon):
            game.play(0.5, changes)
        game.play(1.5)
        late = game.frames[first:]
        self.assertEqual([first + 1 + 12, first + 1 + 20], refusals(late))
        self.assertGreater(int(late[-1].view["reply"]), first + 30)
        self.assertEqual(self.expected_hash(game, first), late[-1].view["hash"])
        game.close()

    def expected_hash(self, game, first):
        """Of a session that got every tick by itself."""
        with Camera.open(self.daemon.address, json_format.ParseDict(opening(), OpenSession())) as camera:
            for number, frame in enumerate(game.frames):
                if number - first in (12, 20):
                    continue  # refused
                extra = changes(number - first) if number - first < 30 else {}
                tick = {"timeS": frame.time_s, "transforms": transforms(places(frame.time_s)), **extra}
                reply = camera.step(json_format.ParseDict(tick, Tick()))
            return str(reply.mirror_hash)

    def a_tick_that_is_too_large(self):
        """It ends the call, and would end the next one too."""
        self.daemon.start()
        game = self.game()
        game.play(0.5)
        game.play(1 / 60, lambda frame: {"delta": {"removedIds": [str(10**6 + i) for i in range(700_000)]}})
        for _ in range(10):  # as long as so large a message takes
            if game.play(1.0)[-1].view["source"] in DAEMONS and refusals(game.frames):
                break
        self.assertEqual([31], refusals(game.frames))
        self.assertEqual([TickError.CODE_RESOURCE_EXHAUSTED], [code for frame in game.frames for code in frame.view["refusal_codes"]])
        self.assertIn(game.frames[-1].view["source"], DAEMONS)
        game.close()

    def a_close_while_the_daemon_is_stopped(self):
        self.daemon.start()
        game = self.game()
        game.play(0.5)
        with Stopped(self.daemon):
            game.play(0.3)
            self.assertLess(game.close()["took_s"], 2.0)

    def no_more_than_4096_kept_ticks(self):
        game = self.game(0.0)  # there is no daemon
        keep = {"settings": {"minDistanceM": 3.0}}
        answers = [self.player.run({"live_tick": {"timeS": frame / 60, **keep}}) for frame in range(4098)]
        self.assertEqual([{"error": "QUEUE_FULL"}] * 2, answers[4096:])
        self.assertNotIn("error", answers[4095])
        self.assertLess(game.close()["took_s"], 2.0)

    def a_wrong_opening(self):
        self.daemon.start()
        wrong = {**opening(), "targets": [{"id": "77"}]}
        self.player.run({"live_open": wrong, "address": self.daemon.address, "wait_s": 5.0})
        self.assertEqual({"error": "NOT_FOUND"}, self.player.run({"live_tick": {"timeS": 0.0}}))
        self.assertEqual({"error": "NOT_FOUND"}, self.player.run({"live_tick": {"timeS": 0.1}}))
        self.player.run({"live_close": {}})


def changes(frame):
    """Fields of a tick, by the number of its frame after the daemon was stopped."""
    crate = {"id": str(CRATE), "shape": {"box": {"halfExtent": xyz((0.5, 0.5, 0.5))}}, "pose": {"position": xyz((9.0, 0.5, 9.0))}}
    turned = {**transforms({ANNA: (1.0, 0.9, 1.0)}), "rotations": [0.0, 0.6, 0.0, 0.8]}
    return {10: {"delta": {"addedInstances": [crate]}}, 12: {"delta": {"removedIds": ["99"]}},
            14: {"transforms": turned}, 16: {"transforms": transforms({BEN: (2.0, 0.9, 2.0), CRATE: (8.0, 0.5, 9.0)})},
            18: {"settings": {"minDistanceM": 3.0}}, 20: {"limits": {"maxSpeedMps": -1.0}}, 22: {"targets": {"targets": [{"id": str(ANNA)}]}},
            24: {"dtS": 0.01}}.get(frame, {})


class LiveTest(unittest.TestCase):
    def each(self, play, *flags):
        """Some clients at once, since most of the time they wait. A failure of one does not keep the others from playing. flags: of the daemon."""
        def run(name):
            with Trial(name, *flags) as trial:
                play(trial)
        with concurrent.futures.ThreadPoolExecutor(AT_ONCE) as pool:
            played = {name: pool.submit(run, name) for name in PLAYERS}
        for name, future in played.items():
            with self.subTest(client=name):
                future.result()

    def test_a_daemon_that_is_absent_stopped_killed_and_started_again(self):
        self.each(Trial.absent_stopped_and_killed)

    def test_a_daemon_that_is_far(self):
        self.each(Trial.far)

    def test_what_waits_is_not_lost(self):
        self.each(Trial.what_waits_is_not_lost)

    def test_a_tick_that_is_too_large_is_refused_and_no_other(self):
        self.each(Trial.a_tick_that_is_too_large)

    def test_so_it_is_where_no_session_can_be_resumed(self):
        self.each(Trial.a_tick_that_is_too_large, "--resume-grace-s", "0")

    def test_a_close_while_the_daemon_is_stopped_ends_in_time(self):
        self.each(Trial.a_close_while_the_daemon_is_stopped)

    def test_no_more_than_4096_ticks_that_are_kept_whole_may_wait(self):
        self.each(Trial.no_more_than_4096_kept_ticks)

    def test_an_opening_that_no_daemon_accepts_is_an_error(self):
        self.each(Trial.a_wrong_opening)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
