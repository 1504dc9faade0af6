"""A game of two runners at 60 Hz, and what is judged of the camera that its player sees."""
import math
import os
import signal
import threading
import time

ANNA, BEN, PILLAR, CRATE = 1, 2, 3, 4
RATE_HZ = 60
HALF_HEIGHT = math.tan(math.radians(40) / 2)  # of the picture, at a distance of 1 m
ASPECT = 16 / 9


def places(time_s):
    """They run a figure of eight at up to 5 m/s, Ben a little behind Anna."""
    def runner(t):
        return (6 * math.sin(0.6 * t), 0.9, 3 * math.sin(1.2 * t))
    x, y, z = runner(time_s - 0.2)
    return {ANNA: runner(time_s), BEN: (x + 1.2, y, z + 0.4)}


def xyz(position):
    return dict(zip("xyz", position))


def opening():
    person = {"capsule": {"radius": 0.3, "halfHeight": 0.6}}
    instances = [{"id": str(id_), "shape": person, "pose": {"position": xyz(place)}} for id_, place in places(0).items()]
    instances.append({"id": str(PILLAR), "shape": {"box": {"halfExtent": xyz((0.5, 2, 0.5))}}, "pose": {"position": xyz((0, 2, -6))}})
    return {"instances": instances, "targets": [{"id": str(ANNA)}, {"id": str(BEN)}], "camera": {"position": xyz((0, 2.5, 9))}}


def transforms(positions):
    return {"ids": [str(id_) for id_ in positions], "positions": [value for place in positions.values() for value in place]}


def picture_place(view, point):
    """Where a point is in the picture: 1 is the edge, across and upwards; None: behind the camera."""
    x, y, z = (a - b for a, b in zip(point, view["position"]))
    a, b, c, w = view["rotation"]
    a, b, c = -a, -b, -c  # into the camera's frame
    s, t, u = 2 * (b * z - c * y), 2 * (c * x - a * z), 2 * (a * y - b * x)
    right, up, back = x + w * s + b * u - c * t, y + w * t + c * s - a * u, z + w * u + a * t - b * s
    return None if back >= 0 else (right / -back / HALF_HEIGHT / ASPECT, up / -back / HALF_HEIGHT)


class Frame:
    def __init__(self, time_s, wall_s, exchange_s, view):
        self.time_s, self.wall_s, self.exchange_s, self.view = time_s, wall_s, exchange_s, view

    @property
    def farthest(self):
        """How far the target that is nearest to the picture's edge is from the middle; 1: it is at the edge."""
        shown = [picture_place(self.view, point) for point in places(self.time_s).values()]
        return max(2.0 if place is None else max(map(abs, place)) for place in shown)

    @property
    def height(self):
        """Where the targets are in the picture, on average; 0 is the middle, -1 the lower edge."""
        shown = [picture_place(self.view, point) for point in places(self.time_s).values()]
        return sum(place[1] for place in shown) / len(shown)

    @property
    def distance(self):
        """From the camera to the middle of the targets."""
        return math.dist(self.view["position"], [sum(values) / 2 for values in zip(*places(self.time_s).values())])


class Game:
    """Plays frames with a player, in real time, and keeps what was seen."""

    def __init__(self, player, address, wait_s):
        self.player, self.frames, self.sent = player, [], 0
        player.run({"live_open": opening(), "address": address, "wait_s": wait_s})
        self.due = time.monotonic()

    def play(self, seconds, extra=lambda frame: {}):
        """extra: other fields of the tick, by the number of the frame from here. Returns the new frames."""
        first = len(self.frames)
        for frame in range(round(seconds * RATE_HZ)):
            time_s = self.sent / RATE_HZ
            time.sleep(max(self.due - time.monotonic(), 0))
            began = time.monotonic()
            answer = self.player.run({"live_tick": {"timeS": time_s, "transforms": transforms(places(time_s)), **extra(frame)}})
            self.frames.append(Frame(time_s, began, time.monotonic() - began, answer["view"]))
            self.sent += 1
            self.due = max(self.due + 1 / RATE_HZ, time.monotonic() - 0.05)
        return self.frames[first:]

    def close(self):
        return self.player.run({"live_close": {}})["live_closed"]


def fastest(frames):
    """The fastest motion of the seen camera in m/s of game time, and when."""
    steps = [(math.dist(a.view["position"], b.view["position"]) / (b.time_s - a.time_s), b.time_s) for a, b in zip(frames, frames[1:])]
    return max(steps)


def fastest_turn(frames):
    """The same of its rotation, in rad/s."""
    def angle(p, q):
        return 2 * math.acos(min(abs(sum(a * b for a, b in zip(p, q))), 1.0))
    return max((angle(a.view["rotation"], b.view["rotation"]) / (b.time_s - a.time_s), b.time_s) for a, b in zip(frames, frames[1:]))


class Stopped:
    """A daemon that SIGSTOP holds."""

    def __init__(self, daemon):
        self.pid = daemon.process.pid

    def __enter__(self):
        os.kill(self.pid, signal.SIGSTOP)
        return self

    def __exit__(self, *_):
        os.kill(self.pid, signal.SIGCONT)


class Starting(threading.Thread):
    """Starts a daemon while the game goes on. ready_s: when it was there, by the wall clock."""

    def __init__(self, daemon):
        super().__init__()
        self.daemon_, self.ready_s = daemon, None
        self.start()

    def run(self):
        self.daemon_.start()
        self.ready_s = time.monotonic()
