"""Where the targets are, as the game said, and a camera that follows them without a daemon."""
from __future__ import annotations

import math
from typing import Dict, Iterable, List, Mapping, Optional, Tuple

from sightline.v1.scene_pb2 import NewInstance, Target
from sightline.v1.session_pb2 import OpenSession, Tick
from sightline_client.rotations import ORIGIN, minus, plus, times
from sightline_client.sampler import vector
from sightline_client.shapes import Vector

CARRY_S = 0.1  # time constant with which the motion relative to the targets dies away


class TargetPlaces:
    """Follows the positions of the instances and the list of targets."""

    def __init__(self, opening: OpenSession) -> None:
        self._positions: Dict[int, Vector] = {}
        self._weights: List[Tuple[int, float]] = []
        self._add(opening.instances)
        self._choose(opening.targets)

    def shift(self, by: Vector) -> None:
        self._positions = {id_: plus(position, by) for id_, position in self._positions.items()}

    def apply(self, tick: Tick) -> None:
        for id_ in tick.delta.removed_ids:
            self._positions.pop(id_, None)
        self._add(tick.delta.added_instances)
        moved = tick.transforms
        for i, id_ in enumerate(moved.ids):
            place = moved.positions[3 * i:3 * i + 3]
            if len(place) == 3 and all(map(math.isfinite, place)):
                self._positions[id_] = (place[0], place[1], place[2])
        if tick.HasField("targets"):
            self._choose(tick.targets.targets)

    def _add(self, instances: Iterable[NewInstance]) -> None:
        for added in instances:
            self._positions[added.id] = vector(added.pose.position)

    def _choose(self, targets: Iterable[Target]) -> None:
        self._weights = [(target.id, target.weight if target.HasField("weight") else 1.0) for target in targets]

    def position(self, id_: int, drawn: Mapping[int, Vector]) -> Optional[Vector]:
        return drawn.get(id_) or self._positions.get(id_)

    def counted(self) -> List[Tuple[int, float]]:
        """The targets that make up the centre, and their weights."""
        return [(id_, weight) for id_, weight in self._weights if weight > 0 and id_ in self._positions]

    def centre(self, drawn: Mapping[int, Vector]) -> Optional[Vector]:
        """The weighted mean of the targets; drawn: positions that are newer. None: there is none whose position is known."""
        total, mean = 0.0, ORIGIN
        for id_, weight in self.counted():
            position = self.position(id_, drawn)
            if position is not None:
                total, mean = total + weight, plus(mean, times(weight, position))
        return times(1 / total, mean) if total > 0 else None


class Follower:
    """Keeps the camera's place relative to the targets' centre. Its motion relative to them dies away. It turns no more."""

    def __init__(self, offset: Vector, relative_velocity: Vector, time_s: float) -> None:
        self._offset, self._velocity, self._since_s = offset, relative_velocity, time_s

    def at(self, time_s: float, centre: Vector) -> Vector:
        carried_s = CARRY_S * (1 - math.exp(-max(time_s - self._since_s, 0.0) / CARRY_S))
        return plus(plus(centre, self._offset), times(carried_s, self._velocity))


class RecentMotion:
    """The velocity of a point from its last positions. A single jump does not count."""
    STEPS = 5

    def __init__(self) -> None:
        self._last: Optional[Tuple[float, Vector]] = None
        self._velocities: List[Vector] = []

    def add(self, time_s: float, position: Vector) -> None:
        if self._last is not None:
            if time_s <= self._last[0]:
                return
            step = times(1 / (time_s - self._last[0]), minus(position, self._last[1]))
            self._velocities = [*self._velocities[1 - self.STEPS:], step]
        self._last = (time_s, position)

    def shift(self, by: Vector) -> None:
        if self._last is not None:
            self._last = (self._last[0], plus(self._last[1], by))

    def velocity(self) -> Vector:
        """The mean of the last steps without the fastest."""
        slower = sorted(self._velocities, key=lambda step: math.hypot(*step))[:-1]
        mean = ORIGIN
        for step in slower:
            mean = plus(mean, times(1 / len(slower), step))
        return mean
