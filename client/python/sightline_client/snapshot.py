"""The state of a session as the client knows it, so that the session can go on in another daemon."""
from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, List, Optional, Tuple

from sightline.v1.camera_pb2 import Vec3
from sightline.v1.errors_pb2 import TickError
from sightline.v1.scene_pb2 import Attributes, NewInstance, SceneDelta, SceneRef, Transforms
from sightline.v1.session_pb2 import CameraReply, ObservedCamera, OpenSession, StepControl, Tick
from sightline.v1.shot_pb2 import ShotReport


@dataclass
class _Change:
    """The changes that ticks made to one instance."""
    removed: bool = False  # an instance of the opening, or a node of its scene file
    added: Optional[NewInstance] = None  # by a tick, perhaps after `removed`
    attributes: Optional[Attributes] = None
    position: Optional[Tuple[float, ...]] = None
    rotation: Optional[Tuple[float, ...]] = None


class Snapshot:
    """Follows the ticks that a daemon has applied. A session that is opened with opening() and gets ticks() has the same scene, targets,
    settings, limits, lens and clock as one that got every tick, and its camera is where the newest reply had it.

    The shot goes on. The camera's memory of the things that it had seen before is lost.
    """

    def __init__(self, opening: OpenSession) -> None:
        self._opening = OpenSession()
        self._opening.CopyFrom(opening)
        self._changes: Dict[int, _Change] = {}  # in the order of the first change
        self._terms = Tick()  # the newest targets, lens, settings, limits and tuning, and how far the world has been shifted since the opening
        self._time_s = 0.0
        self._camera: Optional[ObservedCamera] = None
        self._kept: Optional[ShotReport] = None  # of the newest reply

    @property
    def scene(self) -> SceneRef:
        """Of the opening; it can be changed."""
        return self._opening.scene

    def apply(self, tick: Tick) -> None:
        """Takes a tick that the daemon has applied."""
        if tick.HasField("world_shift"):
            self._shift_world(tick.world_shift)
        for id_ in tick.delta.removed_ids:
            known = self._changes.pop(id_, _Change())
            if known.removed or known.added is None:
                self._changes[id_] = _Change(removed=True)
            self._forget_in_targets(id_)
        for added in tick.delta.added_instances:
            self._change(added.id).added = added
        for change in tick.delta.changed_instances:
            self._change(change.id).attributes = change.attributes
        self._move(tick.transforms)
        self._take_terms(tick)
        self._time_s = tick.time_s

    def take_reply(self, reply: CameraReply) -> None:
        self._camera = ObservedCamera(pose=reply.pose, velocity=reply.velocity, angular_velocity=reply.angular_velocity)
        self._kept = reply.shot if reply.HasField("shot") else None

    def _shift_world(self, shift: Vec3) -> None:
        _add(shift, 1, self._terms.world_shift)
        for change in self._changes.values():
            if change.added is not None:
                added = NewInstance()
                added.CopyFrom(change.added)
                _add(shift, 1, added.pose.position)
                change.added = added
            if change.position is not None:
                x, y, z = change.position
                change.position = (x + shift.x, y + shift.y, z + shift.z)
        if self._camera is not None:
            _add(shift, 1, self._camera.pose.position)

    def opening(self) -> OpenSession:
        """The first message of the session that goes on: as at first, and before the world was shifted, but with the camera where it is now."""
        request = OpenSession()
        request.CopyFrom(self._opening)
        if self._camera is not None:
            request.camera.CopyFrom(self._camera.pose)
            _add(self._terms.world_shift, -1, request.camera.position)
            self._go_on_with_shot(request)
        return request

    def _go_on_with_shot(self, request: OpenSession) -> None:
        """The shot as it was asked for last, from where it is now."""
        if request.HasField("shot"):
            request.shot.ClearField("cut")
            request.shot.ClearField("blend_s")
        kept = self._kept
        if kept is None or kept.distance.asked <= 0:
            return
        shot = request.shot
        if not shot.HasField("side_rad") or shot.orbit_radps or shot.either_side:
            shot.side_rad = kept.side.asked
        shot.ClearField("either_side")
        if not shot.HasField("height_rad"):
            shot.height_rad = kept.height.asked
        if shot.WhichOneof("far") is None:
            shot.distance = kept.distance.asked
        if not shot.places and (kept.place_x or kept.place_y):
            shot.places.add(x=kept.place_x, y=kept.place_y)

    def ticks(self, next_sequence: int) -> List[Tick]:
        """The ticks that follow the opening; they get no replies of their own. next_sequence: of the tick after them. Empty before the
        first reply."""
        if self._camera is None:
            return []
        turned = {id_: change for id_, change in self._changes.items() if change.rotation is not None}
        moved = {id_: change for id_, change in self._changes.items() if change.rotation is None and change.position is not None}
        first = Tick(observed_camera=self._camera, delta=self._delta(), transforms=_transforms(turned or moved))
        first.MergeFrom(self._terms)
        # Rotations are sent for all instances of a tick or for none.
        ticks = [first, Tick(transforms=_transforms(moved))] if turned and moved else [first]
        for back, tick in enumerate(reversed(ticks), 1):
            tick.sequence = next_sequence - back
            tick.time_s = self._time_s
            tick.step_control.CopyFrom(StepControl(merge_into_next=True))
        return ticks

    def _forget_in_targets(self, id_: int) -> None:
        """A list of targets may name existing instances only."""
        for target in self._terms.targets.targets:
            for named in (target.attached_ids, target.ignored_ids, target.part_ids):
                if id_ in named:
                    named.remove(id_)

    def _change(self, id_: int) -> _Change:
        return self._changes.setdefault(id_, _Change())

    def _move(self, moved: Transforms) -> None:
        for i, id_ in enumerate(moved.ids):
            change = self._change(id_)
            change.position = tuple(moved.positions[3 * i:3 * i + 3])
            if moved.rotations:
                change.rotation = tuple(moved.rotations[4 * i:4 * i + 4])

    def _take_terms(self, tick: Tick) -> None:
        terms = self._terms
        if tick.HasField("targets"):
            terms.targets.CopyFrom(tick.targets)
        if tick.HasField("lens"):
            terms.lens.CopyFrom(tick.lens)
        if tick.HasField("shot"):
            self._opening.shot.CopyFrom(tick.shot)
        if tick.HasField("limits"):
            terms.limits.MergeFrom(tick.limits)
        if tick.settings.preset:  # resets the settings and the tuning
            terms.ClearField("settings")
            terms.ClearField("tuning")
        if tick.HasField("settings"):
            terms.settings.MergeFrom(tick.settings)
        if tick.HasField("tuning"):
            terms.tuning.MergeFrom(tick.tuning)

    def _delta(self) -> Optional[SceneDelta]:
        delta = SceneDelta()
        for id_, change in self._changes.items():
            if change.removed:
                delta.removed_ids.append(id_)
            if change.added is not None:
                delta.added_instances.append(change.added)
            if change.attributes is not None:
                delta.changed_instances.add(id=id_, attributes=change.attributes)
        return delta if delta.ByteSize() else None


def _add(shift: Vec3, sign: int, place: Vec3) -> None:
    place.x += sign * shift.x
    place.y += sign * shift.y
    place.z += sign * shift.z


def _transforms(changes: Dict[int, _Change]) -> Optional[Transforms]:
    moved = Transforms()
    for id_, change in changes.items():
        moved.ids.append(id_)
        moved.positions.extend(change.position or ())
        moved.rotations.extend(change.rotation or ())
    return moved if moved.ids else None


def was_applied(error: TickError) -> bool:
    """True if the tick was applied and only its step failed (see TickError)."""
    return error.code in (TickError.CODE_INTERNAL, TickError.CODE_UNAVAILABLE) and not error.field_violations
