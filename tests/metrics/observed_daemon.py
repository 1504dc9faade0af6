"""A daemon with a metrics port, and the calls that tests make of it."""
import time

from daemon import Daemon
from sightline.v1 import camera_control_pb2
from sightline_client import Camera, box, capsule


def start(*arguments, **more):
    """A daemon with a metrics port. Its address is `operators`."""
    daemon = Daemon("--metrics-listen", "127.0.0.1:0", *arguments, **more)
    deadline = time.monotonic() + 20
    while "metrics=" not in daemon.log() and time.monotonic() < deadline:
        time.sleep(0.01)  # the log has a thread of its own
    daemon.operators = daemon.log().split("metrics=")[1].split()[0]
    return daemon


def camera(daemon):
    return Camera(daemon.address, position=(0, 1.6, 6), targets={1: capsule(radius=0.3, height=1.8), 2: capsule(radius=0.3, height=1.8)},
                  occluders={3: box(1, 4, 1)}, at={1: (-1, 0.9, 0), 2: (1, 0.9, 0), 3: (0, 2, 2)})


def rpc(channel, name, answer, kind):
    return getattr(channel, kind)("/sightline.v1.CameraControlService/" + name, request_serializer=lambda request: request.SerializeToString(),
                                  response_deserializer=answer.FromString)


def control(channel, requests):
    return rpc(channel, "Control", camera_control_pb2.ControlResponse, "stream_stream")(requests)


def opening(instances=1):
    request = camera_control_pb2.ControlRequest()
    request.open.camera.position.z = 6
    for i in range(instances):
        instance = request.open.instances.add(id=i + 1)
        half = instance.shape.box.half_extent
        half.x = half.y = half.z = 0.5
    request.open.targets.add(id=1)
    return request


def until(condition, what, seconds=30):
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError("never: " + what)
        time.sleep(0.05)
