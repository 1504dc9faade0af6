#!/usr/bin/env python3
"""Writes the vectors that every client's PoseSampler must reproduce: make_vectors.py OUT.json

It states the rules of client/SAMPLING.md a second time, with matrices and sums where the clients have quaternions and a running remainder. It shares no code with them.
"""
import json
import math
import pathlib
import random
import sys

sys.path.insert(0, str(pathlib.Path(__file__).parent.parent / "conformance"))
from frames import minus, multiply, quaternion, transpose, turn  # noqa: E402

FULL_S, STOP_S, FADE_S = 0.15, 0.35, 0.02
IDENTITY = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]


def carried_s(age_s):
    """The area below the share of the velocity that is left: 1 until FULL_S, 0 from STOP_S on, a line between."""
    if age_s <= FULL_S:
        return max(age_s, -FULL_S)
    end = min(age_s, STOP_S)
    return FULL_S + (end - FULL_S) * (1 + (STOP_S - end) / (STOP_S - FULL_S)) / 2


def rotated(vector):
    angle = math.hypot(*vector)
    return turn(vector, angle) if angle > 0 else IDENTITY


def logarithm(m):
    """The turn of a matrix, for angles well below a half turn."""
    twice = [m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]]
    sine, cosine = math.hypot(*twice) / 2, (m[0][0] + m[1][1] + m[2][2] - 1) / 2
    factor = math.atan2(sine, cosine) / (2 * sine) if sine > 0 else 0.5
    return [factor * value for value in twice]


class Reference:
    def __init__(self):
        self.replies, self.shown, self.jumps, self.turn = [], None, [], (0.0, [0, 0, 0])
        self.time_s, self.cut = -math.inf, False

    def add(self, reply):
        if self.replies and reply["sequence"] <= self.replies[-1]["sequence"]:
            return False
        self.replies.append(reply)
        self.cut = self.cut or reply["cut"]
        return True

    def shift(self, by):
        for reply in self.replies:
            reply["position"] = [p + d for p, d in zip(reply["position"], by)]

    @staticmethod
    def carry(reply, time_s, target):
        age_s = time_s - reply["time"]
        seconds = carried_s(age_s)
        position = [p + seconds * v for p, v in zip(reply["position"], reply["velocity"])]
        if target and reply["offset"] and age_s > FULL_S:
            was = minus(reply["position"], reply["offset"])
            position = [p + (1 - seconds / age_s) * (now - then) for p, now, then in zip(position, target, was)]
        return position, multiply(rotated([seconds * w for w in reply["angular"]]), reply["matrix"]), reply["fov"]

    def sample(self, time_s, target):
        if not self.replies:
            return None
        newest, now = self.replies[-1], max(time_s, self.time_s)
        position, matrix, fov = self.carry(newest, time_s, target)
        since, vector = self.turn
        faded = math.exp(-(now - since) / FADE_S)
        left = [faded * value for value in vector]
        if self.cut:
            self.jumps, left = [], [0, 0, 0]
        elif self.shown is not None and self.shown is not newest:
            before, orientation, zoom = self.carry(self.shown, time_s, target if self.shown["target"] == newest["target"] else None)
            self.jumps.append((now, [*minus(before, position), zoom - fov]))
            left = logarithm(multiply(multiply(rotated(left), orientation), transpose(matrix)))
        shift = [sum(math.exp(-(now - then) / FADE_S) * jump[i] for then, jump in self.jumps) for i in range(4)]
        cut, self.cut, self.shown, self.time_s, self.turn = self.cut, False, newest, now, (now, left)
        q = quaternion(multiply(rotated(left), matrix))
        return [*(p + s for p, s in zip(position, shift)), *q, fov + shift[3], cut]


