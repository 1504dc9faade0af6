"""A small Python client of Sightline on grpcio: one camera that keeps its targets in view, tick by tick.

The build puts this file and the generated messages into build/<preset>/python, so PYTHONPATH=build/release/python is all that a program
needs. Lengths are in metres, times in seconds. The frame is glTF's: right-handed, +Y up, a camera looks along its own -Z. The README
shows a complete program; proto/sightline/v1 describes every field.

A place is a position (x, y, z), or a pair of a position and a rotation, ((x, y, z), (qx, qy, qz, qw)).
"""
from __future__ import annotations

import queue
from typing import Any, List, Mapping, Optional, Sequence, Tuple, Union

import grpc

import call_details_pb2
from sightline.v1 import camera_control_pb2 as control
from sightline.v1 import camera_control_pb2_grpc, camera_pb2, errors_pb2, session_pb2
from sightline.v1.errors_pb2 import FieldViolation
from sightline.v1.scene_pb2 import NewInstance, Shape, Target

Vector = Tuple[float, float, float]
Quaternion = Tuple[float, float, float, float]
Place = Union[Vector, Tuple[Vector, Quaternion]]


class Failed(Exception):
    """The session could not be opened, or it was lost. Nothing more comes from it: open another one.

    code: a grpc.StatusCode. UNAVAILABLE: no daemon answers at this address, or the connection broke. violations: the fields of the
    request that are wrong, each with `field` and `description`; empty if the request was not the cause.
    """

    def __init__(self, error: grpc.RpcError) -> None:
        super().__init__(f"{error.code().name}: {error.details()}")
        self.code: grpc.StatusCode = error.code()
        self.violations: List[FieldViolation] = _violations(error)


class Refused(Exception):
    """The daemon refused a tick, and the session goes on. The text names the field and what is wrong. Nothing of the tick was applied,
    unless the text says that its step failed. error: the whole TickError."""

    def __init__(self, error: errors_pb2.TickError) -> None:
        super().__init__(error.message)
        self.error = error


class Ended(Exception):
    """The daemon is shutting down. It has answered every tick that was sent, and takes no more."""


def _violations(error: grpc.RpcError) -> List[FieldViolation]:
    found: List[FieldViolation] = []
    for key, value in error.trailing_metadata() or ():
        if key != "grpc-status-details-bin":
            continue
        for detail in call_details_pb2.CallDetails.FromString(value).details:
            if detail.TypeName() == "google.rpc.BadRequest":
                found.extend(call_details_pb2.BadRequest.FromString(detail.value).field_violations)
    return found


def _vector(values: Sequence[float]) -> camera_pb2.Vec3:
    return camera_pb2.Vec3(x=values[0], y=values[1], z=values[2])


def _split(place: Place) -> Tuple[Vector, Optional[Quaternion]]:
    return place if len(place) == 2 else (place, None)


def _pose(place: Place) -> camera_pb2.Pose3:
    position, rotation = _split(place)
    pose = camera_pb2.Pose3(position=_vector(position))
    if rotation is not None:
        pose.rotation.x, pose.rotation.y, pose.rotation.z, pose.rotation.w = rotation
    return pose


def box(width: float, height: float, depth: float) -> Shape:
    """Whole sizes along x, y and z. A ground or a wall is a flat box. Like every shape, it is centred on the place of its instance."""
    return Shape(box=Shape.Box(half_extent=_vector((width / 2, height / 2, depth / 2))))


def sphere(radius: float) -> Shape:
    return Shape(sphere=Shape.Sphere(radius=radius))


def capsule(radius: float, height: float) -> Shape:
    """An upright capsule; `height` is from end to end."""
    return Shape(capsule=Shape.Capsule(radius=radius, half_height=height / 2 - radius))


class Camera:
    """A session with a daemon. Use it in a `with` statement, from one thread.

    position: the place where the camera starts. targets, occluders: shapes by ids of your choice. at: the places of all of these, by id.
    more: other fields of OpenSession, such as settings=Settings(...), limits=CameraLimits(...), seed=7.

    Occluders hide targets, a target can hide another one, and the camera's body keeps out of all of them. For an instance with other
    attributes or a mesh, pass instances=[NewInstance(...)]. Raises Failed; Ended if the daemon is shutting down.
    """

    def __init__(self, address: str, *, position: Place, targets: Mapping[int, Shape], occluders: Mapping[int, Shape],
                 at: Mapping[int, Place], **more: Any) -> None:
        request = session_pb2.OpenSession(camera=_pose(position), **more)
        request.targets.extend(Target(id=target) for target in targets)
        for id_, shape in {**targets, **occluders}.items():
            request.instances.append(NewInstance(id=id_, shape=shape, pose=_pose(at[id_])))
        self._sequence = 0
        self._over = False  # the call has ended
        self._drained: Optional[str] = None  # why the daemon is shutting down
        self._requests: queue.SimpleQueue = queue.SimpleQueue()
        self._channel = grpc.insecure_channel(address)
        try:
            self._replies = camera_control_pb2_grpc.CameraControlServiceStub(self._channel).Control(iter(self._requests.get, None))
            self._requests.put(control.ControlRequest(open=request))
            self.opened: session_pb2.SessionOpened = self._receive().opened
        except BaseException:
            self._requests.put(None)
            self._channel.close()
            raise

    def tick(self, time_s: float, places: Mapping[int, Place], **more: Any) -> session_pb2.CameraReply:
        """Tells the daemon what has moved, and returns where the camera goes.

        places: where instances are now, by id; the others stay where they are. Give a rotation for all of them or for none; without, the
        rotations stay as they are. more: other fields of Tick, such as settings, limits; not a step_control that merges the tick into the
        next one, since such a tick gets no reply. Raises Refused, Failed, or Ended.
        """
        if self._drained is not None:
            raise Ended(self._drained)
        self._sequence += 1
        message = session_pb2.Tick(sequence=self._sequence, time_s=time_s, **more)
        for id_, place in places.items():
            position, rotation = _split(place)
            message.transforms.ids.append(id_)
            message.transforms.positions.extend(position)
            message.transforms.rotations.extend(rotation if rotation is not None else ())
        self._requests.put(control.ControlRequest(tick=message))
        response = self._receive()
        if response.HasField("tick_error"):
            raise Refused(response.tick_error)
        return response.camera

    def _receive(self) -> control.ControlResponse:
        """The daemon's next answer. It may announce before it that it is shutting down."""
        try:
            for response in self._replies:
                if not response.HasField("drain"):
                    return response
                self._drained = response.drain.reason
        except grpc.RpcError as error:
            self._over = True
            raise Failed(error) from None
        self._over = True
        raise Ended(self._drained or "the daemon has ended the session")

    def close(self) -> None:
        """Ends the session. Raises Failed if it was lost meanwhile."""
        self._requests.put(None)  # no more ticks: the daemon ends the session
        try:
            while not self._over:
                self._receive()
        except Ended:
            pass
        finally:
            self._channel.close()

    def __enter__(self) -> Camera:
        return self

    def __exit__(self, kind: Any, *_: Any) -> None:
        if kind is None:
            self.close()
        else:  # do not hide the error that is on its way
            self._requests.put(None)
            self._replies.cancel()
            self._channel.close()
