"""Clients that do not take what is sent to them: unread_test.py SIGHTLINED STUBS."""
import os
import pathlib
import signal
import sys
import tempfile
import time
import unittest

import daemon as attack

attack.Daemon.path, STUBS = sys.argv[1:3]
attack.in_containers()
sys.path.insert(0, STUBS)

import grpc  # noqa: E402

from daemon import CONTROL, DATA, Daemon, RawConnection, frame, message  # noqa: E402
from sessions import info, open_session, open_request, stub  # noqa: E402
from sightline.v1 import camera_control_pb2, server_pb2  # noqa: E402

REFLECTION = "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo"


def until(condition, seconds):
    """Whether the condition comes true in this time."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.1)
    return False


def open_without_reading(address, count, extra=()):
    """One connection with so many sessions, whose replies it does not take."""
    connection = RawConnection(address, window=0)
    opening = message(camera_control_pb2.ControlRequest(open=open_request()).SerializeToString())
    for _ in range(count):
        stream, call = connection.call(CONTROL, extra=extra)
        connection.send(call + frame(DATA, 0, stream, opening))
    return connection


def open_sessions(address):
    with stub(address) as service:
        return service.GetServerStats(server_pb2.GetServerStatsRequest(), timeout=5).open_sessions


class Sessions(unittest.TestCase):
    def test_idle_sessions_end_although_their_client_does_not_read(self):
        with Daemon("--session-idle-s", "2", "--max-sessions-per-client", "48") as daemon:
            attacker = open_without_reading(daemon.address, 48)
            self.assertTrue(until(lambda: open_sessions(daemon.address) == 48, 10))
            with self.assertRaises(grpc.RpcError):
                open_session(daemon.address)
            self.assertTrue(until(lambda: open_sessions(daemon.address) == 0, 15))
            open_session(daemon.address).close()
            attacker.close()

    def test_a_session_whose_token_is_revoked_ends_although_its_client_does_not_read(self):
        bearer = [("authorization", "Bearer game-0123456789abcdef")]
        with tempfile.TemporaryDirectory() as folder:
            access, users = pathlib.Path(folder, "access"), f"user {os.getuid()} admin\n"
            access.write_text(users + "token game control game-0123456789abcdef\n")
            with Daemon("--access-file", str(access), listen=("--listen", "none", "--listen-unix", folder + "/socket")) as daemon:
                attacker = open_without_reading(daemon.address, 4, extra=bearer)
                self.assertTrue(until(lambda: open_sessions(daemon.address) == 4, 10))
                access.write_text(users)
                daemon.process.send_signal(signal.SIGHUP)
                self.assertTrue(until(lambda: open_sessions(daemon.address) == 0, 10))
                attacker.close()


class Reflection(unittest.TestCase):
    def test_calls_whose_client_does_not_read_make_way(self):
        with Daemon() as daemon:
            attacker = RawConnection(daemon.address, window=0)
            for _ in range(16):
                stream, call = attacker.call(REFLECTION)
                attacker.send(call + frame(DATA, 0, stream, message(b"\x3a\x01*")))
            time.sleep(13)
            with grpc.insecure_channel(daemon.address) as channel:
                self.assertTrue(next(channel.stream_stream(REFLECTION)(iter([b"\x3a\x01*"]), timeout=5)))
            attacker.close()


class Calls(unittest.TestCase):
    def test_answers_that_are_not_taken_hold_no_threads(self):
        with Daemon() as daemon:
            attacker = RawConnection(daemon.address, window=0)
            for _ in range(80):
                stream, call = attacker.call(attack.SERVICE + "GetServerInfo")
                attacker.send(call + frame(DATA, attack.END_STREAM, stream, message(b"")))
            time.sleep(1)
            self.assertTrue(until(lambda: answered(daemon.address), 10))
            attacker.close()


def answered(address):
    try:
        return bool(info(address).version)
    except grpc.RpcError:
        return False


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=2, warnings="ignore")