class Story:
    """Makes the steps of one session, with what is expected of each."""

    def __init__(self, seed):
        self.random, self.reference, self.steps = random.Random(seed), Reference(), []
        self.sequence, self.speed, self.spin = 0, 3.0, 0.8

    def vector(self, size):
        return [self.random.uniform(-size, size) for _ in range(3)]

    def reply(self, time_s, *, target=7, sequence=None, cut=False, fov=0.7, offset=True):
        self.sequence = sequence or self.sequence + 1
        place, heading = [math.sin(time_s) * 4, 2.0, math.cos(time_s) * 4], [0.1, self.spin * time_s, 0.05]
        made = {"sequence": self.sequence, "time": time_s, "position": [p + e for p, e in zip(place, self.vector(0.02))],
                "matrix": multiply(rotated(heading), rotated(self.vector(0.01))), "velocity": self.vector(self.speed), "angular": self.vector(self.spin),
                "fov": fov, "offset": self.vector(6.0) if offset else None, "target": target, "cut": cut}
        q = quaternion(made["matrix"])
        message = {"sequence": str(made["sequence"]), "timeS": time_s, "poseTimeS": time_s, "fieldOfView": fov, "cut": cut,
                   "pose": {"position": xyz(made["position"]), "rotation": {**xyz(q[:3]), "w": q[3]}}, "velocity": xyz(made["velocity"]),
                   "angularVelocity": xyz(made["angular"])}
        if offset:
            message["relativePose"] = {"targetId": str(target), "unrotatedPose": {"position": xyz(made["offset"])}}
        self.steps.append({"add": message, "taken": self.reference.add(made)})

    def shift(self, by):
        self.reference.shift(by)
        self.steps.append({"shift": by})

    def draw(self, time_s, target=None):
        self.steps.append({"at": time_s, "target": target, "expect": self.reference.sample(time_s, target)})

    def place(self, time_s):
        return [2 * math.sin(2 * time_s), 1.0, 3 * time_s]

    def play(self, seconds, delay_s, *, replies=lambda frame: True, **more):
        """Replies at 60 Hz that come delay_s late, and pictures at 144 Hz."""
        events = [(frame / 60 + delay_s, 0, frame) for frame in range(round(60 * seconds)) if replies(frame)]
        events += [(picture / 144, 1, picture) for picture in range(round(144 * seconds))]
        for time_s, is_picture, number in sorted(events):
            if is_picture:
                self.draw(time_s, self.place(time_s))
            else:
                self.reply(number / 60, **{name: value(number) for name, value in more.items()})


def xyz(vector):
    return dict(zip("xyz", vector))


def stories():
    for delay_ms in (0, 50, 100):
        story = Story(delay_ms)
        story.play(0.4, delay_ms / 1000)
        yield f"replies {delay_ms} ms late", story
    story = Story(1)
    story.play(0.4, 0.02, cut=lambda frame: frame == 9)
    yield "a cut shows at once", story
    story = Story(2)
    story.draw(0.0)
    story.reply(0.0)
    story.draw(0.01, [1, 2, 3])
    story.reply(1 / 60, cut=True)
    story.reply(2 / 60)
    for picture in range(5):
        story.draw(0.035 + picture / 144, [1, 2, 3])
    yield "a cut between two pictures counts, although a newer reply hides it", story
    story = Story(3)
    story.play(2.0, 0.02, replies=lambda frame: not 15 < frame < 110)
    yield "replies stop, the target carries the camera on, and they come again", story
    story = Story(4)
    story.play(0.6, 0.05, replies=lambda frame: frame < 3 or frame > 28, target=lambda frame: 7 if frame < 30 else 8)
    yield "another target", story
    story = Story(5)
    story.play(0.6, 0.05, replies=lambda frame: frame < 3 or frame > 28, offset=lambda frame: False)
    yield "no target", story
    story = Story(6)
    story.reply(0.0)
    story.draw(0.005)
    for _ in range(3):  # a paused game
        story.reply(1 / 60)
        story.draw(0.02)
        story.draw(0.02)
    story.draw(0.019)  # time never goes back, but a picture may
    story.draw(0.03)
    yield "a pause holds the picture", story
    story = Story(7)
    for sequence in (3, 2, 3, 5, 4, 6):
        story.reply(sequence / 60, sequence=sequence)
        story.draw(0.1 + len(story.steps) / 144, [0, 0, 0])
    yield "old and repeated replies do not count", story
    story = Story(8)
    story.play(0.4, 0.02, fov=lambda frame: 0.7 if frame < 10 else 1.1)
    yield "the lens changes", story
    story = Story(9)
    for frame in range(20):
        story.reply(frame / 60)
        for part in range(3):
            story.draw(frame / 60 - 0.02 + part / 180, [1, 1, frame / 60])
    yield "pictures of a time before the newest reply", story
    story = Story(11)
    story.reply(0.0)
    story.draw(0.01, [1, 2, 3])
    story.reply(1 / 60)
    story.shift([1000.0, -50.0, 3.0])
    for picture in range(12):  # the former reply is shown in part, then the target carries the newest one on
        story.draw(0.03 + picture / 24, [1001 + picture / 10, -48, 6])
    yield "the world has a new origin", story
    story = Story(10)
    story.speed, story.spin = 40.0, 5.0
    story.play(0.5, 0.05)
    yield "a fast camera", story


def main():
    made = [{"name": name, "steps": story.steps} for name, story in stories()]
    text = ",\n".join(json.dumps(story, separators=(",", ":")).replace('{"add"', '\n{"add"').replace('{"at"', '\n{"at"').replace('{"shift"', '\n{"shift"') for story in made)
    pathlib.Path(sys.argv[1]).write_text(f"[{text}]\n")


main()
