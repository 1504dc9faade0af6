"""Probes must be answered, and the daemon must stop when it is told to: probes_test.py SIGHTLINED STUBS."""
import contextlib
import os
import pathlib
import signal
import sys
import tempfile
import threading
import time
import unittest

import daemon as attack

attack.Daemon.path, STUBS = sys.argv[1:3]
attack.in_containers()
sys.path[:0] = [STUBS, str(pathlib.Path(__file__).parents[1] / "metrics")]

import grpc  # noqa: E402

from daemon import CONTROL, HEALTH, SERVICE, Daemon, FlowingConnection, RawConnection, flood, frame, message  # noqa: E402
from held_thread import WAIT_FOR_ALL, HeldThread  # noqa: E402
from probing import HeldPort, operators_of, probe  # noqa: E402
from sessions import Session, info, open_session, stub  # noqa: E402
from shifted_clock import ShiftedClock  # noqa: E402
from sightline.v1 import camera_control_pb2, session_pb2  # noqa: E402

# Far longer than the time limits below, and shorter than the minute by which a clock is set back.
LONG_S = 20


def until(condition, seconds=LONG_S):
    """Whether the condition comes true in this time."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.05)
    return False


def served(daemon):
    with grpc.insecure_channel(daemon.address) as channel:
        return channel.unary_unary(HEALTH + "Check")(b"", timeout=5) == b"\x08\x01"


class MetricsPort(unittest.TestCase):
    def hold(self, behave, count, anywhere=False, probes=20):
        with Daemon("--metrics-listen", "127.0.0.1:0") as daemon:
            operators = operators_of(daemon)
            with HeldPort(operators, behave, count, anywhere):
                for _ in range(probes):
                    self.assertEqual(probe(operators), (200, "ok\n"))
                    self.assertEqual(probe(operators, "/readyz"), (200, "ok\n"))
            status, text = probe(operators, "/metrics")
            self.assertEqual(status, 200)
            self.assertIn("sightline_ready 1", text)
            with open_session(daemon.address) as session:
                self.assertEqual(session.tick().sequence, 1)

    def test_eight_silent_connections_that_are_made_again(self):
        self.hold("is_silent", 8)

    def test_more_silent_connections_than_places(self):
        self.hold("is_silent", 200)

    def test_silent_connections_from_many_addresses(self):
        self.hold("is_silent", 200, anywhere=True)

    def test_headers_that_drip(self):
        self.hold("sends_a_header_now_and_then", 8)
        self.hold("sends_a_header_now_and_then", 200, anywhere=True)

    def test_answers_that_are_not_taken(self):
        self.hold("takes_no_answer", 40)

    def test_many_requests_on_one_connection(self):
        self.hold("sends_many_requests_at_once", 8)

    def test_headers_without_end(self):
        self.hold("sends_an_endless_header", 8)

    def test_the_longest_page_asked_for_without_a_pause(self):
        self.hold("asks_again_and_again", 8)

    def test_connections_made_and_reset(self):
        self.hold("resets", 8)
        self.hold("resets", 8, anywhere=True)

    def test_probes_beside_a_flood_of_calls(self):
        with Daemon("--metrics-listen", "127.0.0.1:0") as daemon:
            operators = operators_of(daemon)
            stopping = threading.Event()

            def attack_again():
                while not stopping.is_set():
                    attacker = RawConnection(daemon.address)
                    flood(attacker, lambda: b"".join(attacker.call(HEALTH + "Check", frame(0, 1, attacker.next_stream, message(b"")))[1]
                                                     for _ in range(64)), 1)
                    attacker.close()
            attackers = [threading.Thread(target=attack_again) for _ in range(2)]
            for attacker in attackers:
                attacker.start()
            for _ in range(40):
                self.assertEqual(probe(operators), (200, "ok\n"))
                time.sleep(0.05)
            stopping.set()
            for attacker in attackers:
                attacker.join()


class WallClock(unittest.TestCase):
    """The clock moves while the daemon waits for something. What it waits for has to come in time all the same."""

    def start(self, idle_s=3, grace_s=2):
        clock = self.enterContext(ShiftedClock())
        flags = ("--metrics-listen", "127.0.0.1:0", "--open-timeout-s", "2", "--session-idle-s", str(idle_s), "--upload-timeout-s", "2",
                 "--resume-grace-s", str(grace_s), "--stall-s", "3", "--drain-s", "1")
        return clock, self.enterContext(Daemon(*flags, environment=clock.environment))

    def end_of_control(self, address, requests):
        with grpc.insecure_channel(address) as channel, self.assertRaises(grpc.RpcError) as ended:
            next(channel.stream_stream(CONTROL)(requests, timeout=LONG_S))
        return ended.exception

    def test_probes_are_answered_after_the_clock_was_set_back(self):
        clock, daemon = self.start()
        operators = operators_of(daemon)
        self.assertEqual(probe(operators), (200, "ok\n"))
        clock.shift(-60)
        end = time.monotonic() + 8  # more than twice --stall-s
        while time.monotonic() < end:
            self.assertEqual(probe(operators), (200, "ok\n"))
            self.assertEqual(probe(operators, "/readyz"), (200, "ok\n"))
            self.assertTrue(served(daemon))
            time.sleep(0.2)
        self.assertNotIn("threads hang", daemon.log())
        self.assertEqual(daemon.stop(timeout=LONG_S), 0)

    def test_a_call_that_is_never_opened(self):
        clock, daemon = self.start()
        stopping = threading.Event()
        clock.shift(-60)
        self.assertIn("--open-timeout-s", self.end_of_control(daemon.address, iter(lambda: stopping.wait(LONG_S), True)).details())
        stopping.set()

    def test_an_idle_session(self):
        clock, daemon = self.start()
        with open_session(daemon.address) as session:
            clock.shift(-60)
            ended = []
            waits = threading.Thread(target=lambda: ended.append(session.status().details()), daemon=True)
            waits.start()
            waits.join(LONG_S)
        self.assertIn("--session-idle-s", " ".join(ended))

    def test_an_upload_that_sends_nothing(self):
        clock, daemon = self.start()
        stopping = threading.Event()

        def chunks():
            yield camera_control_pb2.UploadSceneRequest(chunk=b"x")
            clock.shift(-60)
            stopping.wait(LONG_S)
        with stub(daemon.address) as service, self.assertRaises(grpc.RpcError) as ended:
            service.UploadScene(chunks(), timeout=LONG_S)
        stopping.set()
        self.assertEqual(ended.exception.code(), grpc.StatusCode.CANCELLED)

    def test_an_answer_that_is_not_taken(self):
        clock, daemon = self.start()
        connection = FlowingConnection(daemon.address, window=0)
        stream = connection.start_call(SERVICE + "GetServerInfo")
        connection.send(frame(0, 1, stream, message(b"")))
        clock.shift(-60)
        self.assertTrue(until(lambda: stream not in connection.rooms))
        connection.close()

    def test_a_session_that_nobody_resumes(self):
        clock, daemon = self.start()
        with open_session(daemon.address, resumable=True) as session:
            token = session.opened.resume_token
            session.tick()
            session.breaks()
        clock.shift(-60)
        daemon.wait_for_log("no stream resumed it in time", LONG_S)
        with self.assertRaises(grpc.RpcError) as refused:
            Session(daemon.address, session_pb2.ResumeSession(token=token)).close()
        self.assertEqual(refused.exception.code(), grpc.StatusCode.NOT_FOUND)

    def test_a_daemon_that_drains(self):
        """Neither the session nor the calls of its client end by themselves."""
        clock, daemon = self.start()
        with open_session(daemon.address) as session, grpc.insecure_channel(daemon.address) as channel:
            watch = channel.unary_stream(HEALTH + "Watch")(b"")
            next(watch)
            session.tick()
            daemon.process.send_signal(signal.SIGTERM)
            self.assertTrue(session.waits_for_drain())
            clock.shift(-60)
            self.assertEqual(daemon.process.wait(LONG_S), 0)

    def test_a_clock_that_is_set_forward_ends_nothing(self):
        clock, daemon = self.start(idle_s=60, grace_s=60)
        with open_session(daemon.address) as session, open_session(daemon.address, resumable=True) as broken:
            token = broken.opened.resume_token
            broken.tick()
            broken.breaks()
            daemon.wait_for_log("session kept")
            clock.shift(3600)
            for _ in range(20):
                session.tick()
                time.sleep(0.1)
            with Session(daemon.address, session_pb2.ResumeSession(token=token)) as resumed:
                self.assertTrue(resumed.opened.resumed)
                self.assertEqual(probe(operators_of(daemon)), (200, "ok\n"))


class Stopping(unittest.TestCase):
    def test_a_daemon_ends_although_one_of_its_threads_does_not(self):
        """The files of its recordings are complete all the same."""
        with tempfile.TemporaryDirectory() as folder, Daemon("--drain-s", "1", "--record-dir", folder) as daemon:
            with open_session(daemon.address) as session:
                for _ in range(30):
                    session.tick()
                try:
                    held = HeldThread(daemon.pid, "event-loop")
                except PermissionError:
                    self.skipTest("this process may not trace another one")
                try:
                    daemon.process.send_signal(signal.SIGTERM)
                    # A traced thread stays until its tracer has seen its end.
                    self.assertTrue(until(lambda: os.waitpid(held.thread, WAIT_FOR_ALL | os.WNOHANG)[0] != 0))
                finally:
                    with contextlib.suppress(OSError):
                        held.__exit__()
                self.assertEqual(daemon.process.wait(LONG_S), 1)
            self.assertIn("ending by force", daemon.log())
            files = list(pathlib.Path(folder).glob("*.mcap"))
            self.assertEqual(len(files), 1)
            self.assertTrue(files[0].read_bytes().endswith(b"\x89MCAP0\r\n"), "it has its end")

    def test_it_answers_again_after_a_start_at_the_same_addresses(self):
        with Daemon("--metrics-listen", "127.0.0.1:0") as first:
            operators, address = operators_of(first), first.address
            with HeldPort(operators, "is_silent", 8):
                self.assertEqual(first.stop(), 0)
                with Daemon("--metrics-listen", operators, listen=("--listen", address)) as second:
                    self.assertTrue(info(second.address).version)
                    self.assertEqual(probe(operators), (200, "ok\n"))


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=2, warnings="ignore")
