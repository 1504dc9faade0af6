#!/usr/bin/env python3
"""Steers a camera round a box: opens a session on a running daemon, moves two targets, prints the poses.

    PYTHONPATH=build/release/python python3 client/python/example.py 127.0.0.1:50151

The stubs in build/<preset>/python come with the build (target sightline_python_stubs). Lengths are metres, the
frame is glTF's: right-handed, +Y up, a camera looks along its own -Z.
"""
import math
import queue
import sys

import grpc

from sightline.v1 import camera_control_pb2 as control
from sightline.v1 import camera_control_pb2_grpc, camera_pb2, diagnostics_pb2, scene_pb2, session_pb2, settings_pb2

BOX, ANNA, BEN = 1, 2, 3
RATE_HZ, CHANGE_AT_S = 30.0, 2.0


def vector(x, y, z):
    return camera_pb2.Vec3(x=x, y=y, z=z)


def where(time_s):
    """The two targets walk side by side behind the box and out again."""
    x = 3.0 * math.sin(0.8 * time_s)
    return {ANNA: (x - 0.6, 0.9, -2.0), BEN: (x + 0.6, 0.9, -2.0)}


def open_session():
    person = scene_pb2.Shape(capsule=scene_pb2.Shape.Capsule(radius=0.3, half_height=0.6))
    box = scene_pb2.Shape(box=scene_pb2.Shape.Box(half_extent=vector(0.75, 1.5, 0.75)))
    at = where(0.0)
    request = session_pb2.OpenSession(
        convention=camera_pb2.Convention(preset=camera_pb2.Convention.PRESET_GLTF),
        seed=1,
        camera=camera_pb2.Pose3(position=vector(0.0, 1.6, 6.0)),
        targets=[scene_pb2.Target(id=ANNA), scene_pb2.Target(id=BEN)],
        settings=settings_pb2.Settings(preset=settings_pb2.Settings.PRESET_SIGHTLINE),
        label="python example",
    )
    request.instances.add(id=BOX, shape=box, pose=camera_pb2.Pose3(position=vector(0.0, 1.5, 1.0)))
    for target in (ANNA, BEN):
        request.instances.add(id=target, shape=person, pose=camera_pb2.Pose3(position=vector(*at[target])))
    return control.ControlRequest(open=request)


def tick(number):
    time_s = number / RATE_HZ
    message = session_pb2.Tick(sequence=number + 1, time_s=time_s)
    if time_s == CHANGE_AT_S:  # settings can change with any tick: the rest stays as it is
        message.settings.move_response_s = 0.3
        message.limits.max_speed_mps = 4.0
    for target, position in where(time_s).items():
        message.transforms.ids.append(target)
        message.transforms.positions.extend(position)
    return control.ControlRequest(tick=message)


def print_reply(reply):
    p = reply.pose.position
    seen = "  ".join(f"{sight.id}: {sight.visible_share:.2f}" for sight in reply.targets)
    status = diagnostics_pb2.TrackingStatus.Name(reply.status).removeprefix("TRACKING_STATUS_")
    print(f"{reply.time_s:6.2f} s  camera ({p.x:6.2f}, {p.y:6.2f}, {p.z:6.2f})  seen {seen}  {status}")


def main():
    address = sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1:50151"
    ticks = int(sys.argv[2]) if len(sys.argv) > 2 else 240
    requests = queue.Queue()
    requests.put(open_session())
    with grpc.insecure_channel(address) as channel:
        stub = camera_control_pb2_grpc.CameraControlServiceStub(channel)
        replies = stub.Control(iter(requests.get, None))
        opened = next(replies).opened
        print(f"session {opened.session_id}: {opened.instance_count} instances, {opened.triangle_count} triangles")
        for number in range(ticks):
            requests.put(tick(number))
            reply = next(replies)
            if reply.HasField("tick_error"):
                sys.exit(f"refused: {reply.tick_error.message}")
            if reply.HasField("drain"):
                sys.exit(f"the server is going away: {reply.drain.reason}")
            print_reply(reply.camera)
        requests.put(None)  # no more ticks: the server ends the session
        for _ in replies:
            pass


if __name__ == "__main__":
    try:
        main()
    except grpc.RpcError as error:
        sys.exit(f"{error.code().name}: {error.details()}")
