"""A session that clients of every version can play: session.py ADDRESS. It uses what the first release had, and imports whichever
`sightline_client` comes first in the path. Prints a line for each answer: its kind, and its bytes in hexadecimal digits."""
import math
import sys

from sightline.v1.camera_pb2 import Pose3, Vec3
from sightline.v1.scene_pb2 import NewInstance, SceneDelta
from sightline.v1.session_pb2 import ObservedCamera
from sightline.v1.settings_pb2 import CameraLimits
from sightline_client import Camera, Refused, box, capsule

ANNA, BEN, PILLAR, CRATE = 1, 2, 3, 4


def places(frame):
    x = 3 * math.sin(frame / 60)
    return {ANNA: (x - 0.6, 0.9, 0), BEN: (x + 0.6, 0.9, 0)}


def changes(frame):
    """The fields of a tick beside what moves."""
    if frame == 20:
        crate = NewInstance(id=CRATE, shape=box(1, 1, 1), pose=Pose3(position=Vec3(x=1, y=0.5, z=2)))
        return {"delta": SceneDelta(added_instances=[crate])}
    if frame == 40:
        return {"limits": CameraLimits(max_speed_mps=2.0)}
    if frame == 50:
        return {"observed_camera": ObservedCamera(pose=Pose3(position=Vec3(x=2, y=1.6, z=6)), cut=True)}
    if frame == 60:
        return {"delta": SceneDelta(removed_ids=[CRATE])}
    if frame == 70:
        return {"delta": SceneDelta(removed_ids=[4711])}  # refused
    return {}


def main(address):
    person = capsule(radius=0.3, height=1.8)
    with Camera(address, position=(0, 1.6, 6), targets={ANNA: person, BEN: person}, occluders={PILLAR: box(1, 4, 1)},
                at={PILLAR: (0, 2, 2), **places(0)}, seed=7, label="skew") as camera:
        print("opened", camera.opened.SerializeToString(deterministic=True).hex())
        for frame in range(90):
            try:
                reply = camera.tick(frame / 60, places(frame), **changes(frame))
                print("camera", reply.SerializeToString(deterministic=True).hex())
            except Refused as refused:
                print("refused", refused.error.SerializeToString(deterministic=True).hex())


main(sys.argv[1])
