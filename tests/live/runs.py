"""A session whose targets run round corners, the camera without delay at any time of it, and what a shown camera does to the picture."""
import bisect
import math

from game import ANNA, BEN, HALF_HEIGHT
from sightline.v1.camera_pb2 import Convention
from sightline.v1.session_pb2 import DEGRADATION_POLICY_NEVER
from sightline_client import Camera, box, capsule

RATE_HZ, SECONDS = 60, 14
CORNERS = [(0, 0), (6, 0), (6, 5), (-2, 5), (-2, -4), (5, -4), (5, 1), (0, 0)]
SPEED_MPS, STOP_S = 4.5, 0.7  # between the corners, and at each of them
LINES = 1080


def runner(time_s):
    left_s = max(time_s, 0.0)
    for (a, b), (c, d) in zip(CORNERS, CORNERS[1:]):
        leg_s = math.dist((a, b), (c, d)) / SPEED_MPS
        if left_s < leg_s + STOP_S:
            share = min(left_s / leg_s, 1.0)
            return (a + (c - a) * share, 0.9, b + (d - b) * share)
        left_s -= leg_s + STOP_S
    return (CORNERS[-1][0], 0.9, CORNERS[-1][1])


def places(time_s):
    x, y, z = runner(time_s - 0.3)
    return {ANNA: runner(time_s), BEN: (x + 1.5, y, z + 0.5)}


def mirrored(place):
    """Unity's x is minus glTF's x."""
    return (-place[0], *place[1:])


def play(address, unity=False):
    """The replies of a session in glTF's frame, or in Unity's, which is left-handed."""
    person, across = capsule(radius=0.3, height=1.8), mirrored if unity else tuple
    occluders = {10: box(1, 4, 1), 11: box(1, 4, 1), 12: box(4, 3, 0.3)}
    at = {10: (3, 2, 2), 11: (-3, 2, -1), 12: (1, 1.5, -3), **places(0)}
    preset = Convention.PRESET_UNITY if unity else Convention.PRESET_GLTF
    looks = (0, 1, 0, 0) if unity else (0, 0, 0, 1)  # along -z in both
    with Camera(address, position=((0, 2.5, 9), looks), targets={ANNA: person, BEN: person}, occluders=occluders,
                at={id_: across(place) for id_, place in at.items()}, degradation_policy=DEGRADATION_POLICY_NEVER,
                convention=Convention(preset=preset)) as camera:
        return [camera.tick(frame / RATE_HZ, {id_: across(place) for id_, place in places(frame / RATE_HZ).items()})
                for frame in range(RATE_HZ * SECONDS)]


def xyz(v):
    return (v.x, v.y, v.z)


def rotation(reply):
    q = reply.pose.rotation
    return (q.x, q.y, q.z, q.w)


class Ideal:
    """The camera without delay: the replies, each at its own time, and a smooth way between them."""

    def __init__(self, replies):
        self.replies, self.times = replies, [reply.time_s for reply in replies]

    def at(self, time_s):
        i = min(max(bisect.bisect_right(self.times, time_s) - 1, 0), len(self.times) - 2)
        a, b = self.replies[i:i + 2]
        step_s = b.time_s - a.time_s
        x = (time_s - a.time_s) / step_s
        weights = (2 * x**3 - 3 * x * x + 1, (x**3 - 2 * x * x + x) * step_s, 3 * x * x - 2 * x**3, (x**3 - x * x) * step_s)  # Hermite's
        parts = xyz(a.pose.position), xyz(a.velocity), xyz(b.pose.position), xyz(b.velocity)
        position = [sum(weight * part[k] for weight, part in zip(weights, parts)) for k in range(3)]
        return position, between(rotation(a), rotation(b), x)


def between(p, q, share):
    """The rotation on the way from p to q."""
    cosine = sum(a * b for a, b in zip(p, q))
    if cosine < 0:
        q, cosine = [-value for value in q], -cosine
    angle = math.acos(min(cosine, 1.0))
    if angle < 1e-7:
        return q
    return [(math.sin((1 - share) * angle) * a + math.sin(share * angle) * b) / math.sin(angle) for a, b in zip(p, q)]


def line_place(position, q, point):
    """Where a point is in the picture, in lines from its middle."""
    x, y, z = (a - b for a, b in zip(point, position))
    a, b, c, w = -q[0], -q[1], -q[2], q[3]  # into the camera's frame
    s, t, u = 2 * (b * z - c * y), 2 * (c * x - a * z), 2 * (a * y - b * x)
    right, up, back = x + w * s + b * u - c * t, y + w * t + c * s - a * u, z + w * u + a * t - b * s
    depth = max(-back, 0.1)
    return (right / depth / HALF_HEIGHT * LINES / 2, up / depth / HALF_HEIGHT * LINES / 2)
