"""The camera that the player sees: the replies as sampled, a camera that follows the targets while none come, and the way back."""
from __future__ import annotations

import enum
import math
from dataclasses import dataclass, replace
from typing import List, Mapping, Optional, Tuple

from sightline.v1.camera_pb2 import Pose3, Quat, Vec3
from sightline.v1.session_pb2 import CameraReply, ObservedCamera, OpenSession, Tick
from sightline_client.following import Follower, RecentMotion, TargetPlaces
from sightline_client.rotations import ORIGIN, inverse, minus, plus, product, rotation_of, times, turn_of, unit
from sightline_client.sampler import PoseSampler, Sample, vector
from sightline_client.shapes import Vector

class Source(enum.Enum):
    """The origin of a shown pose."""
    REPLY = "reply"  # the daemon's answer to this tick
    PREDICTED = "predicted"  # an earlier answer, brought up to date
    FALLBACK = "fallback"  # no daemon answers: the camera keeps its place relative to the targets
    BLEND = "blend"  # the way from the fallback to the daemon's camera


@dataclass
class _Blend:
    """The fallback's pose minus the daemon's, where they met."""
    since_s: float
    shift: Vector
    turn: Vector
    zoom: float

    def left(self, time_s: float, blend_s: float) -> float:
        x = min(max((time_s - self.since_s) / blend_s, 0.0), 1.0) if blend_s > 0 else 1.0
        return 1 - x * x * (3 - 2 * x)


