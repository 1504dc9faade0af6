"""Work that hardly ends: files that take long to read, scenes in which a step takes long, and a daemon that the system does not let run. For
work_test.py and measure.py."""
import contextlib
import os
import pathlib
import random
import signal
import struct
import threading
import time

import attacks
from attacks import Attack, refusal, unix_socket_too, until_end
from relay import Relay
from scenes import container, glb, scene_of, triangle
from sessions import Crowd, open_session, upload


def empty_objects(size):
    """A file of so many bytes that is valid JSON: `{}` again and again, in a member that no reader needs."""
    head, tail = '{"asset":{"version":"2.0"},"extras":[', ']}'
    return (head + ",".join(["{}"] * ((size - len(head) - len(tail)) // 3)) + tail).encode()


def honest_nodes(count):
    document = triangle("nodes")
    document["nodes"] = [{"name": f"node {n}", "mesh": 0, "translation": [n % 300, 0, n // 300]} for n in range(count)]
    document["scenes"][0]["nodes"] = list(range(count))
    return container(document, struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0))


def mesh_of(corners):
    data = struct.pack(f"<{len(corners)}f", *corners)
    document = triangle("mesh")
    document["meshes"][0]["name"] = "mesh"
    document["buffers"][0]["byteLength"] = document["bufferViews"][0]["byteLength"] = len(data)
    document["accessors"][0].update(count=len(corners) // 3, min=[min(corners[axis::3]) for axis in range(3)],
                                    max=[max(corners[axis::3]) for axis in range(3)])
    return container(document, data)


def soup(count, size_m, half_m=8.0, seed=1):
    """So many random triangles of about `size_m` within a cube: each point is inside of the boxes of very many."""
    draw, corners = random.Random(seed), []
    for _ in range(count):
        middle = [draw.uniform(-half_m, half_m) for _ in range(3)]
        for _ in range(3):
            corners += [value + draw.uniform(-size_m, size_m) for value in middle]
    return mesh_of(corners)


def splinters(count, half_m=6.0, seed=3):
    """Triangles across a cube that are thinner than a hair: nearly every ray is tested against very many of them, and misses them all."""
    draw, corners = random.Random(seed), []
    for _ in range(count):
        ends = [[draw.uniform(-half_m, half_m) for _ in range(3)] for _ in range(2)]
        corners += [*ends[0], *ends[1], ends[1][0] + 1e-5, *ends[1][1:]]
    return mesh_of(corners)


def open_for_minutes(address, channel=None):
    """Opens a session whose target is a heap of splinters: the sample table of its shape takes very long."""
    from sightline.v1.camera_pb2 import Pose3, Vec3
    from sightline.v1.scene_pb2 import MeshRef, NewInstance, Target
    from sightline.v1.session_pb2 import OpenSession
    from sessions import Session
    shape = MeshRef(scene_hash=upload(address, splinters(20_000)).hash, mesh="mesh")
    request = OpenSession(camera=Pose3(position=Vec3(y=1.6, z=30)), targets=[Target(id=1)], instances=[NewInstance(id=1, mesh=shape, pose=Pose3())])
    return Session(address, request, channel)


def processor_s(daemon):
    """What the daemon has used so far, in seconds."""
    fields = pathlib.Path(f"/proc/{daemon.pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


STOP_S = 0.15


class Stopped:
    """While it is entered, the system stops the daemon again and again, for `stop_s`."""

    def __init__(self, daemon, stop_s, run_s=0.05):
        self.daemon, self.stop_s, self.run_s, self.ending, self.count = daemon, stop_s, run_s, threading.Event(), 0

    def _go(self):
        while not self.ending.wait(self.run_s):
            self.daemon.process.send_signal(signal.SIGSTOP)
            time.sleep(self.stop_s)
            self.daemon.process.send_signal(signal.SIGCONT)
            self.count += 1

    def __enter__(self):
        self.thread = threading.Thread(target=self._go)
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.ending.set()
        self.thread.join()


def heavy_tuning():
    """Maps that take some milliseconds a step with 24 targets, so that a stop often falls into them."""
    from google.protobuf import json_format
    from sightline.tuning.v1alpha1.tuning_pb2 import Tuning
    return json_format.ParseDict({"sample": {"points": 16, "resolution": 40}}, Tuning())


def open_heavy(daemon):
    from sightline.v1.session_pb2 import DEGRADATION_POLICY_NEVER
    return open_session(daemon.address, targets=24, tuning=heavy_tuning(), degradation_policy=DEGRADATION_POLICY_NEVER)


def heavy_tick_s(daemon, ticks=20):
    """The processor time of a tick of a heavy session, in seconds."""
    with open_heavy(daemon) as session:
        session.tick()
        before = processor_s(daemon)
        for n in range(ticks):
            session.tick(transforms={"ids": [1], "positions": [0.02 * n, 0.9, 0]})
        return (processor_s(daemon) - before) / ticks


def ticks_while_stopped(daemon, ticks, stop_s=STOP_S):
    """(answered, refused) ticks of a heavy session, and how often the daemon was stopped meanwhile."""
    answered = refused = 0
    with open_heavy(daemon) as session:
        session.tick()
        with Stopped(daemon, stop_s) as stopped:
            for n in range(ticks):
                session.sends(transforms={"ids": [1], "positions": [0.02 * n, 0.9, 0]})
                told = session.reads().HasField("camera")
                answered, refused = answered + told, refused + (not told)
    return answered, refused, stopped.count


# --- for measure.py


def empty_json(size):
    def run(daemon):
        tcp = daemon.ready.read_text().split()[0]
        told = []

        def send(address):
            told.append(until_end(attacks.ATTACK_S, lambda: refusal(upload, address, empty_objects(size), timeout=attacks.ATTACK_S)))
        start, before = time.monotonic(), processor_s(daemon)
        with Relay(tcp, "127.0.0.2") as second:
            clients = [threading.Thread(target=send, args=(address,)) for address in (tcp, second.address)]
            for client in clients:
                client.start()
            unix = daemon.ready.read_text().split()[-1]
            opened, count = 0, 0
            while time.monotonic() < start + attacks.ATTACK_S - 1:
                count += 1
                with contextlib.suppress(Exception):
                    open_session(unix).close()
                    upload(unix, glb(f"small {count}"), timeout=2)
                    opened += 1
            for client in clients:
                client.join()
        read = sum(count for _, count in told)
        return f"{read} files in {processor_s(daemon) - before:.1f} s of processor time: {told[0][0][:60]}; another client opened and uploaded {opened} of {count} times"
    return run


def many_nodes(daemon):
    data = honest_nodes(100_000)
    before = processor_s(daemon)
    upload(daemon.address, data)
    return f"{processor_s(daemon) - before:.2f} s of processor time for one file"


# Two uploads of 150,000 triangles: three own corners each, indices, and the tree.
DENSE_MIB = 2 * 150_000 * 160 / (1 << 20)


def dense(size_m, half_m):
    def run(daemon):
        tcp = daemon.ready.read_text().split()[0]
        scene = upload(tcp, soup(150_000, size_m, half_m)).hash
        with Relay(tcp, "127.0.0.2") as second:
            other = upload(second.address, soup(150_000, size_m, half_m, seed=2)).hash
            before = processor_s(daemon)
            with Crowd(tcp, 1, scene=scene_of(scene)) as one, Crowd(second.address, 1, scene=scene_of(other)) as two:
                time.sleep(attacks.ATTACK_S)
                answers, spent = one.answers + two.answers, processor_s(daemon) - before
        return f"{answers} steps of two clients in {spent:.1f} s of processor time"
    return run


def stops(daemon):
    answered, refused, count = ticks_while_stopped(daemon, 100)
    return f"{answered} ticks answered, {refused} refused, while the daemon was stopped {count} times"


ATTACKS = [
    Attack("22a", "two clients, each with 150,000 random triangles of 60 m", "a step of 3.2 s; others' p50 1.6 s", dense(60.0, 300.0),
           options=unix_socket_too, beside_is_another_client=True, stays_mib=DENSE_MIB),
    Attack("22b", "the same with triangles of 2 m within 8 m", "a step of 1.6 s", dense(2.0, 4.0), options=unix_socket_too, beside_is_another_client=True,
           stays_mib=DENSE_MIB),
    Attack("23a", "uploads of 1.2 MB of `{}`", "28.7 s of a core each; opens and uploads of all others blocked", empty_json(1_200_000),
           options=unix_socket_too, beside_is_another_client=True),
    Attack("23b", "uploads of 9 MB of `{}`", "26 min of a core each; SIGTERM hangs", empty_json(9_000_000), options=unix_socket_too,
           beside_is_another_client=True),
    Attack("23c", "100,000 honest nodes", "2.2 s", many_nodes, stays_mib=100_000 * 300 / (1 << 20)),  # 300 bytes an instance
    Attack("32", "a daemon that is stopped again and again", "ticks refused by --max-maps-ms", stops, flags=("--max-step-cost-ms", "0"),
           options=unix_socket_too, beside_is_another_client=True, stopped_ms=1e3 * STOP_S),
]
