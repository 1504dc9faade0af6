"""Arithmetic of vectors and rotations. A quaternion is (x, y, z, w); a turn is a vector along its axis, as long as its angle in radians.

The same formulae hold in right-handed and in left-handed frames, because the contract states turns by the frame's own rule.
"""
from __future__ import annotations

import math

from sightline_client.shapes import Quaternion, Vector

ORIGIN: Vector = (0.0, 0.0, 0.0)


def plus(a: Vector, b: Vector) -> Vector:
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def minus(a: Vector, b: Vector) -> Vector:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def times(factor: float, a: Vector) -> Vector:
    return (factor * a[0], factor * a[1], factor * a[2])


def product(p: Quaternion, q: Quaternion) -> Quaternion:
    """The rotation that turns by q first, then by p."""
    (a, b, c, d), (e, f, g, h) = p, q
    return (d * e + a * h + b * g - c * f, d * f - a * g + b * h + c * e, d * g + a * f - b * e + c * h, d * h - a * e - b * f - c * g)


def inverse(q: Quaternion) -> Quaternion:
    return (-q[0], -q[1], -q[2], q[3])


def unit(q: Quaternion) -> Quaternion:
    length = math.hypot(*q)
    return (q[0] / length, q[1] / length, q[2] / length, q[3] / length) if length > 0 else (0.0, 0.0, 0.0, 1.0)


def rotation_of(turn: Vector) -> Quaternion:
    angle = math.hypot(*turn)
    share = math.sin(angle / 2) / angle if angle > 1e-9 else 0.5
    return (share * turn[0], share * turn[1], share * turn[2], math.cos(angle / 2))


def turn_of(q: Quaternion) -> Vector:
    """The shorter way: at most half a turn."""
    sign = -1.0 if q[3] < 0 else 1.0
    length = math.hypot(q[0], q[1], q[2])
    share = 2 * math.atan2(length, sign * q[3]) / length if length > 1e-9 else 2.0
    return times(sign * share, (q[0], q[1], q[2]))
