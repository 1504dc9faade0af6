"""A session at 60 Hz: healthy_client.py ADDRESS [SECONDS]. Prints "opened", then one JSON object. A late answer delays no tick, and every
round trip counts from when its tick was due.

Without SECONDS it ticks until its input ends. It then prints the time of the first tick, on the system's monotonic clock, after "opened", and
for each answered tick a line with its number and its round trip in milliseconds."""
import json
import math
import queue
import sys
import threading
import time

import grpc
from service_stub import CameraControlServiceStub
from sightline.v1 import camera_control_pb2, session_pb2
from sightline_client import box, capsule
from sightline.v1.camera_pb2 import Pose3, Vec3
from sightline.v1.scene_pb2 import NewInstance, Target


def opening():
    request = session_pb2.OpenSession(camera=Pose3(position=Vec3(x=0, y=1.6, z=6)), targets=[Target(id=1)])
    request.instances.append(NewInstance(id=1, shape=capsule(radius=0.3, height=1.8), pose=Pose3(position=Vec3(y=0.9))))
    request.instances.append(NewInstance(id=2, shape=box(1, 4, 1), pose=Pose3(position=Vec3(y=2, z=2))))
    return camera_control_pb2.ControlRequest(open=request)


def main(address, seconds=math.inf):
    tells_each, ended = seconds == math.inf, threading.Event()
    if tells_each:
        threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    channel = grpc.insecure_channel(address)
    requests = queue.SimpleQueue()
    replies = CameraControlServiceStub(channel).Control(iter(requests.get, None))
    requests.put(opening())
    next(replies)
    print("opened", flush=True)
    due, waits, trouble, answers = {}, [], [], []

    def receive():
        try:
            for reply in replies:
                answered = reply.camera.sequence
                answers.append(answered)
                # A reply may answer several ticks that were merged.
                for sequence in [s for s in due if s <= answered]:
                    waits.append(time.monotonic() - due.pop(sequence))
                    if tells_each:
                        print(sequence, f"{1e3 * waits[-1]:.2f}", flush=True)
        except grpc.RpcError as error:
            trouble.append(f"{error.code().name}: {error.details()}")

    reader = threading.Thread(target=receive, daemon=True)
    reader.start()
    start, sequence = time.monotonic(), 0
    if tells_each:
        print(start, flush=True)
    while (at := sequence / 60) < seconds and not ended.is_set() and not trouble:
        time.sleep(max(0.0, start + at - time.monotonic()))
        sequence += 1
        due[sequence] = start + at
        tick = session_pb2.Tick(sequence=sequence, time_s=at)
        tick.transforms.ids.append(1)
        tick.transforms.positions.extend((at % 1, 0.9, 0))
        requests.put(camera_control_pb2.ControlRequest(tick=tick))
    requests.put(None)
    reader.join(20)
    waits.sort()
    at = lambda share: round(1e3 * waits[min(len(waits) - 1, int(share * len(waits)))], 2) if waits else None
    print(json.dumps({"ticks": sequence, "answered": len(waits), "replies": len(answers), "p50_ms": at(0.5), "p99_ms": at(0.99), "max_ms": at(1),
                      "error": "; ".join(trouble)}))


main(sys.argv[1], *map(float, sys.argv[2:]))
