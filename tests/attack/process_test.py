"""Attacks on the process around the sessions, its log, files and signals: process_test.py SIGHTLINED STUBS."""
import os
import pathlib
import re
import resource
import signal
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

from daemon import Daemon, Healthy  # noqa: E402
from sessions import info, open_session, status_of  # noqa: E402


def check_config(text):
    with tempfile.NamedTemporaryFile("w", suffix=".conf") as file:
        file.write(text)
        file.flush()
        return subprocess.run([Daemon.path, "--config", file.name, "--check-config"], capture_output=True, text=True)


class Logs(unittest.TestCase):
    def test_a_log_that_is_not_read_stops_nothing(self):
        reader, writer = os.pipe()
        with open(writer, "wb") as end, Daemon("--log-level", "debug", stderr=end) as daemon:
            # The log of these sessions is far longer than a pipe holds.
            for _ in range(500):
                open_session(daemon.address, label="x" * 60).close()
            self.assertTrue(info(daemon.address).version)
            with open_session(daemon.address) as session:
                self.assertEqual(session.tick().sequence, 1)
            self.assertEqual(daemon.stop(timeout=8), 0)
        os.close(reader)

    def test_control_characters_are_escaped(self):
        with Daemon() as daemon:
            open_session(daemon.address, label="a\u009b31mb\u202ec").close()
            daemon.stop()
            self.assertIn("session opened", daemon.log())
            self.assertNotRegex(daemon.log(), "[\u0080-\u009f\u202e]")


class Recordings(unittest.TestCase):
    def test_a_folder_that_cannot_be_used_promises_no_file(self):
        with tempfile.NamedTemporaryFile() as file, Daemon("--record-dir", file.name + "/sub") as daemon:
            with open_session(daemon.address) as session:
                self.assertEqual(session.opened.recording_file, "")
                self.assertRegex(" ".join(session.opened.warnings), "recording: no file can be written")
            daemon.wait_for_log("nothing can be recorded")

    def test_a_file_that_cannot_be_deleted_does_not_stop_the_recording(self):
        with tempfile.TemporaryDirectory() as folder:
            stuck = pathlib.Path(folder, "sightline-20200101T000000.000Z-x-p001.mcap")
            stuck.write_bytes(bytes(3 << 20))
            if subprocess.run(["chattr", "+i", str(stuck)], capture_output=True).returncode != 0:
                self.skipTest("this file system cannot make a file immutable")
            try:
                with Daemon("--record-dir", folder, "--record-total-mib", "1", "--record-reserve-mib", "1") as daemon:
                    with open_session(daemon.address) as session:
                        session.tick()
                        time.sleep(1.5)
                        self.assertFalse(session.tick().flags.recording_degraded)
                    daemon.stop()
                self.assertEqual(len(list(pathlib.Path(folder).iterdir())), 2)
            finally:
                subprocess.run(["chattr", "-i", str(stuck)])


class Signals(unittest.TestCase):
    def test_the_first_daemon_leaves_the_second_ones_socket(self):
        with tempfile.TemporaryDirectory() as folder:
            path = folder + "/socket"
            listen = ("--listen", "none", "--listen-unix", path)
            with Daemon(listen=listen) as first:
                os.unlink(path)
                with Daemon(listen=listen) as second:
                    self.assertEqual(first.stop(), 0)
                    self.assertTrue(info(second.address).version)

    def test_a_quit_drains_and_others_are_ignored(self):
        for number in (signal.SIGUSR1, signal.SIGUSR2, signal.SIGHUP):
            with self.subTest(number), Daemon() as daemon:
                daemon.process.send_signal(number)
                time.sleep(0.3)
                self.assertTrue(info(daemon.address).version)
                self.assertEqual(daemon.stop(), 0)
        with Daemon() as daemon, open_session(daemon.address) as session:
            daemon.process.send_signal(signal.SIGQUIT)
            self.assertTrue(session.waits_for_drain())
            session.close()
            self.assertEqual(daemon.process.wait(10), 0)

    def test_sighup_reads_the_level_of_the_log_again(self):
        with tempfile.NamedTemporaryFile("w", suffix=".conf") as file:
            file.write("log-level = warning\n")
            file.flush()
            with Daemon("--config", file.name) as daemon:
                open_session(daemon.address).close()
                self.assertNotIn("session opened", daemon.log())
                file.seek(0)
                file.truncate()
                file.write("log-level = info\n")
                file.flush()
                daemon.process.send_signal(signal.SIGHUP)
                time.sleep(0.3)
                open_session(daemon.address).close()
                daemon.wait_for_log("session opened")


class Configuration(unittest.TestCase):
    def test_every_wrong_line_is_named(self):
        for text, told in (("[x\n", "line 1"), ("# fine\n\nbogus = 3\n", 'line 3.*"bogus"'), ("x\n", "line 1"), ("=1\n", "line 1"),
                           ("drain-s = 3\nmax-sessions = 0\n", "max-sessions.*line 2"), ("drain-s = nan\n", "drain-s.*line 1"),
                           ("step-budget-ms = nan\n", "step-budget-ms.*line 1"), ("[section]\n", "line 1")):
            with self.subTest(text):
                result = check_config(text)
                self.assertEqual(result.returncode, 2)
                self.assertRegex(result.stderr + result.stdout, told)

    def test_the_printed_configuration_is_valid(self):
        printed = subprocess.run([Daemon.path, "--print-config"], capture_output=True, text=True).stdout
        self.assertEqual(check_config(printed).returncode, 0)


class Memory(unittest.TestCase):
    def test_a_start_without_memory_says_so(self):
        for mib in (60, 100, 200, 400, 800, 1600):
            with self.subTest(mib):
                with Daemon(limits={"as": mib << 20}, wait=False) as daemon:
                    time.sleep(1.5)
                    if daemon.process.poll() is None:
                        self.assertEqual(daemon.stop(), 0)
                    else:
                        self.assertRegex(daemon.log(), "memory|failed to map")  # the latter by the dynamic linker

    def test_a_file_that_does_not_fit_ends_its_own_call(self):
        with Daemon("--max-upload-mib", "1024") as daemon:
            in_use = int(re.search(r"VmSize:\s+(\d+)", pathlib.Path(f"/proc/{daemon.pid}/status").read_text())[1]) << 10
            resource.prlimit(daemon.pid, resource.RLIMIT_AS, (in_use + (400 << 20),) * 2)
            for _ in range(20):
                status = status_of(daemon.address, upload=400 << 20)
                # On a busy machine gRPC may have no thread for the call. That is an answer as well, but not the one that is asked for here.
                if "Threadpool" not in status.details():
                    break
                time.sleep(0.5)
            self.assertEqual(status.code(), grpc.StatusCode.RESOURCE_EXHAUSTED, status.details())
            self.assertIn("memory", status.details())
            self.assertTrue(info(daemon.address).version)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]], verbosity=2, warnings="ignore")
