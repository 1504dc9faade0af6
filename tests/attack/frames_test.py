"""Frames that carry nothing, and what gRPC holds for them: frames_test.py SIGHTLINED STUBS."""
import struct
import sys
import time
import unittest

import daemon as attack

attack.Daemon.path, STUBS = sys.argv[1:3]
attack.in_containers()
sys.path.insert(0, STUBS)

import attacks  # noqa: E402
import foreign_frames  # noqa: E402
from daemon import (DATA, END_HEADERS, END_STREAM, HEADERS, PING, WINDOW_UPDATE, Daemon, FlowingConnection, Healthy,  # noqa: E402
                    HealthyAllAlong, RawConnection, flood, frame, is_cut, message)
from frame_mixes import Mix  # noqa: E402
from mixes import play  # noqa: E402
from sessions import info  # noqa: E402

attacks.ATTACK_S = 3


class Frames(unittest.TestCase):
    def assert_unharmed(self, healthy):
        result = healthy.result()
        self.assertEqual((result["answered"], result["error"]), (result["ticks"], ""))

    def test_frames_that_carry_nothing_cut_the_connection(self):
        on_call, goaways = foreign_frames.on_open_call, foreign_frames.goaways
        kinds = {"goaway": goaways,
                 "headers below the newest call": foreign_frames.below_newest,
                 "trailers": on_call(lambda s: frame(HEADERS, END_HEADERS | END_STREAM, s, foreign_frames.TRAILERS)),
                 "empty continuation": foreign_frames.continuations,
                 "empty data": on_call(lambda s: frame(DATA, END_STREAM, s)),
                 "data of one byte": foreign_frames.pieces,
                 "data of no call": lambda _: lambda: 64 * frame(DATA, 0, 99, bytes(1000)),
                 "windows": on_call(lambda s: frame(WINDOW_UPDATE, 0, s, struct.pack(">I", 1))),
                 "pings": lambda _: lambda: 2048 * frame(PING, 0, 0, bytes(8)),
                 "an unknown type": lambda _: lambda: frame(99, 0, 0, bytes(16384))}
        with Daemon() as daemon:
            healthy = Healthy(daemon.address, 6)
            for number, (name, make) in enumerate(kinds.items()):
                with self.subTest(name):
                    connection = RawConnection(daemon.address, source=f"127.0.0.{number + 2}")
                    sent = flood(connection, make(connection), 3)
                    self.assertTrue(is_cut(connection))
                    self.assertLess(sent, 16e6)
            self.assert_unharmed(healthy)
            self.assertLess(daemon.most_memory_mib(), 120)

    def test_what_grpc_holds_of_messages_that_are_not_complete_is_bounded(self):
        """The connections that hold most are cut; the healthy session is another client, and goes on."""
        with Daemon("--transport-memory-mib", "32") as daemon:
            healthy = Healthy(daemon.address, 8)
            whole = message(bytes((4 << 20) - 8))[:-1]
            connections = [FlowingConnection(daemon.address, source=f"127.0.0.{n + 2}") for n in range(4)]
            for connection in connections:
                connection.send_all({connection.start_call(foreign_frames.SERVICE + "GetServerInfo"): whole for _ in range(16)}, 2)
            self.assertTrue(any(connection.ended for connection in connections))
            self.assertLess(daemon.most_memory_mib(), 150)
            self.assert_unharmed(healthy)
            self.assertIn("--transport-memory-mib", daemon.log())

    def test_a_long_message_that_is_completed_is_held_no_more(self):
        with Daemon("--transport-memory-mib", "32") as daemon:
            connection = FlowingConnection(daemon.address)
            whole = message(bytes(2 << 20))
            for _ in range(40):
                connection.send_all({connection.start_call(foreign_frames.SERVICE + "GetServerInfo"): whole}, 5)
            self.assertFalse(is_cut(connection, 0.5), daemon.log())

    def test_any_mix_of_frames_leaves_the_session_unharmed(self):
        """One session for all of them, since some mixes take all places for sessions."""
        with Daemon() as daemon:
            port = int(daemon.address.rsplit(":", 1)[1])
            healthy = HealthyAllAlong(daemon.address)
            for number in range(9001, 9013):
                with self.subTest(number, what=str(Mix(number))):
                    begin = time.monotonic()
                    play(number, port, 1)
                    self.assertNotIn(float("inf"), healthy.waits_ms(begin, time.monotonic()))
            self.assert_unharmed(healthy)
            self.assertIsNone(daemon.process.poll())
            self.assertTrue(info(daemon.address).version)
            self.assertEqual(daemon.stop(), 0)

    def test_the_same_number_makes_the_same_mix(self):
        self.assertEqual(Mix(7).round(-1), Mix(7).round(-1))
        self.assertNotEqual(Mix(7).round(-1), Mix(8).round(-1))


class Places(unittest.TestCase):
    def test_calls_that_are_refused_hold_no_place(self):
        with foreign_frames.tokens_and_unix_socket() as options:
            with Daemon("--max-connections", "32", *options["more"]) as daemon:
                files, address = options["files"], daemon.ready.read_text().split()[0]
                held = [c for n in (2, 3) for c in foreign_frames.take_places(address, files, f"127.0.0.{n}", 20)]
                time.sleep(0.5)
                self.assertTrue(all(files.may_speak(address) for _ in range(5)))
                # The attackers go on.
                held += foreign_frames.take_places(address, files, "127.0.0.2", 20)
                self.assertTrue(files.may_speak(address))
                for connection in held:
                    connection.close()


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=2, warnings="ignore")
