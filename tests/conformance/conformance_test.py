#!/usr/bin/env python3
"""Plays the conformance sessions with each client against a daemon.

    conformance_test.py SIGHTLINED STUBS README NAME=COMMAND... [--write] [--slow]

STUBS: the build's folder of generated Python. README: the page with the table of results, which must be up to date; --write brings it up to date.
Each NAME=COMMAND is a client and its player; NAME:base64=COMMAND for one that does not speak JSON. The first one is the reference: the others
must get its replies, bit for bit. --slow: all but the first are played by tests that are labelled slow; with --write, the commit and the date go into their rows.
"""
import base64
import contextlib
import json
import math
import pathlib
import shlex
import subprocess
import sys
import tempfile
import threading
import unittest

HERE = pathlib.Path(__file__).parent
ARGUMENTS = [argument for argument in sys.argv[1:] if not argument.startswith("--")]
SIGHTLINED, STUBS, README = ARGUMENTS[:3]
COMMANDS = dict(argument.split("=", 1) for argument in ARGUMENTS[3:])
IN_BASE64 = [name.removesuffix(":base64") for name in COMMANDS if name.endswith(":base64")]
PLAYERS = {name.removesuffix(":base64"): command for name, command in COMMANDS.items()}
sys.path[:0] = [STUBS, str(HERE), str(HERE.parent / "fault")]

from google.protobuf import json_format  # noqa: E402
from sightline.v1 import errors_pb2, session_pb2  # noqa: E402

import court  # noqa: E402
import expectations  # noqa: E402
import results_table  # noqa: E402
from daemon import Daemon  # noqa: E402
from frames import FRAMES  # noqa: E402
from relay import Relay  # noqa: E402

SESSIONS = {path.stem: json.loads(path.read_text()) for path in sorted((HERE / "sessions").glob("*.json"))}
REQUESTS = {"open": session_pb2.OpenSession, "tick": session_pb2.Tick}
MESSAGES = {"opened": session_pb2.SessionOpened, "camera": session_pb2.CameraReply, "refused": errors_pb2.TickError}
# What differs from play to play.
VARYING = {"opened": ("session_id", "recording_file", "resume_token"), "camera": ("stage_times",), "refused": ()}


def to_base64(command):
    return {name: base64.b64encode(json_format.ParseDict(content, REQUESTS[name]()).SerializeToString()).decode() if name in REQUESTS else content
            for name, content in command.items()}


def from_base64(answer):
    return {name: json_format.MessageToDict(MESSAGES[name].FromString(base64.b64decode(content))) if name in MESSAGES else content
            for name, content in answer.items()}


