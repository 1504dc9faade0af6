"""The camera at the time of drawing, from replies that come less often and late."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Optional

from sightline.v1.camera_pb2 import Vec3
from sightline.v1.session_pb2 import CameraReply
from sightline_client.rotations import ORIGIN, inverse, minus, plus, product, rotation_of, times, turn_of, unit
from sightline_client.shapes import Quaternion, Vector

FULL_S = 0.15  # a reply's velocities carry the camera on in full for so long
STOP_S = 0.35  # until then they ease out
FADE_S = 0.02  # what a new reply changes fades in with this time constant


@dataclass(frozen=True)
class Sample:
    """A camera that can be drawn. cut: it jumped since the former sample; reset what smooths over frames."""
    position: Vector
    rotation: Quaternion
    field_of_view: float
    cut: bool = False


def carried_s(age_s: float) -> float:
    """For how long a reply's velocities have carried the camera at this age: at most 0.25 s."""
    if age_s <= FULL_S:
        return max(age_s, -FULL_S)
    easing_s = min(age_s, STOP_S) - FULL_S
    return FULL_S + easing_s - easing_s * easing_s / (2 * (STOP_S - FULL_S))


def vector(v: Vec3) -> Vector:
    return (v.x, v.y, v.z)


class _Newest:
    """The part of a reply that the sampler needs."""

    def __init__(self, reply: CameraReply) -> None:
        self.time_s: float = reply.pose_time_s
        self.position = vector(reply.pose.position)
        q = reply.pose.rotation
        self.rotation = unit((q.x, q.y, q.z, q.w))
        self.velocity, self.angular_velocity = vector(reply.velocity), vector(reply.angular_velocity)
        self.field_of_view: float = reply.field_of_view
        self.target_id: int = reply.relative_pose.target_id
        self.target: Optional[Vector] = None  # where the target was
        if self.target_id and reply.relative_pose.HasField("unrotated_pose"):
            self.target = minus(self.position, vector(reply.relative_pose.unrotated_pose.position))

    def at(self, time_s: float, target_position: Optional[Vector]) -> Sample:
        age_s = time_s - self.time_s
        carried = carried_s(age_s)
        position = plus(self.position, times(carried, self.velocity))
        if age_s > FULL_S and target_position is not None and self.target is not None:
            position = plus(position, times(1 - carried / age_s, minus(target_position, self.target)))
        return Sample(position, product(rotation_of(times(carried, self.angular_velocity)), self.rotation), self.field_of_view)


    def shift(self, by: Vector) -> None:
        self.position = plus(self.position, by)
        self.target = plus(self.target, by) if self.target is not None else None


class PoseSampler:
    """Gives the camera at any time from the newest reply, for a renderer that is faster than the replies, or ahead of them. It only computes.

        sampler.add(reply)                                 # each reply, as it comes
        shown = sampler.sample(time_s, target_position)    # each frame: game time, and where sampler.target_id is drawn

    client/SAMPLING.md states the rules.
    """

    def __init__(self) -> None:
        self._sequence = -1
        self._newest: Optional[_Newest] = None
        self._former: Optional[_Newest] = None  # the one of the former sample, while a newer one waits to be shown
        self._cut = False  # a reply since the former sample was a cut
        self._time_s = -math.inf  # of the former sample
        # The remainder that fades away: the former sample minus the newest reply, at _time_s.
        self._shift, self._turn, self._zoom = ORIGIN, ORIGIN, 0.0

    @property
    def target_id(self) -> int:
        """The target whose position `sample` takes; 0: none."""
        return self._newest.target_id if self._newest else 0

    def add(self, reply: CameraReply) -> bool:
        """Takes a reply. False: it is not newer than the newest one, and is ignored."""
        if reply.sequence <= self._sequence:
            return False
        if self._former is None and self._time_s > -math.inf:
            self._former = self._newest
        self._sequence, self._newest = reply.sequence, _Newest(reply)
        self._cut = self._cut or reply.cut
        return True

    def shift(self, by: Vector) -> None:
        """The client's world has a new origin: the replies that were added lie elsewhere now (Tick.world_shift)."""
        for reply in (self._newest, self._former):
            if reply is not None:
                reply.shift(by)

    def sample(self, time_s: float, target_position: Optional[Vector] = None) -> Optional[Sample]:
        """The camera at a game time. target_position: where target_id is at that time; without it, only velocities carry the camera on.
        None: there is no reply so far."""
        newest, former = self._newest, self._former
        if newest is None:
            return None
        self._fade(time_s)
        plain = newest.at(time_s, target_position)
        cut, self._cut, self._former = self._cut, False, None
        if cut:
            self._shift, self._turn, self._zoom = ORIGIN, ORIGIN, 0.0
        elif former is not None:
            before = former.at(time_s, target_position if former.target_id == newest.target_id else None)
            self._shift = plus(self._shift, minus(before.position, plain.position))
            self._turn = turn_of(product(product(rotation_of(self._turn), before.rotation), inverse(plain.rotation)))
            self._zoom += before.field_of_view - plain.field_of_view
        return Sample(plus(plain.position, self._shift), product(rotation_of(self._turn), plain.rotation),
                      plain.field_of_view + self._zoom, cut)

    def _fade(self, time_s: float) -> None:
        passed_s = time_s - self._time_s
        if passed_s > 0:
            left = math.exp(-passed_s / FADE_S)
            self._shift, self._turn, self._zoom = times(left, self._shift), times(left, self._turn), left * self._zoom
            self._time_s = time_s
