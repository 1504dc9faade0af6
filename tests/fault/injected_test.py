#!/usr/bin/env python3
"""injected_test.py SIGHTLINED STUBS [CLASS.METHOD...]: faults inside a daemon (--inject-fault). The session that meets one suffers alone, is told, and is counted."""
import json
import pathlib
import subprocess
import sys
import time
import unittest

SIGHTLINED, STUBS = sys.argv[1:3]
HERE = pathlib.Path(__file__).parent
sys.path[:0] = [STUBS, str(HERE.parent / "attack"), str(HERE.parent / "metrics")]

import grpc  # noqa: E402
from daemon import Daemon  # noqa: E402
from exposition import get, scrape, value  # noqa: E402
from sightline_client import Camera, Connection, Failed, Refused, box, capsule  # noqa: E402

Daemon.path = SIGHTLINED
# On a busy machine an answer may take its time.
AT_ONCE = Connection(give_up_after_s=0.0, reply_timeout_s=60.0)


def start(fault, *arguments):
    daemon = Daemon("--metrics-listen", "127.0.0.1:0", "--max-maps-ms", "0", "--inject-fault", fault, *arguments)
    deadline = time.monotonic() + 20
    while "metrics=" not in daemon.log() and time.monotonic() < deadline:
        time.sleep(0.01)  # the log has a thread of its own
    daemon.operators = daemon.log().split("metrics=")[1].split()[0]
    return daemon


def camera(daemon, connection=AT_ONCE):
    person = capsule(radius=0.3, height=1.8)
    return Camera(daemon.address, position=(0, 1.6, 6), targets={1: person, 2: person}, occluders={3: box(1, 4, 1)},
                  at={1: (-1, 0.9, 0), 2: (1, 0.9, 0), 3: (0, 2, 2)}, connection=connection)


def tick(one, n):
    return one.tick(n / 60, {1: (-1 + n / 100, 0.9, 0)})


def until(condition, what, seconds=30):
    deadline = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError("never: " + what)
        time.sleep(0.02)


def has_egl():
    report = subprocess.run([SIGHTLINED, "devices", "--json"], capture_output=True, text=True, timeout=60).stdout
    return any(device["kind"] == "egl" and device["version"] for device in json.loads(report)["devices"])


class Injected(unittest.TestCase):
    def test_a_lost_graphics_context_is_built_again_and_the_stream_stays_open(self):
        if not has_egl():
            self.skipTest("no OpenGL 4.5 here")
        with start("context-loss:5", "--sampler", "egl") as daemon, camera(daemon) as one:
            seen = [tick(one, n).targets[0].visible_share for n in range(1, 21)]
            self.assertEqual(one.resumes + one.resyncs, 0)
            self.assertGreaterEqual(value(scrape(daemon.operators), "sightline_context_losses_total"), 4)
        with start("context-loss:1000000", "--sampler", "egl") as daemon, camera(daemon) as one:
            self.assertEqual(seen, [tick(one, n).targets[0].visible_share for n in range(1, 21)])

    def test_maps_that_cannot_be_taken_fail_one_step_and_the_session_goes_on(self):
        with start("sampler:5") as daemon, camera(daemon) as one:
            refused = 0
            for n in range(1, 21):
                try:
                    self.assertEqual(tick(one, n).sequence, n)
                except Refused as error:
                    refused += 1
                    self.assertIn("injected", str(error))
            self.assertEqual(refused, 4)
            self.assertEqual(value(scrape(daemon.operators), "sightline_ticks_total", outcome="refused"), 4)

    def check_that_one_session_ends(self, fault, code, label):
        """Two sessions in turns; each tenth call for maps is of the second one."""
        with start(fault + ":10") as daemon, camera(daemon) as healthy, camera(daemon) as hit:
            for n in range(1, 10):
                tick(healthy, n)
            with self.assertRaises(Failed) as failed:
                tick(hit, 1)
            self.assertEqual(failed.exception.code, code)
            for n in range(10, 19):
                self.assertEqual(tick(healthy, n).sequence, n)
            self.assertEqual(value(scrape(daemon.operators), "sightline_sessions_closed_total", code=label), 1)
            hit._stream = None  # it has ended

    def test_a_sampler_that_throws_ends_its_session_only(self):
        self.check_that_one_session_ends("exception", grpc.StatusCode.INTERNAL, "INTERNAL")

    def test_a_session_without_memory_ends_alone(self):
        self.check_that_one_session_ends("memory", grpc.StatusCode.RESOURCE_EXHAUSTED, "RESOURCE_EXHAUSTED")

    def test_a_camera_goes_on_by_itself_after_its_session_has_failed(self):
        with start("exception:10") as daemon, camera(daemon, Connection()) as one:
            for n in range(1, 31):
                self.assertEqual(tick(one, n).sequence, n)
            self.assertGreaterEqual(one.resyncs, 2)

    def test_a_step_that_hangs_stops_its_session_and_no_other(self):
        with start("hang:10", "--threads", "2", "--stall-s", "1") as daemon, camera(daemon) as healthy:
            with camera(daemon, Connection(reply_timeout_s=60.0)) as hit:
                for n in range(1, 10):
                    tick(healthy, n)
                hit._stream.send(_request(1))
                until(lambda: get(daemon.operators, "/livez") == (503, "does not answer: step\n"), "the watchdog says that a step hangs")
                self.assertEqual(get(daemon.operators, "/readyz")[0], 503)
                self.assertEqual(value(scrape(daemon.operators), "sightline_hanging_threads"), 1)
                daemon.wait_for_log("threads hang threads=step")
                for n in range(10, 19):
                    self.assertEqual(tick(healthy, n).sequence, n)
                # The other one is answered in the end.
                while not (response := hit._stream.receive(60)).HasField("camera"):
                    pass
                self.assertEqual(response.camera.sequence, 1)
            until(lambda: get(daemon.operators, "/livez") == (200, "ok\n"), "alive again")
            self.assertEqual(value(scrape(daemon.operators), "sightline_hanging_threads"), 0)
            daemon.wait_for_log("threads answer again")

    def test_a_fault_that_does_not_exist_is_refused_by_name_and_the_flag_is_not_in_the_help(self):
        wrong = subprocess.run([SIGHTLINED, "--inject-fault", "fire:1"], capture_output=True, text=True, timeout=60)
        self.assertEqual(wrong.returncode, 2)
        self.assertIn("--inject-fault", wrong.stderr)
        helped = subprocess.run([SIGHTLINED, "--help"], capture_output=True, text=True, timeout=60).stdout
        self.assertNotIn("inject", helped)
        embree = subprocess.run([SIGHTLINED, "--sampler", "embree", "--inject-fault", "context-loss:1"], capture_output=True, text=True, timeout=60)
        self.assertEqual(embree.returncode, 1)


def _request(n):
    from sightline.v1.camera_control_pb2 import ControlRequest
    from sightline.v1.session_pb2 import Tick
    return ControlRequest(tick=Tick(sequence=n, time_s=n / 60))


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
