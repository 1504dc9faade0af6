"""Attacks on the connection: transport_test.py SIGHTLINED STUBS."""
import resource
import struct
import sys
import time
import unittest

import daemon as attack

attack.Daemon.path, STUBS = sys.argv[1:3]
attack.in_containers()
sys.path.insert(0, STUBS)

import grpc  # noqa: E402

from daemon import (CONTINUATION, CONTROL, DATA, END_HEADERS, END_STREAM, HEADERS, HEALTH, RST_STREAM, Daemon, Healthy,  # noqa: E402
                    RawConnection, connect, flood, frame, is_cut, request_headers)
from service_stub import CameraControlServiceStub  # noqa: E402
from sightline.v1 import server_pb2  # noqa: E402


def server_info(address, timeout=5):
    with grpc.insecure_channel(address) as channel:
        stub = CameraControlServiceStub(channel)
        return stub.GetServerInfo(server_pb2.GetServerInfoRequest(), timeout=timeout)


class Transport(unittest.TestCase):
    def assert_unharmed(self, healthy):
        result = healthy.result()
        self.assertEqual(result["error"], "")
        self.assertEqual(result["answered"], result["ticks"])

    def test_idle_connections_make_way_and_leave_the_daemon_listening(self):
        resource.setrlimit(resource.RLIMIT_NOFILE, (4096, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
        with Daemon(limits={"nofile": 1024}) as daemon:
            idle = [connect(daemon.address) for _ in range(1074)]
            time.sleep(0.5)
            self.assertTrue(server_info(daemon.address).version, "while they are open")
            for connection in idle:
                connection.close()
            self.assertTrue(server_info(daemon.address).version, "when they are closed again")

    def test_a_silent_connection_is_closed(self):
        with Daemon() as daemon:
            connection = connect(daemon.address, timeout=15)
            while connection.recv(4096):  # raises TimeoutError when it stays open
                pass

    def test_calls_that_are_opened_and_reset_cut_the_connection(self):
        with Daemon() as daemon:
            healthy, attacker = Healthy(daemon.address, 4), RawConnection(daemon.address)

            def resets():
                frames = b""
                for _ in range(64):
                    stream, call = attacker.call(CONTROL)
                    frames += call + frame(RST_STREAM, 0, stream, struct.pack(">I", 8))
                return frames
            sent = flood(attacker, resets, 4)
            self.assertTrue(is_cut(attacker))
            self.assertLess(sent, 4e6)
            self.assert_unharmed(healthy)
            self.assertLess(daemon.most_memory_mib(), 250)
            self.assertLess(daemon.log_bytes(), 1e6)

    def test_who_flooded_gets_few_connections_for_a_while(self):
        with Daemon() as daemon:
            def admitted(count):
                fresh = [RawConnection(daemon.address) for _ in range(count)]
                return sum(not is_cut(connection, 0.5) for connection in fresh)
            self.assertEqual(admitted(12), 12)
            attacker = RawConnection(daemon.address)
            flood(attacker, lambda: b"".join(attacker.call(CONTROL)[1] for _ in range(64)), 4)
            self.assertTrue(is_cut(attacker))
            self.assertLess(admitted(12), 12, "straight after")
            time.sleep(11)
            self.assertEqual(admitted(12), 12, "later")

    def test_endless_headers_cut_the_connection(self):
        with Daemon() as daemon:
            healthy, attacker = Healthy(daemon.address, 4), RawConnection(daemon.address)
            attacker.send(frame(HEADERS, 0, 1, request_headers(CONTROL)))
            # A string that is far longer than the frame, so that the server must keep what it has.
            attacker.send(frame(CONTINUATION, 0, 1, b"\x00\x01x\x7f\xff\xff\xff\xff\x07"))
            sent = flood(attacker, lambda: 4 * frame(CONTINUATION, 0, 1, bytes(16384)), 4)
            self.assertTrue(is_cut(attacker))
            self.assertLess(sent, 8e6)
            self.assert_unharmed(healthy)
            self.assertLess(daemon.most_memory_mib(), 250)

    def test_many_connections_of_a_client_share_a_limit(self):
        with Daemon() as daemon:
            healthy = Healthy(daemon.address, 6)
            attackers = [RawConnection(daemon.address) for _ in range(32)]
            begin = time.monotonic()
            cut, late_calls = 0, 0  # late: in the last 3 of 6 s, when the burst is used up
            while attackers and time.monotonic() < begin + 6:
                started = time.monotonic()
                for attacker in list(attackers):
                    try:  # at most 120 calls a second, with 60 resets, which one connection may do for ever
                        late_calls += 12 * (started > begin + 3)
                        for n in range(12):
                            stream, call = attacker.call(CONTROL)
                            attacker.send(call + (frame(RST_STREAM, 0, stream, struct.pack(">I", 8)) if n % 2 else b""))
                    except OSError:
                        attackers.remove(attacker)
                        cut += 1
                time.sleep(max(0.0, 0.1 - (time.monotonic() - started)))
            self.assertGreater(cut, 0)
            # Connections are cut until those that are left keep the limit of 400 calls a second, or do no more than the fair 4 each.
            self.assertLess(late_calls / 3, 400 + 4 * 32 + 120)
            self.assert_unharmed(healthy)

    def test_clients_that_speak_something_else_do_not_slow_down_others_at_their_address(self):
        with Daemon() as daemon:
            for _ in range(8):
                connection = connect(daemon.address)
                connection.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n" + bytes(100))
                is_cut(connection)
            fresh = [RawConnection(daemon.address) for _ in range(12)]
            self.assertEqual(sum(not is_cut(connection, 0.5) for connection in fresh), 12)

    def test_what_is_not_http2_is_cut(self):
        with Daemon() as daemon:
            connection = connect(daemon.address)
            connection.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n" + bytes(100))
            try:
                while connection.recv(4096):
                    pass
            except ConnectionResetError:
                pass
            self.assertTrue(server_info(daemon.address).version)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=2, warnings="ignore")
