"""A daemon in a container of 512 MiB, and attacks on its memory: container_test.py SIGHTLINED STUBS."""
import contextlib
import re
import struct
import subprocess
import sys
import threading
import time
import unittest

import daemon as attack

attack.Daemon.path, STUBS = sys.argv[1:3]
sys.path.insert(0, STUBS)

import grpc  # noqa: E402

from daemon import (CONTROL, END_STREAM, DATA, HEALTH, RST_STREAM, SERVICE, Daemon, FlowingConnection, Healthy, RawConnection,  # noqa: E402
                    flood, frame, message)
from memory_cgroup import MemoryCgroup  # noqa: E402
from scenes import empty_parts, repeated_triangles  # noqa: E402
from sessions import info, open_request, upload  # noqa: E402
from sightline.v1 import camera_control_pb2  # noqa: E402

MIB = 512


def unfinished_messages(address):
    whole = message(bytes((4 << 20) - 8))[:-1]
    connections = [FlowingConnection(address) for _ in range(8)]
    sending = [threading.Thread(target=lambda of=of: of.send_all({of.start_call(SERVICE + "GetServerInfo"): whole for _ in range(32)}, 10))
               for of in connections]
    for thread in sending:
        thread.start()
    for thread in sending:
        thread.join()
    return connections


def messages_that_wait(address):
    opening = message(camera_control_pb2.ControlRequest(open=open_request()).SerializeToString())
    connection = FlowingConnection(address, window=0)
    streams = [connection.start_call(CONTROL) for _ in range(96)]
    connection.send_all({stream: opening for stream in streams}, 5)
    connection.send_all({stream: message(empty_parts(200_000)) for stream in streams}, 8)
    return [connection]


def repeated_scenes(address):
    for start in range(6):
        with contextlib.suppress(grpc.RpcError):
            upload(address, repeated_triangles(3000, 30, start))
    return []


def resets_and_watches(address):
    connections = [RawConnection(address) for _ in range(4)]
    for connection in connections:
        def make():
            frames = b""
            for _ in range(16):
                stream, call = connection.call(CONTROL)
                frames += call + frame(RST_STREAM, 0, stream, struct.pack(">I", 8))
                stream, call = connection.call(HEALTH + "Watch")
                frames += call + frame(DATA, END_STREAM, stream, bytes(5))
            return frames
        flood(connection, make, 2)
    return connections


class Container(unittest.TestCase):
    def setUp(self):
        attack.in_containers(MIB)
        if not Daemon.memory_limit_mib:
            self.skipTest("no control group with a limit of memory can be made here")

    def test_the_budgets_fit_it_together(self):
        with MemoryCgroup(MIB) as group:
            text = subprocess.run(group.inside([Daemon.path, "--print-config", "--sessions-memory-mib=300"]), capture_output=True, text=True).stdout
        budgets = {name: int(number) for name, number in re.findall(r"^([a-z-]+-mib)=(\d+)$", text, re.MULTILINE)}
        self.assertEqual(budgets["sessions-memory-mib"], 300, "what is set stays")
        self.assertGreater(budgets["transport-memory-mib"], 0)
        most = 2 * budgets["geometry-memory-mib"] + budgets["messages-memory-mib"] + 2 * budgets["max-upload-mib"] + budgets["transport-memory-mib"]
        self.assertLess(most, MIB - 150)
        without = subprocess.run([Daemon.path, "--print-config"], capture_output=True, text=True).stdout
        self.assertIn("transport-memory-mib=128\n", without)
        self.assertIn("geometry-memory-mib=192\n", without)

    def test_no_attack_on_memory_ends_it(self):
        with contextlib.ExitStack() as stack:
            daemon = stack.enter_context(Daemon())
            for attempt in (unfinished_messages, messages_that_wait, repeated_scenes, resets_and_watches):
                with self.subTest(attempt.__name__):
                    healthy = Healthy(daemon.address, 16)
                    connections = attempt(daemon.address)
                    result = healthy.result()
                    self.assertEqual((result["answered"], result["error"]), (result["ticks"], ""))
                    for connection in connections:
                        connection.close()
                    self.assertIsNone(daemon.process.poll(), "the daemon was killed")
                    time.sleep(11)  # who flooded has to wait
            self.assertTrue(info(daemon.address).version)
            daemon.stop()


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=2, warnings="ignore")
