"""Ticks that wait for a daemon that is late or away."""
from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Deque, Dict, List, Optional, Tuple

from sightline.v1.scene_pb2 import Transforms
from sightline.v1.session_pb2 import ObservedCamera, Tick
from sightline_client.errors import QueueFull

MOST_WAITING = 4096
MOST_PARTS = 8  # of what is folded: with and without rotation, velocity and angular velocity


@dataclass
class _Place:
    position: Tuple[float, ...]
    rotation: Tuple[float, ...]  # empty: it stays as it is
    velocity: Tuple[float, ...]  # empty: the daemon derives it
    angular_velocity: Tuple[float, ...]  # empty: the daemon derives it


@dataclass
class _Entry:
    """A tick that is kept whole, or several in one that only say where things are."""
    kept: Optional[Tick]
    sequence: int = 0
    time_s: float = 0.0
    dt_s: float = 0.0
    has_dt: bool = False  # some tick said its dt_s
    folded: List[Tick] = field(default_factory=list)  # the first MOST_PARTS
    places: Dict[int, _Place] = field(default_factory=dict)
    observed: Optional[ObservedCamera] = None  # of the newest tick
    suggested: Optional[ObservedCamera] = None  # what the player sees instead of the daemon's camera

    def fold(self, tick: Tick, dt_s: float) -> None:
        self.sequence, self.time_s = tick.sequence, tick.time_s
        self.dt_s += dt_s
        self.has_dt = self.has_dt or tick.HasField("dt_s")
        self.observed = tick.observed_camera if tick.HasField("observed_camera") else None
        if len(self.folded) < MOST_PARTS:
            self.folded.append(tick)
        moved = tick.transforms
        for i, id_ in enumerate(moved.ids):
            rotation = tuple(moved.rotations[4 * i:4 * i + 4])
            if not rotation and id_ in self.places:
                rotation = self.places[id_].rotation
            self.places[id_] = _Place(tuple(moved.positions[3 * i:3 * i + 3]), rotation, tuple(moved.velocities[3 * i:3 * i + 3]),
                                      tuple(moved.angular_velocities[3 * i:3 * i + 3]))

    def ticks(self) -> List[Tick]:
        if self.kept is not None:
            ticks = [self.kept]
        else:
            ticks = self._parts()
        last = ticks[-1]
        if self.observed is not None:
            last.observed_camera.CopyFrom(self.observed)
        elif self.suggested is not None and not last.HasField("observed_camera"):
            last.observed_camera.CopyFrom(self.suggested)
        return ticks

    def _parts(self) -> List[Tick]:
        """A message has rotations for all of its instances or for none, and so with velocities and angular velocities.
        Each part takes the number of a tick. Where there are fewer ticks than parts, the ticks go as they came."""
        kinds: Dict[Tuple[bool, bool, bool], Dict[int, _Place]] = {}
        for id_, place in self.places.items():
            kinds.setdefault((bool(place.rotation), bool(place.velocity), bool(place.angular_velocity)), {})[id_] = place
        if len(kinds) > len(self.folded):
            return self.folded
        parts = [Tick(time_s=self.time_s) for _ in range(max(len(kinds), 1))]
        for i, part in enumerate(parts):
            part.sequence = self.sequence - (len(parts) - 1 - i)
            if self.has_dt:
                part.dt_s = 0.0 if i else self.dt_s
        for part, places in zip(parts, kinds.values()):
            for id_, place in places.items():
                part.transforms.ids.append(id_)
                part.transforms.positions.extend(place.position)
                part.transforms.rotations.extend(place.rotation)
                part.transforms.velocities.extend(place.velocity)
                part.transforms.angular_velocities.extend(place.angular_velocity)
        return parts


def _is_whole(moved: Transforms) -> bool:
    """All numbers are there and finite, and no id comes twice."""
    n = len(moved.ids)
    if len(moved.positions) != 3 * n or len(moved.rotations) not in (0, 4 * n) or len(set(moved.ids)) != n:
        return False
    if len(moved.velocities) not in (0, 3 * n) or len(moved.angular_velocities) not in (0, 3 * n):
        return False
    return all(map(math.isfinite, (*moved.positions, *moved.rotations, *moved.velocities, *moved.angular_velocities)))


class WaitingTicks:
    """Ticks in their order. Those that carry only time and places, and perhaps an observed camera that is no cut, fold into one: the newest
    place counts for each id. Every other tick is kept whole, so that a refusal hits it alone; MOST_WAITING of them may wait."""

    def __init__(self) -> None:
        self._entries: Deque[_Entry] = deque()
        self._time_s: Optional[float] = None  # of the newest tick

    def __len__(self) -> int:
        return len(self._entries)

    def add(self, tick: Tick) -> None:
        """Takes a tick with its number. Raises QueueFull."""
        dt_s = tick.dt_s if tick.HasField("dt_s") else 0.0 if self._time_s is None else tick.time_s - self._time_s
        plain = self._is_plain(tick)
        if not plain or not self._entries or self._entries[-1].kept is not None:
            if len(self._entries) >= MOST_WAITING:
                raise QueueFull(f"{MOST_WAITING} ticks wait for a daemon")
            self._entries.append(_Entry(None if plain else tick))
        if plain:
            self._entries[-1].fold(tick, dt_s)
        self._entries[-1].suggested = None
        self._time_s = tick.time_s

    def suggest(self, observed: ObservedCamera) -> None:
        """Goes with the newest tick as its observed camera, if that tick waits and has none."""
        if self._entries:
            self._entries[-1].suggested = observed

    def take(self) -> List[Tick]:
        """The ticks to send next, each of which gets an answer."""
        return self._entries.popleft().ticks()

    def _is_plain(self, tick: Tick) -> bool:
        """Only a tick that a daemon is likely to take is folded."""
        if tick.observed_camera.cut or not all(map(math.isfinite, (tick.time_s, tick.dt_s))):
            return False
        if tick.dt_s < 0 or (self._time_s is not None and tick.time_s < self._time_s):
            return False
        if not _is_whole(tick.transforms):
            return False
        rest = Tick()
        rest.CopyFrom(tick)
        for name in ("sequence", "time_s", "dt_s", "transforms", "observed_camera"):
            rest.ClearField(name)
        return rest.ByteSize() == 0