class Display:
    """No clock and no network: time_s is the game's, and the caller says whether the daemon is silent."""

    def __init__(self, opening: OpenSession, blend_s: float) -> None:
        self.places = TargetPlaces(opening)
        self.newest: Optional[CameraReply] = None
        self._blend_s = blend_s
        self._sampler = PoseSampler()  # of the replies that count: while there is a follower, those that end the fallback
        q = opening.camera.rotation
        rotation = unit((q.x, q.y, q.z, q.w)) if opening.camera.HasField("rotation") else (0.0, 0.0, 0.0, 1.0)
        self._shown = Sample(vector(opening.camera.position), rotation, opening.lens.field_of_view)
        self._shown_s = 0.0
        self._centre = self.places.centre({})  # of the targets when that was shown
        self._offsets: Tuple[Tuple[float, Vector], ...] = ()  # the camera minus the centre at the last two times
        # There is no reply so far, so the camera follows from the start.
        offset = minus(self._shown.position, self._centre) if self._centre is not None else ORIGIN
        self._follower: Optional[Follower] = Follower(offset, ORIGIN, 0.0)
        self._has_followed = False  # since the follower began, it was shown
        self._counts_from = 0  # replies to ticks from this number on end the fallback
        self._blend: Optional[_Blend] = None
        self._shifts: List[Tuple[int, Vector]] = []  # of the world, by ticks that no reply covers so far
        self._motion = RecentMotion()

    @property
    def follows(self) -> bool:
        return self._follower is not None

    def take_tick(self, tick: Tick) -> None:
        if tick.HasField("world_shift"):
            self._shift_world(tick.sequence, vector(tick.world_shift))
        before = self.places.counted()
        self.places.apply(tick)
        if self.places.counted() != before:  # the centre may jump, and the camera must not
            self._centre, self._offsets = self.places.centre({}), ()
            if self._follower is not None and self._centre is not None:
                self._follower = Follower(minus(self._shown.position, self._centre), ORIGIN, tick.time_s)

    def _shift_world(self, sequence: int, by: Vector) -> None:
        self._shifts.append((sequence, by))
        self._shown = replace(self._shown, position=plus(self._shown.position, by))
        self._centre = plus(self._centre, by) if self._centre is not None else None
        for part in (self.places, self._sampler, self._motion):
            part.shift(by)

    def _in_this_world(self, reply: CameraReply) -> CameraReply:
        """The reply where the world has been shifted since its tick."""
        self._shifts = [(sequence, by) for sequence, by in self._shifts if sequence > reply.sequence]
        moved = CameraReply()
        moved.CopyFrom(reply)
        for _, (x, y, z) in self._shifts:
            position = moved.pose.position
            position.x, position.y, position.z = position.x + x, position.y + y, position.z + z
        return moved

    def take_reply(self, reply: CameraReply) -> None:
        self.newest = reply
        if self._follower is None or reply.sequence >= self._counts_from:
            self._sampler.add(self._in_this_world(reply))

    def follow(self, counts_from: int) -> None:
        """The daemon is silent. counts_from: the first tick whose reply ends the fallback."""
        if self._follower is None:
            offset = minus(self._shown.position, self._centre) if self._centre is not None else ORIGIN
            self._follower, self._has_followed = Follower(offset, self._relative_velocity(), self._shown_s), False
        elif self._counts_from > 0:
            return
        self._counts_from, self._sampler, self._blend = counts_from, PoseSampler(), None

    def _relative_velocity(self) -> Vector:
        """No faster than the camera of the newest reply: targets that are put elsewhere do not throw it."""
        if len(self._offsets) < 2 or self.newest is None:
            return ORIGIN
        (start_s, start), (end_s, end) = self._offsets[0], self._offsets[-1]
        velocity = times(1 / (end_s - start_s), minus(end, start))
        most, speed = math.hypot(*vector(self.newest.velocity)), math.hypot(*velocity)
        return velocity if speed <= most else times(most / speed, velocity)

    def show(self, time_s: float, drawn: Mapping[int, Vector]) -> Tuple[Sample, Source]:
        """The camera at a game time. drawn: positions of targets at that time, if they are newer than the newest tick."""
        centre = self.places.centre(drawn)
        followed = self._followed(time_s, centre)
        daemon = self._sampler.sample(time_s, self.places.position(self._sampler.target_id, drawn))
        if daemon is not None:
            if followed is not None:
                self._go_back(followed, daemon, time_s)
            sample, source = self._blended(daemon, time_s)
        elif followed is not None:
            sample, source, self._has_followed = followed, Source.FALLBACK, True
        else:
            raise AssertionError("there is a follower until there is a reply")
        self._remember(sample, time_s, centre)
        return sample, source

    def _followed(self, time_s: float, centre: Optional[Vector]) -> Optional[Sample]:
        if self._follower is None:
            return None
        position = self._shown.position if centre is None else self._follower.at(time_s, centre)
        return Sample(position, self._shown.rotation, self._shown.field_of_view)

    def _go_back(self, followed: Sample, daemon: Sample, time_s: float) -> None:
        self._follower = None
        if not self._has_followed:
            return
        turn = turn_of(product(followed.rotation, inverse(daemon.rotation)))
        self._blend = _Blend(time_s, minus(followed.position, daemon.position), turn, followed.field_of_view - daemon.field_of_view)

    def _blended(self, daemon: Sample, time_s: float) -> Tuple[Sample, Source]:
        blend = self._blend
        left = blend.left(time_s, self._blend_s) if blend is not None and not daemon.cut else 0.0
        if blend is None or left == 0:
            self._blend = None
            return daemon, Source.PREDICTED
        return Sample(plus(daemon.position, times(left, blend.shift)), product(rotation_of(times(left, blend.turn)), daemon.rotation),
                      daemon.field_of_view + left * blend.zoom), Source.BLEND

    def _remember(self, sample: Sample, time_s: float, centre: Optional[Vector]) -> None:
        self._shown, self._shown_s, self._centre = sample, time_s, centre
        self._motion.add(time_s, sample.position)
        if centre is None or sample.cut:
            self._offsets = ()
        if centre is not None and (not self._offsets or time_s > self._offsets[-1][0]):
            self._offsets = (*self._offsets[-1:], (time_s, minus(sample.position, centre)))

    def observed(self) -> ObservedCamera:
        """The camera that the player sees, so that the daemon goes on from it."""
        (x, y, z), (a, b, c, d), (u, v, w) = self._shown.position, self._shown.rotation, self._motion.velocity()
        return ObservedCamera(pose=Pose3(position=Vec3(x=x, y=y, z=z), rotation=Quat(x=a, y=b, z=c, w=d)), velocity=Vec3(x=u, y=v, z=w))
