"""Attacks by files, signals and disks: files_test.py SIGHTLINED STUBS [CLASS.METHOD...]."""
import contextlib
import json
import os
import pathlib
import random
import signal
import subprocess
import sys
import tempfile
import time
import unittest

from trust_test import ACCESS, GAME, OTHER, ROOT, UNAUTHENTICATED, Authority, Case, Client, operators, wait_for  # puts the stubs on the path

import careless_files as careless
from daemon import Daemon
from exposition import scrape, value
from sessions import info, open_session


def check(*flags):
    return subprocess.run([Daemon.path, *map(str, flags), "--check-config"], capture_output=True, text=True, timeout=20)


class AccessFiles(Case):
    def started(self):
        path = str(self.files.folder / "socket")
        return self.daemon("--access-file", self.files.access, "--metrics-listen", "127.0.0.1:0", listen=("--listen", "none", "--listen-unix", path))

    def test_a_file_that_is_rewritten_in_place_ends_no_session(self):
        daemon = self.started()
        with Client(daemon.address, token=GAME).session() as game, Client(daemon.address, token=OTHER).session() as other:
            for n in range(60):
                careless.rewrite_in_place(self.files.access, ACCESS + f"# {n}\n", daemon.process)
                for session in (game, other):
                    self.assertEqual(session.tick().sequence, n + 1)
            daemon.wait_for_log("credentials taken over")
            for session in (game, other):
                self.assertEqual(session.tick().sequence, 61)
        self.assertNotIn("sessions ended", daemon.log())
        self.assertEqual(value(scrape(operators(daemon)), "sightline_credentials_current", file="access"), 1)

    def test_an_empty_file_is_refused_and_told(self):
        daemon = self.started()
        with Client(daemon.address, token=GAME).session() as session:
            for text in ("", "# nobody\n"):
                self.files.access.write_text(text)
                daemon.process.send_signal(signal.SIGHUP)
                wait_for(lambda: value(scrape(operators(daemon)), "sightline_credentials_current", file="access") == 0)
                self.assertTrue(session.tick().sequence)
                self.files.access.write_text(ACCESS)
                daemon.process.send_signal(signal.SIGHUP)
                wait_for(lambda: value(scrape(operators(daemon)), "sightline_credentials_current", file="access") == 1)
        self.assertEqual(value(scrape(operators(daemon)), "sightline_credential_changes_total", file="access", outcome="refused"), 2)
        daemon.wait_for_log("must name at least one token, certificate or user")

    def test_a_file_that_is_replaced_is_taken_over(self):
        daemon = self.started()
        with Client(daemon.address, token=GAME).session() as game, Client(daemon.address, token=OTHER).session() as other:
            fresh = self.files.folder / "fresh"
            fresh.write_text(ACCESS.replace("token game", "token renamed"))
            fresh.rename(self.files.access)
            daemon.process.send_signal(signal.SIGHUP)
            self.assertEqual(game.status().code(), UNAUTHENTICATED)
            self.assertEqual(other.tick().sequence, 1)

    def test_others_can_read_it(self):
        for mode, warned in ((0o600, False), (0o640, False), (0o644, True), (0o602, True)):
            with self.subTest(oct(mode)):
                self.files.access.chmod(mode)
                listen = ("--listen", "none", "--listen-unix", str(self.files.folder / f"socket{mode}"))
                with Daemon("--access-file", str(self.files.access), listen=listen) as daemon:
                    daemon.wait_for_log(" ready ")
                    self.assertEqual("credentials exposed" in daemon.log(), warned)
                self.assertEqual("warning" in check(*listen, "--access-file", self.files.access).stderr, warned)

    def test_one_secret_has_one_name(self):
        self.files.access.write_text(ACCESS + f"token second admin {GAME}\n")
        result = check("--listen", "none", "--listen-unix", self.files.folder / "socket", "--access-file", self.files.access)
        self.assertEqual(result.returncode, 2)
        self.assertRegex(result.stderr, 'line 7: the secret is there twice; it is already in line 2, for "game"')


