"""A small Python client of Sightline on grpcio: one camera that keeps its targets in view, tick by tick.

The build puts this file and the generated messages into build/<preset>/python, so PYTHONPATH=build/release/python is all that a program
needs. Lengths are in metres, times in seconds. The frame is glTF's: right-handed, +Y up, a camera looks along its own -Z. The README
shows a complete program; proto/sightline/v1 describes every field.
"""
from __future__ import annotations

import queue
from typing import Any, Mapping, Tuple

import grpc

from sightline.v1 import camera_control_pb2 as control
from sightline.v1 import camera_control_pb2_grpc, camera_pb2, session_pb2
from sightline.v1.scene_pb2 import NewInstance, Shape, Target

Vector = Tuple[float, float, float]


class Refused(Exception):
    """The daemon refused a tick: it applied nothing of it, and the session goes on. The text names the field and what is wrong."""


class Ended(Exception):
    """The daemon is shutting down and takes no more ticks."""


def _vector(values: Vector) -> camera_pb2.Vec3:
    return camera_pb2.Vec3(x=values[0], y=values[1], z=values[2])


def box(width: float, height: float, depth: float) -> Shape:
    return Shape(box=Shape.Box(half_extent=_vector((width / 2, height / 2, depth / 2))))


def sphere(radius: float) -> Shape:
    return Shape(sphere=Shape.Sphere(radius=radius))


def capsule(radius: float, height: float) -> Shape:
    """An upright capsule; `height` is from end to end."""
    return Shape(capsule=Shape.Capsule(radius=radius, half_height=height / 2 - radius))


class Camera:
    """A session with a daemon. Use it in a `with` statement, from one thread. A call that fails raises grpc.RpcError.

    position: where the camera starts. targets, occluders: shapes by ids of your choice. at: where all of these are, by id.
    more: other fields of OpenSession, such as settings=Settings(...), limits=CameraLimits(...), seed=7.
    """

    def __init__(self, address: str, *, position: Vector, targets: Mapping[int, Shape], occluders: Mapping[int, Shape],
                 at: Mapping[int, Vector], **more: Any) -> None:
        request = session_pb2.OpenSession(camera=camera_pb2.Pose3(position=_vector(position)), **more)
        request.targets.extend(Target(id=target) for target in targets)
        for id_, shape in {**targets, **occluders}.items():
            request.instances.append(NewInstance(id=id_, shape=shape, pose=camera_pb2.Pose3(position=_vector(at[id_]))))
        self._sequence = 0
        self._requests: queue.SimpleQueue = queue.SimpleQueue()
        self._channel = grpc.insecure_channel(address)
        try:
            self._replies = camera_control_pb2_grpc.CameraControlServiceStub(self._channel).Control(iter(self._requests.get, None))
            self._requests.put(control.ControlRequest(open=request))
            self.opened: session_pb2.SessionOpened = next(self._replies).opened
        except BaseException:
            self._requests.put(None)
            self._channel.close()
            raise

    def tick(self, time_s: float, positions: Mapping[int, Vector], **more: Any) -> session_pb2.CameraReply:
        """Tells the daemon what has moved, and returns where the camera goes. more: other fields of Tick, such as settings, limits."""
        self._sequence += 1
        message = session_pb2.Tick(sequence=self._sequence, time_s=time_s, **more)
        for id_, position in positions.items():
            message.transforms.ids.append(id_)
            message.transforms.positions.extend(position)
        self._requests.put(control.ControlRequest(tick=message))
        reply = next(self._replies)
        if reply.HasField("tick_error"):
            raise Refused(reply.tick_error.message)
        if reply.HasField("drain"):
            raise Ended(reply.drain.reason)
        return reply.camera

    def close(self) -> None:
        self._requests.put(None)  # no more ticks: the daemon ends the session
        try:
            for _ in self._replies:
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