class Player:
    """A client under test: a program that runs one command a line."""

    def __init__(self, client):
        self.in_base64 = client in IN_BASE64
        self.process = subprocess.Popen(shlex.split(PLAYERS[client]), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def run(self, command):
        return from_base64(self.exchange(to_base64(command))) if self.in_base64 else self.exchange(command)

    def exchange(self, command):
        self.process.stdin.write(json.dumps(command) + "\n")
        self.process.stdin.flush()
        too_late = threading.Timer(60, self.process.kill)
        too_late.start()
        line = self.process.stdout.readline()
        too_late.cancel()
        assert line, f"the player has ended with {self.process.wait()}"
        return json.loads(line)

    def close(self):
        self.process.stdin.close()
        assert self.process.wait(20) == 0, "the player did not end in order"
        self.process.stdout.close()


def play(player, daemon, steps):
    """The answers to all commands of the steps."""
    answers = []
    breaks = any(is_trouble(step) for step in steps)
    with Relay(daemon.address) if breaks else contextlib.nullcontext(daemon) as relay:
        for step in steps:
            if is_trouble(step):
                cause(step, daemon, relay)
                continue
            command = {key: value for key, value in step.items() if key != "expect"}
            if "open" in command:
                command |= {"address": relay.address, "uploads": [str(HERE / "sessions/court.glb")] if "scene" in step["open"] else []}
            answers.append(player.run(command))
    return answers


def is_trouble(step):
    return "daemon" in step or "stream" in step


def cause(step, daemon, relay):
    if "daemon" in step:
        daemon.replace(step["daemon"])
    elif step["stream"] == "cut":
        relay.cut()
    else:
        relay.hurt_next(step["stream"])


def without_minus_zero(value):
    """JavaScript writes -0 as 0."""
    if isinstance(value, dict):
        return {name: without_minus_zero(inner) for name, inner in value.items()}
    if isinstance(value, list):
        return [without_minus_zero(inner) for inner in value]
    return 0.0 if value == 0 and isinstance(value, float) else value


def comparable(answer):
    """An answer without what differs from play to play, read strictly: unknown fields are errors, numbers have their full width."""
    (kind, content), = answer.items()
    if kind not in MESSAGES:
        return answer
    message = json_format.ParseDict(without_minus_zero(content), MESSAGES[kind]())
    for field in VARYING[kind]:
        message.ClearField(field)
    return kind, str(message), message.SerializeToString(deterministic=True)


def position_of(answer):
    return [answer["camera"]["pose"]["position"].get(axis, 0.0) for axis in "xyz"]


def canonical_path(frame, answers):
    return [frame.canonical_point(position_of(answer)) for answer in answers if "camera" in answer]


class Conformance(unittest.TestCase):
    results = {}  # by client and session
    reference = {}  # the answers of the first client, by session

    @classmethod
    def setUpClass(cls):
        cls.daemon = cls.enterClassContext(Daemon(SIGHTLINED))
        cls.first, *cls.others = PLAYERS
        cls.reference = cls.answers_of(cls.first)

    @classmethod
    def answers_of(cls, client):
        """What a client gets, by session."""
        player = Player(client)
        answers = {name: play(player, cls.daemon, content["steps"]) for name, content in SESSIONS.items()}
        player.close()
        return answers

    def test_every_client_gets_what_is_expected_and_what_the_others_get(self):
        for client in PLAYERS:
            answers = self.reference if client == self.first else self.answers_of(client)
            for name, content in SESSIONS.items():
                self.results.setdefault(client, {})[name] = False
                with self.subTest(client=client, session=name):
                    self.check(content["steps"], answers[name], self.reference[name])
                    self.results[client][name] = True

    def check(self, steps, answers, reference):
        steps = [step for step in steps if not is_trouble(step)]
        for step, answer, equal in zip(steps, answers, reference, strict=True):
            trouble = expectations.unmet(step["expect"], answer)
            self.assertEqual([], trouble, f"{json.dumps(step)[:300]}\n{json.dumps(answer)[:1500]}")
            self.assertEqual(comparable(answer), comparable(equal))

    def test_the_same_scene_gives_the_same_path_in_every_convention(self):
        paths = {frame.name: canonical_path(frame, self.reference[f"convention_{frame.name}"]) for frame in FRAMES}
        length = sum(math.dist(a, b) for a, b in zip(paths["gltf"][5:], paths["gltf"][6:]))
        self.assertGreater(length, 0.1, "the camera hardly moves")
        for name, path in paths.items():
            self.assertLess(max(map(math.dist, path, paths["gltf"])), 1e-6, name)

    def test_a_session_that_was_interrupted_goes_on_as_if_nothing_had_been(self):
        player = Player(self.first)
        for name in (name for name, content in SESSIONS.items() if content.get("likeWithoutInterruption")):
            whole = play(player, self.daemon, [step for step in SESSIONS[name]["steps"] if not is_trouble(step)])
            before, fastest = None, SESSIONS[name]["fastest"]
            asked = [step for step in SESSIONS[name]["steps"] if not is_trouble(step)]
            for number, (broken, unbroken) in enumerate(zip(self.reference[name], whole, strict=True)):
                self.assertEqual(list(broken), list(unbroken))
                if "camera" not in broken:
                    continue
                for field in ("sequence", "mirrorHash", "fieldOfView"):
                    self.assertEqual(broken["camera"][field], unbroken["camera"][field], f"answer {number}: {field}")
                self.assertEqual([target["id"] for target in broken["camera"]["targets"]], [target["id"] for target in unbroken["camera"]["targets"]])
                position, time_s = position_of(broken), broken["camera"].get("timeS", 0)
                former, former_s = before or (position, time_s)  # a refused tick may lie between
                by = asked[number].get("tick", {}).get("worldShift", {})
                former = [former[axis] + by.get("xyz"[axis], 0) for axis in range(3)]
                self.assertLess(math.dist(position, former), fastest * (time_s - former_s) + 1e-6, f"answer {number}: farther than the speed limit allows")
                before = position, time_s
        player.close()

    def test_a_session_whose_stream_broke_gets_the_replies_of_an_unbroken_one(self):
        player = Player(self.first)
        for name in (name for name, content in SESSIONS.items() if content.get("equalWithoutInterruption")):
            unbroken = play(player, self.daemon, [step for step in SESSIONS[name]["steps"] if not is_trouble(step)])
            self.assertEqual([comparable(answer) for answer in self.reference[name][:-1]], [comparable(answer) for answer in unbroken[:-1]])
        player.close()

    def test_the_sessions_are_what_the_generator_writes(self):
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([sys.executable, HERE / "make_sessions.py", folder], check=True)
            for made in pathlib.Path(folder).iterdir():
                self.assertEqual(made.read_bytes(), (HERE / "sessions" / made.name).read_bytes(), made.name)

    @classmethod
    def tearDownClass(cls):
        slow = "--slow" in sys.argv
        results = {client: result for client, result in cls.results.items() if not (slow and client == cls.first)}
        results_table.check(README, results, list(SESSIONS), write="--write" in sys.argv, slow=slow)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