class Checks(Case):
    """--check-config and the start judge alike."""

    def judged_alike(self, *flags):
        checked = check("--sampler", "embree", *flags)
        self.assertIn(checked.returncode, (0, 2), checked.stderr)
        with Daemon(*map(str, flags), listen=(), wait=False) as daemon:
            wait_for(lambda: daemon.ready.exists() or daemon.process.poll() is not None)
            started = daemon.ready.exists()
            log = "" if started else daemon.log()
        self.assertEqual(started, checked.returncode == 0, f"{flags}: {checked.stderr}{log}")
        if not started and daemon.process.returncode == 1:  # not one that is wrong by the flags alone
            reason = checked.stderr.splitlines()[0]
            self.assertIn(json.dumps(reason), log)
        return started

    def test_each_of_the_wrong_access_files(self):
        for text in careless.WRONG_ACCESS_FILES:
            with self.subTest(text):
                self.files.access.write_text(text)
                self.assertFalse(self.judged_alike("--listen", "none", "--listen-unix", self.files.folder / "socket", "--access-file", self.files.access))

    def test_random_files_and_flags(self):
        draw = random.Random(4)
        folder = self.files.folder
        secrets = ["0123456789abcdef", "1123456789abcdef", "sha256:" + 64 * "a", "sha256:1", "short", "0123456789#abcdef", 513 * "x"]
        other = Authority(folder, "other").sign("stranger")
        expired = self.files.authority.sign("expired", days=-1)
        certificate, key = self.files.certificate.read_bytes(), self.files.key.read_bytes()
        files = {"cut.pem": certificate[:-30], "half.key": key[:len(key) // 2], "empty": b"", "chain.pem": certificate + other[0].read_bytes()[:-60]}
        for name, data in files.items():
            (folder / name).write_bytes(data)
        os.mkfifo(folder / "pipe")
        os.mkdir(folder / "scenes")
        verdicts = []
        for n in range(60):
            lines = [" ".join(part for part in (draw.choice(["token", "token", "user", "certificate", "pass"]), draw.choice(["a", "b", "1000", "root", "*"]),
                                                draw.choice(["control", "observe", "admin", "root"][:3 + (draw.random() < 0.1)]),
                                                draw.choice(["", *secrets])) if part) for _ in range(draw.choice([0, 1, 1, 1, 2, 3]))]
            self.files.access.write_text("\n".join(lines) + draw.choice(["", "\n"]))
            flags = draw.choice([["--listen", "none", "--listen-unix", folder / f"socket{n}"], ["--listen", "127.0.0.1:0"], ["--listen", "0.0.0.0:0"],
                                 ["--listen", "localhost:0"], ["--listen", "[::1]:0"], ["--listen", "no such host:0"],
                                 ["--listen", "none", "--listen-unix", folder / "empty"], ["--listen", "none", "--listen-unix", "/tmp/" + 120 * "x"]])
            if draw.random() < 0.5:
                flags += draw.choice([["--access-file", self.files.access], ["--access-file", folder / "pipe"], ["--access-file", folder], ["--access-file", "/dev/zero"]][
                    :1 + 3 * (draw.random() < 0.2)])
            if draw.random() < 0.5:
                pairs = [(self.files.certificate, self.files.key), (self.files.certificate, other[1]), expired, (folder / "cut.pem", self.files.key),
                         (self.files.certificate, folder / "half.key"), (folder / "empty", self.files.key), (folder / "chain.pem", self.files.key)]
                pair = draw.choice(pairs[:1] * 6 + pairs[1:])
                flags += ["--tls-cert", pair[0], "--tls-key", pair[1]]
                if draw.random() < 0.3:
                    flags += ["--tls-client-ca", draw.choice([self.files.authority.certificate, folder / "empty", folder / "cut.pem"])]
            if draw.random() < 0.3:
                flags += draw.choice([["--scene-dir", folder / "scenes"], ["--scene-dir", folder / "empty"], ["--record-dir", folder / "empty"],
                                      ["--metrics-listen", "no such host:1"], ["--metrics-listen", "127.0.0.1:0"], ["--allow-insecure-network"]])
            verdicts.append(self.judged_alike(*flags))
        self.assertGreater(min(sum(verdicts), len(verdicts) - sum(verdicts)), 10, "both kinds come")

    def test_a_configuration_file_is_read_as_far_as_one_can_be_long(self):
        folder = self.files.folder
        (folder / "huge").write_text("#" * (2 << 20))
        os.mkfifo(folder / "pipe")
        for path in ("/dev/zero", folder / "pipe", folder, folder / "huge", folder / "nowhere"):
            with self.subTest(path):
                result = subprocess.run([Daemon.path, "--config", str(path), "--print-config"], capture_output=True, text=True, timeout=20)
                self.assertEqual(result.returncode, 2)
                self.assertRegex(result.stderr, "regular file|larger than 1 MiB|No such file")
        (folder / "long").write_text("#" * ((1 << 20) - 1) + "\n")
        self.assertEqual(check("--config", folder / "long").returncode, 0)


DRAINS, GOES_ON, LAST_WORDS, STOPS = "drains", "goes on", "last words", "stops"
# What becomes of the daemon, for every signal of signal(7) that can be caught.
FATES = {**{number: GOES_ON for number in careless.HARMLESS},
         **{number: DRAINS for number in (signal.SIGTERM, signal.SIGINT, signal.SIGQUIT, signal.SIGPWR, signal.SIGXCPU)}, signal.SIGHUP: GOES_ON,
         **{number: LAST_WORDS for number in (signal.SIGABRT, signal.SIGBUS, signal.SIGFPE, signal.SIGILL, signal.SIGSEGV, signal.SIGSYS, signal.SIGTRAP)},
         **{number: STOPS for number in (signal.SIGSTOP, signal.SIGTSTP, signal.SIGTTIN, signal.SIGTTOU)}}


def name_of(number):
    with contextlib.suppress(ValueError):
        return signal.Signals(number).name
    return f"signal {number}"


class Signals(unittest.TestCase):
    def test_the_table_is_whole(self):
        self.assertEqual(set(FATES), signal.valid_signals() - {signal.SIGKILL})

    def test_those_that_must_not_end_it(self):
        with Daemon() as daemon, open_session(daemon.address) as session:
            for number in (number for number, fate in FATES.items() if fate == GOES_ON):
                with self.subTest(name_of(number)):
                    daemon.process.send_signal(number)
                    time.sleep(0.01)
                    self.assertTrue(session.tick().sequence)
            self.assertTrue(info(daemon.address).version)
            for word in ("SIGALRM", "SIGPROF", "SIGUSR1", "SIGRTMIN+3"):
                daemon.wait_for_log(f"signal ignored signal={word}")
            session.close()
            self.assertEqual(daemon.stop(), 0)

    def test_those_that_end_it_in_order(self):
        for number in (number for number, fate in FATES.items() if fate == DRAINS):
            with self.subTest(name_of(number)), Daemon() as daemon, open_session(daemon.address) as session:
                daemon.process.send_signal(number)
                self.assertTrue(session.waits_for_drain())
                if number == signal.SIGXCPU:  # it comes again every second
                    daemon.process.send_signal(number)
                    time.sleep(0.2)
                    self.assertIsNone(daemon.process.poll())
                session.close()
                self.assertEqual(daemon.process.wait(10), 0)
                daemon.wait_for_log(f"stopping signal={name_of(number)}")

    def test_those_that_end_it_at_once_leave_a_word(self):
        for form, told in (("text", "error the process ends signal={}"), ("json", '"level":"error","message":"the process ends","signal":"{}"')):
            for number in (number for number, fate in FATES.items() if fate == LAST_WORDS):
                with self.subTest(name_of(number), form=form), Daemon("--log-format", form, limits={"core": 0}) as daemon:
                    daemon.process.send_signal(number)
                    self.assertEqual(daemon.process.wait(10), -number)
                    last = daemon.log().splitlines()[-1]
                    self.assertIn(told.format(name_of(number)), last)
                    if form == "json":
                        self.assertRegex(json.loads(last)["time"], r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z$")

    def test_those_that_stop_it_let_it_go_on_later(self):
        with Daemon() as daemon, open_session(daemon.address) as session:
            for number in (number for number, fate in FATES.items() if fate == STOPS):
                with self.subTest(name_of(number)):
                    daemon.process.send_signal(number)
                    time.sleep(0.1)
                    daemon.process.send_signal(signal.SIGCONT)
                    self.assertTrue(session.tick().sequence)

    def test_a_limit_of_processor_time_drains_before_it_kills(self):
        with Daemon("--drain-s", "1", limits={"cpu": "4:4"}) as daemon:
            session = open_session(daemon.address)
            drained = False
            with contextlib.suppress(Exception):
                while not drained:
                    session.sends()
                    drained = session.reads().HasField("drain")
            self.assertTrue(drained)
            session.close()
            self.assertEqual(daemon.process.wait(20), 0)
            daemon.wait_for_log("stopping signal=SIGXCPU")


class Recordings(unittest.TestCase):
    def test_a_limit_on_the_size_of_files_degrades_the_recording_only(self):
        with tempfile.TemporaryDirectory() as folder, \
                Daemon("--record-dir", folder, "--record-reserve-mib", "1", limits={"fsize": 60_000}) as daemon, open_session(daemon.address) as session:
            wait_for(lambda: session.tick().flags.recording_degraded, 30)
            daemon.wait_for_log("recording degraded")
            self.assertIn("File too large", daemon.log())
            self.assertTrue(session.tick().sequence)
            session.close()
            self.assertEqual(daemon.stop(), 0)

    def test_a_full_disk_has_one_reason(self):
        with careless.small_disk(2) as folder:
            if folder is None:
                self.skipTest("no file system can be mounted here")
            with Daemon("--record-dir", folder + "/recorded", "--record-reserve-mib", "0") as daemon, open_session(daemon.address) as session:
                session.tick()
                careless.fill(folder)
                wait_for(lambda: session.tick().flags.recording_degraded, 30)
                end = time.monotonic() + 2
                while time.monotonic() < end:
                    session.tick()
                os.unlink(folder + "/fill")
                wait_for(lambda: not session.tick().flags.recording_degraded, 30)
                session.close()
                self.assertEqual(daemon.stop(), 0)
                told = [line for line in daemon.log().splitlines() if "recording degraded" in line]
                self.assertEqual(len(told), 1, told)
                self.assertIn("No space left on device", told[0])
            gaps = [json.loads(line)["message"] for file in sorted(pathlib.Path(folder, "recorded").iterdir())
                    for line in careless.sightline("dump", file, "--topic", "/sightline/gap").stdout.splitlines()]
            self.assertEqual([gap["reason"] for gap in gaps], ["REASON_NO_SPACE"])

    def test_a_session_of_a_moment_leaves_a_recording(self):
        # A thread of the daemon writes it, which a busy machine can delay: then a younger session leaves nothing.
        for age in (0.05, 0.1, 0.2, 0.25):
            shown = careless.leaves_after_kill(age)
            if [result.returncode for result in shown] == [0]:
                break
        self.assertEqual([result.returncode for result in shown], [0], shown)
        self.assertEqual(json.loads(shown[0].stdout)["session"]["label"], "short")

    def test_copies_on_a_full_disk_name_the_disk(self):
        with careless.small_disk(1) as full, tempfile.TemporaryDirectory() as folder:
            if full is None:
                self.skipTest("no file system can be mounted here")
            with Daemon("--record-dir", folder, "--record-reserve-mib", "1") as daemon:
                with open_session(daemon.address) as session:
                    for _ in range(30):
                        session.tick()
                daemon.stop()
            source, = pathlib.Path(folder).iterdir()
            careless.fill(full)
            for verb in ("recover", "cut", "dump"):
                with self.subTest(verb):
                    result = careless.sightline(verb, source, "--out", f"{full}/copy")
                    self.assertEqual(result.returncode, 1)
                    self.assertIn(f"{full}/copy", result.stderr)
                    self.assertIn("No space left on device", result.stderr)
                    self.assertNotIn(str(source), result.stderr)
                    self.assertFalse(os.path.exists(f"{full}/copy"), "what is not complete is not left")


class Bombs(unittest.TestCase):
    """400 chunks of 64 MiB in less than a megabyte."""

    def test_every_verb_refuses_it(self):
        with tempfile.TemporaryDirectory() as folder:
            for finished in (False, True):
                path = pathlib.Path(folder, f"bomb{finished}.mcap")
                path.write_bytes(careless.bomb(400, finished=finished))
                self.assertLess(path.stat().st_size, 1 << 20)
                for verb in ("info", "verify", "recover", "dump", "cut", "replay", "report", "compare"):
                    more = {"recover": ["--out", f"{folder}/copy"], "cut": ["--out", f"{folder}/copy"], "report": ["--out", f"{folder}/page"], "compare": [path]}
                    with self.subTest(verb, finished=finished):
                        result = careless.sightline(verb, path, *more.get(verb, []))
                        self.assertNotEqual(result.returncode, 0)
                        self.assertIn("unpack to more than", result.stderr)
                        self.assertFalse(os.path.exists(f"{folder}/copy"))

    def test_who_asks_for_it_reads_all_of_it(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "bomb.mcap")
            path.write_bytes(careless.bomb(8))
            self.assertIn("unpack to more than", careless.sightline("info", path).stderr)
            self.assertEqual(careless.sightline("info", path, "--max-unpacked-gib", "1").returncode, 0)


class Logs(unittest.TestCase):
    def test_no_format_leaves_an_unruly_character(self):
        labels = [f"a{chr(point)}b" for point in careless.UNRULY] + ["\u00e9\u65e5\U0001f3a5"]
        for form in ("text", "json"):
            with self.subTest(form), Daemon("--log-format", form) as daemon:
                for label in labels:
                    open_session(daemon.address, label=label).close()
                daemon.stop()
                data = daemon.log_path.read_bytes()
                self.assertEqual({byte for byte in data if not 0x20 <= byte < 0x7F} - {0x0A}, set())
                if form == "json":
                    told = {json.loads(line).get("label") for line in data.decode().splitlines()}
                    self.assertEqual(set(labels) - told, set())


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
