"""How much of the network's delay the relative pose takes out of the framing.

    input_delay.py [ADDRESS] [DELAY_MS]

The picture of a frame is drawn with the newest reply that has arrived: the one for the targets of DELAY_MS ago (default: 100). The program
prints how far from their intended places on the screen the targets appear, as shares of the picture's height, and how fast the drawn camera moves
at most, for three ways to use that reply.
"""
import math
import sys

from sightline_client import Camera, Connection, capsule
from sightline.v1.session_pb2 import DEGRADATION_POLICY_NEVER

ADDRESS = sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1:50151"
DELAY = round(float(sys.argv[2] if len(sys.argv) > 2 else 100) * 60 / 1000)  # frames
ANNA, BEN = 1, 2
LAP_S, TURN_S = 2 * math.pi / 0.6, 6.0  # Anna runs a figure of eight at up to 5.1 m/s, then stands and turns to and fro
HALF_HEIGHT = math.tan(math.radians(40) / 2)  # of the picture, at a distance of 1 m


def upright(angle):
    return (0.0, math.sin(angle / 2), 0.0, math.cos(angle / 2))


def runner(t):
    running = min(max(t, 0.0), LAP_S)
    x, z = 6 * math.sin(0.6 * running), 3 * math.sin(1.2 * running)
    heading = math.atan2(math.cos(0.6 * running), math.cos(1.2 * running)) + 1.5 * math.sin(3 * (t - running))
    return (x, 0.9, z), upright(heading)


def places(frame):
    (x, y, z), rotation = runner(frame / 60 - 0.3)  # Ben follows Anna
    return {ANNA: runner(frame / 60), BEN: ((x + 1.5, y, z + 0.5), rotation)}


def turned(q, v):  # v rotated by q
    (x, y, z, w), (a, b, c) = q, v
    s, t, u = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return (a + w * s + y * u - z * t, b + w * t + z * s - x * u, c + w * u + x * t - y * s)


def product(p, q):
    (a, b, c, d), (e, f, g, h) = p, q
    return (d * e + a * h + b * g - c * f, d * f - a * g + b * h + c * e, d * g + a * f - b * e + c * h, d * h - a * e - b * f - c * g)


def plain(pose):
    p, r = pose.position, pose.rotation
    return (p.x, p.y, p.z), (r.x, r.y, r.z, r.w)


def plus(a, b):
    return tuple(x + y for x, y in zip(a, b))


def late(reply, now):  # the pose as it is
    return plain(reply.pose)


def relative(reply, now):  # moves and turns with the target
    offset, rotation = plain(reply.relative_pose.pose)
    position, turn = now[reply.relative_pose.target_id]
    return plus(position, turned(turn, offset)), product(turn, rotation)


def unrotated(reply, now):  # moves with the target
    offset, rotation = plain(reply.relative_pose.unrotated_pose)
    return plus(now[reply.relative_pose.target_id][0], offset), rotation


def on_screen(camera, point):  # in heights of the picture
    (x, y, z), rotation = camera
    right, up, back = turned((*(-v for v in rotation[:3]), rotation[3]), plus(point, (-x, -y, -z)))
    return right / -back / HALF_HEIGHT / 2, up / -back / HALF_HEIGHT / 2


def row(name, way, replies, frames):
    """Means over the frames; a target behind the camera counts as one picture off."""
    errors, cameras = [], []
    for frame in frames:
        sent, now = places(frame - DELAY), places(frame)
        camera = way(replies[frame - DELAY], now)
        cameras.append(camera[0])
        for id_ in (ANNA, BEN):
            intended, drawn = on_screen(late(replies[frame - DELAY], sent), sent[id_][0]), on_screen(camera, now[id_][0])
            errors.append(min(math.dist(intended, drawn), 1.0))
    fastest = max(60 * math.dist(a, b) for a, b in zip(cameras, cameras[1:]))
    return f"{name:<14} {100 * sum(errors) / len(errors):5.1f} % {100 * sorted(errors)[len(errors) * 95 // 100]:6.1f} % {fastest:8.1f} m/s"


def main():
    person, end = capsule(radius=0.3, height=1.8), round(60 * (LAP_S + TURN_S))
    with Camera(ADDRESS, position=(0, 2.5, 9), targets={ANNA: person, BEN: person}, occluders={}, at=places(0),
                degradation_policy=DEGRADATION_POLICY_NEVER, connection=Connection()) as camera:
        replies = [camera.tick(frame / 60, places(frame)) for frame in range(end)]
    lap = round(60 * LAP_S)
    for title, frames in (("Running", range(DELAY, lap)), ("Turning on the spot", range(lap + 60, end))):
        print(f"{title}: pictures {DELAY * 1000 / 60:.0f} ms late\n{'':14} {'mean':>7} {'p95':>7} {'camera':>14}")
        for name, way in (("pose", late), ("relative pose", relative), ("unrotated pose", unrotated)):
            print(row(name, way, replies, frames))


if __name__ == "__main__":
    main()
