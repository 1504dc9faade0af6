"""Work that hardly ends: work_test.py SIGHTLINED STUBS."""
import glob
import pathlib
import subprocess
import sys
import tempfile
import threading
import time
import unittest

import daemon as attack

attack.Daemon.path, STUBS = sys.argv[1:3]
attack.in_containers()
sys.path.insert(0, STUBS)

import grpc  # noqa: E402

from daemon import Daemon  # noqa: E402
from endless_work import empty_objects, heavy_tick_s, honest_nodes, open_for_minutes, processor_s, soup, ticks_while_stopped  # noqa: E402
from relay import Relay  # noqa: E402
from scenes import glb, scene_of  # noqa: E402
from sessions import open_session, upload  # noqa: E402

EXHAUSTED = grpc.StatusCode.RESOURCE_EXHAUSTED


class Background(threading.Thread):
    """Calls something on a thread of its own; `result` is what it returned, or the error of its RPC."""

    def __init__(self, call, *arguments, **more):
        super().__init__()
        self.call, self.arguments, self.more, self.result = call, arguments, more, None
        self.start()

    def run(self):
        try:
            self.result = self.call(*self.arguments, **self.more)
        except (grpc.RpcError, ValueError) as error:  # the latter: its channel was closed
            self.result = error


class Files(unittest.TestCase):
    def test_the_time_for_json_grows_with_its_length(self):
        with Daemon("--geometry-memory-mib", "256") as daemon:
            def spent(size):
                before = processor_s(daemon)
                upload(daemon.address, empty_objects(size))
                return processor_s(daemon) - before
            # Linear: 27 times the length takes 27 times as long. With the square it would be 700 times: 20 minutes instead of some seconds.
            self.assertLess(spent(8_000_000), 20 + 100 * spent(300_000))
            self.assertTrue(upload(daemon.address, honest_nodes(100_000)).hash)

    def test_a_file_that_takes_too_long_is_refused_by_name(self):
        with Daemon("--max-load-s", "0.03") as daemon:
            with self.assertRaises(grpc.RpcError) as raised:
                upload(daemon.address, soup(150_000, 1.0))
            self.assertEqual(raised.exception.code(), EXHAUSTED)
            self.assertIn("--max-load-s", raised.exception.details())
            self.assertTrue(upload(daemon.address, glb("small")).hash)

    def test_a_target_whose_table_takes_too_long_is_refused_by_name(self):
        with Daemon("--max-load-s", "2") as daemon:
            with self.assertRaises(grpc.RpcError) as raised:
                open_for_minutes(daemon.address)
            self.assertEqual(raised.exception.code(), EXHAUSTED)
            self.assertIn("--max-load-s", raised.exception.details())
            open_session(daemon.address).close()

    def test_uploads_of_two_clients_hold_nobody_up(self):
        with tempfile.TemporaryDirectory() as folder, \
                Daemon("--listen-unix", folder + "/socket", "--geometry-memory-mib", "256") as daemon:
            tcp, unix = daemon.ready.read_text().split()
            with Relay(tcp, "127.0.0.2") as second:
                # Each of them held a thread for ten minutes.
                uploads = [Background(upload, address, empty_objects(6_000_000), timeout=100) for address in (tcp, second.address) for _ in range(3)]
                time.sleep(0.5)
                with open_session(unix) as session:
                    for _ in range(10):
                        session.tick()
                self.assertTrue(upload(unix, glb("small")).hash)
                for one in uploads:
                    one.join()
                self.assertEqual([one.result.hash for one in uploads], [uploads[0].result.hash] * 6)

    def test_loading_ends_with_the_call_and_with_the_daemon(self):
        with Daemon("--max-load-s", "0") as daemon:
            def is_busy():
                before = processor_s(daemon)
                time.sleep(1)
                return processor_s(daemon) - before > 0.3

            def open_for_long(channel):
                return Background(open_for_minutes, daemon.address, channel=channel)
            channel = grpc.insecure_channel(daemon.address)
            given_up = open_for_long(channel)
            while not is_busy():
                self.assertTrue(given_up.is_alive())
            channel.close()
            given_up.join()
            while is_busy():
                pass  # until the test's own time is up
            with grpc.insecure_channel(daemon.address) as channel:
                stopped = open_for_long(channel)
                while not is_busy():
                    self.assertTrue(stopped.is_alive())
                self.assertEqual(daemon.stop(20), 0)
                stopped.join()
                # It was told that the daemon drains, and then that it is gone.
                self.assertFalse(stopped.result.opened.session_id)
                self.assertIn(stopped.result.status().code(), (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED))


class Steps(unittest.TestCase):
    def test_steps_among_very_many_triangles_are_bounded(self):
        for size_m, half_m in ((60, 300), (4, 30)):
            with self.subTest(size_m=size_m), Daemon() as daemon:
                scene = upload(daemon.address, soup(150_000, size_m, half_m)).hash
                with open_session(daemon.address, scene=scene_of(scene)) as session:
                    session.tick()
                    before = processor_s(daemon)
                    for n in range(15):
                        session.tick(transforms={"ids": [1], "positions": [0.3 * n, 0.9, 0]})
                    # Processor time, which a busy machine does not change by much. It was over a second a step.
                    self.assertLess((processor_s(daemon) - before) / 15, 0.4)


class Stops(unittest.TestCase):
    def test_a_daemon_that_does_not_run_refuses_nothing_and_is_replayed(self):
        with Daemon("--max-step-cost-ms", "0", "--max-maps-ms", "0") as daemon:
            tick_s = heavy_tick_s(daemon)
        # Far more than the maps of a tick take on this machine, and less than a stop.
        limit_s = max(0.05, 4 * tick_s)
        with tempfile.TemporaryDirectory() as folder, \
                Daemon("--record-dir", folder, "--max-step-cost-ms", "0", "--max-maps-ms", f"{1e3 * limit_s:.0f}") as daemon:
            answered, refused, stops = ticks_while_stopped(daemon, 200, 3 * limit_s)
            self.assertGreater(stops, 3)
            self.assertEqual((answered, refused), (200, 0))
            daemon.stop()
            recording, = glob.glob(folder + "/*.mcap")
            sightline = pathlib.Path(Daemon.path).with_name("sightline")
            replayed = subprocess.run([str(sightline), "replay", recording], capture_output=True, text=True)
            self.assertRegex(replayed.stdout, "result +equal", replayed.stderr)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=2, warnings="ignore")
