"""Short ways to write shapes, places, openings and ticks.

A place is a position (x, y, z), or a pair of a position and a rotation, ((x, y, z), (qx, qy, qz, qw)).
"""
from __future__ import annotations

import math
from typing import Any, Mapping, Optional, Sequence, Tuple, Union

from sightline.v1.camera_pb2 import Pose3, Quat, Vec3
from sightline.v1.scene_pb2 import NewInstance, Shape, Target, Transforms
from sightline.v1.session_pb2 import OpenSession, Tick

Vector = Tuple[float, float, float]
Quaternion = Tuple[float, float, float, float]
Place = Union[Vector, Tuple[Vector, Quaternion]]


def _vector(values: Sequence[float]) -> Vec3:
    return Vec3(x=values[0], y=values[1], z=values[2])


def _split(place: Place) -> Tuple[Vector, Optional[Quaternion]]:
    if len(place) == 2:
        return place
    return place, None


def pose(place: Place) -> Pose3:
    position, rotation = _split(place)
    if rotation is None:
        return Pose3(position=_vector(position))
    x, y, z, w = rotation
    return Pose3(position=_vector(position), rotation=Quat(x=x, y=y, z=z, w=w))


def box(width: float, height: float, depth: float) -> Shape:
    """Whole sizes along x, y and z. A ground or a wall is a flat box. Like every shape, it is centred on the place of its instance."""
    return Shape(box=Shape.Box(half_extent=_vector((width / 2, height / 2, depth / 2))))


def sphere(radius: float) -> Shape:
    return Shape(sphere=Shape.Sphere(radius=radius))


def capsule(radius: float, height: float) -> Shape:
    """An upright capsule; `height` is from end to end."""
    return Shape(capsule=Shape.Capsule(radius=radius, half_height=height / 2 - radius))


def along(start: Vector, end: Vector) -> Place:
    """The place of a capsule that lies along a bone: its middle is between the two joints, and its axis leads from one to the other. For
    conventions with +Y up. The capsule's height is the bone's length plus twice the radius."""
    middle = ((start[0] + end[0]) / 2, (start[1] + end[1]) / 2, (start[2] + end[2]) / 2)
    x, y, z = end[0] - start[0], end[1] - start[1], end[2] - start[2]
    w = math.hypot(x, y, z) + y  # half way between up and the bone
    if w < 1e-9 * abs(y):
        return middle, (1.0, 0.0, 0.0, 0.0)  # straight down
    length = math.hypot(z, x, w) or 1.0
    return middle, (z / length, 0.0, -x / length, w / length)


def opening(*, position: Place, targets: Mapping[int, Shape], occluders: Mapping[int, Shape], at: Mapping[int, Place],
            parts: Optional[Mapping[int, Mapping[int, Shape]]] = None, **more: Any) -> OpenSession:
    """The first message of a session. position: the place where the camera starts. targets, occluders: shapes by ids of your choice.
    parts: for the id of a target, the shapes of its further parts by their own ids, such as capsules on the bones of a character; each is
    judged where it is. at: the places of all of these, by id. more: other fields of OpenSession, such as settings=Settings(...), seed=7.

    Occluders hide targets, a target can hide another one, and the camera's body keeps out of all of them. For an instance with other
    attributes or a mesh, pass instances=[NewInstance(...)].
    """
    parts = parts or {}
    if not parts.keys() <= targets.keys():
        raise ValueError(f"parts of {sorted(parts.keys() - targets.keys())}, which are not targets")
    request = OpenSession(camera=pose(position), **more)
    request.targets.extend(Target(id=target, part_ids=parts.get(target, {})) for target in targets)
    for shapes in (targets, *parts.values(), occluders):
        for id_, shape in shapes.items():
            request.instances.append(NewInstance(id=id_, shape=shape, pose=pose(at[id_])))
    return request


def tick(time_s: float, places: Mapping[int, Place], **more: Any) -> Tick:
    """A tick that says where instances are now, by id; the others stay where they are. Give a rotation for all of them or for none;
    without, the rotations stay as they are. more: other fields of Tick, such as settings, limits, delta."""
    moved = Transforms()
    for id_, place in places.items():
        position, rotation = _split(place)
        moved.ids.append(id_)
        moved.positions.extend(position)
        moved.rotations.extend(rotation if rotation is not None else ())
    return Tick(time_s=time_s, transforms=moved if moved.ids else None, **more)
