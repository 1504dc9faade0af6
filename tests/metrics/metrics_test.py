#!/usr/bin/env python3
"""metrics_test.py SIGHTLINED SIGHTLINE PYTHON_FOLDER [PROMTOOL]: what the daemon says of itself, beside what a client has counted."""
import json
import pathlib
import queue
import re
import signal
import subprocess
import sys
import tempfile
import time
import unittest

SIGHTLINED, SIGHTLINE = sys.argv[1:3]
sys.path[:0] = [sys.argv[3], str(pathlib.Path(__file__).parents[1] / "attack")]
PROMTOOL = sys.argv[4] if len(sys.argv) > 4 and not sys.argv[4].endswith("NOTFOUND") else None

import grpc  # noqa: E402
from daemon import Daemon  # noqa: E402
from exposition import get, scrape, value  # noqa: E402
from held_thread import HeldThread  # noqa: E402
from observed_daemon import camera, control, opening, start, until  # noqa: E402
from sightline.v1 import diagnostics_pb2  # noqa: E402
from sightline_client import Camera, box, capsule  # noqa: E402

Daemon.path = SIGHTLINED
STAGES = ("scene", "bound", "sample", "aggregate", "move")


def healthcheck(*arguments):
    return subprocess.run([SIGHTLINED, "healthcheck", *arguments], capture_output=True, text=True, timeout=30)


class Exposition(unittest.TestCase):
    def test_prometheus_own_linter_has_no_complaint(self):
        if not PROMTOOL:
            self.skipTest("promtool is not installed")
        with start() as daemon:
            _, text = get(daemon.operators, "/metrics")
        result = subprocess.run([PROMTOOL, "check", "metrics"], input=text, capture_output=True, text=True)
        self.assertEqual((result.returncode, result.stdout, result.stderr), (0, "", ""))

    def test_every_family_has_a_type_and_a_help_text_and_is_there_from_the_start(self):
        with start() as daemon:
            before = scrape(daemon.operators)
            with camera(daemon) as one:
                one.tick(0.1, {})
            after = scrape(daemon.operators)
        for name, family in before.items():
            self.assertIn(family.kind, ("counter", "gauge", "histogram"), name)
            self.assertTrue(family.help.endswith("."), name)
            self.assertTrue(family.samples, name)
        self.assertEqual({key for family in before.values() for key in family.samples},
                         {key for family in after.values() for key in family.samples})

    def test_they_are_those_of_the_page_about_metrics(self):
        page = (pathlib.Path(__file__).parents[2] / "deploy/METRICS.md").read_text()
        listed = dict(re.findall(r"^\| `(\w+)` \| (counter|gauge|histogram) \|", page, re.MULTILINE))
        with start() as daemon:
            exported = {name: family.kind for name, family in scrape(daemon.operators).items()}
        self.assertEqual(exported, listed)

    def test_steps_are_counted_for_each_level_of_quality_and_for_no_other(self):
        with start() as daemon:
            _, text = get(daemon.operators, "/metrics")
        self.assertEqual(re.findall(r'^sightline_steps_total\{level="(\w+)"\}', text, re.MULTILINE), [str(level) for level in range(6)])

    def test_only_known_pages_are_answered_and_only_read(self):
        with start() as daemon:
            self.assertEqual(get(daemon.operators, "/metrics/more")[0], 404)
            self.assertEqual(get(daemon.operators, "/../etc/passwd")[0], 404)
            self.assertEqual(get(daemon.operators, "/metrics", "DELETE")[0], 405)
            self.assertEqual(get(daemon.operators, "/metrics", "HEAD"), (200, ""))

    def test_a_port_in_use_is_an_error_that_names_the_flag(self):
        with start() as daemon:
            result = subprocess.run([SIGHTLINED, "--listen", "127.0.0.1:0", "--sampler", "embree", "--metrics-listen", daemon.operators],
                                    capture_output=True, text=True, timeout=60)
            self.assertEqual(result.returncode, 1)
            self.assertIn("--metrics-listen", result.stderr)
            self.assertEqual(get(daemon.operators, "/livez")[0], 200)


class Figures(unittest.TestCase):
    def test_they_agree_with_what_a_client_counted(self):
        with start() as daemon, camera(daemon) as one:
            for i in range(1, 51):
                one.tick(i / 60, {1: (-1 + i / 100, 0.9, 0)})
            until(lambda: value(scrape(daemon.operators), "sightline_steps_total", level="0") == 50, "50 steps")
            with self.assertRaises(Exception):
                one.tick(0.0, {})  # game time goes back
            families = scrape(daemon.operators)
            get_value = lambda name, **labels: value(families, name, **labels)  # noqa: E731
            self.assertEqual(get_value("sightline_ticks_received_total"), 51)
            self.assertEqual([get_value("sightline_ticks_total", outcome=outcome) for outcome in ("answered", "merged", "refused")], [50, 0, 1])
            self.assertEqual((get_value("sightline_sessions_open"), get_value("sightline_sessions_opened_total")), (1, 1))
            self.assertEqual(get_value("sightline_sessions_at_quality_level", level="0"), 1)
            for name in ("sightline_tick_age_seconds", "sightline_tick_queue_seconds", "sightline_step_seconds"):
                self.assertEqual(get_value(name + "_count"), 50, name)
            stages = sum(get_value("sightline_step_stage_seconds_sum", stage=stage) for stage in STAGES)
            self.assertAlmostEqual(stages, get_value("sightline_step_seconds_sum"), places=6)
            self.assertLess(get_value("sightline_step_seconds_sum"), get_value("sightline_tick_age_seconds_sum"))
            self.assertGreater(get_value("sightline_received_bytes_total"), 51 * 40)
            self.assertGreater(get_value("sightline_sent_bytes_total"), 50 * 100)
            self.assertEqual(get_value("sightline_connections_open"), 1)
            self.assertGreater(get_value("process_resident_memory_bytes"), 5e6)
            self.assertAlmostEqual(get_value("process_start_time_seconds"), time.time(), delta=120)

    def test_buckets_are_cumulative_and_end_with_the_count(self):
        with start() as daemon:
            with camera(daemon) as one:
                for i in range(1, 21):
                    one.tick(i / 60, {})
            families = scrape(daemon.operators)
        for name, family in families.items():
            if family.kind != "histogram":
                continue
            series = {}
            for (sample, labels), number in family.samples.items():
                if sample == name + "_bucket":
                    rest = tuple(label for label in labels if label[0] != "le")
                    series.setdefault(rest, []).append((float(dict(labels)["le"]), number))
            for labels, buckets in series.items():
                counts = [number for _, number in sorted(buckets)]
                self.assertEqual(counts, sorted(counts), name)
                self.assertEqual(counts[-1], value(families, name + "_count", **dict(labels)), name)
                self.assertEqual(counts[-1], 20, name)

    def test_buckets_end_at_powers_of_two_from_16_us_to_2_seconds(self):
        """As the page about metrics says."""
        with start() as daemon:
            families = scrape(daemon.operators)
        for name, family in families.items():
            if family.kind == "histogram":
                ends = {float(dict(labels)["le"]) for sample, labels in family.samples if sample == name + "_bucket"}
                self.assertEqual([round(end * 1e6) for end in sorted(ends)[:-1]], [2**k for k in range(4, 22)], name)
                self.assertEqual(max(ends), float("inf"), name)

    def test_an_access_file_that_cannot_be_used_is_counted(self):
        with tempfile.TemporaryDirectory() as folder:
            access = pathlib.Path(folder, "access")
            access.write_text("user * control\n")
            with start("--access-file", str(access), listen=("--listen", "none", "--listen-unix", folder + "/socket")) as daemon:
                told = lambda: [value(scrape(daemon.operators), "sightline_credential_changes_total", file=file, outcome=outcome)  # noqa: E731
                                for file in ("access", "certificate") for outcome in ("taken_over", "refused")]
                self.assertEqual(told(), [0, 0, 0, 0])
                access.write_text("nonsense\n")
                daemon.process.send_signal(signal.SIGHUP)
                until(lambda: told() == [0, 1, 0, 0], "refused")
                self.assertEqual(value(scrape(daemon.operators), "sightline_credentials_current", file="access"), 0)
                access.write_text("user * admin\n")
                daemon.process.send_signal(signal.SIGHUP)
                until(lambda: told() == [1, 1, 0, 0], "taken over")
                families = scrape(daemon.operators)
        self.assertEqual(value(families, "sightline_credentials_current", file="access"), 1)
        self.assertEqual(value(families, "sightline_credentials_current", file="certificate"), 1)
        self.assertEqual(value(families, "sightline_certificate_expiry_timestamp_seconds"), 0, "there is no TLS")

    def test_a_session_that_ends_is_counted_by_its_status(self):
        with start() as daemon:
            with camera(daemon) as one:
                one.tick(0.1, {})
            until(lambda: value(scrape(daemon.operators), "sightline_sessions_closed_total", code="OK") == 1, "closed")
            families = scrape(daemon.operators)
            self.assertEqual(value(families, "sightline_sessions_at_quality_level", level="0"), 0)
            self.assertEqual(value(families, "sightline_sessions_open"), 0)

    def test_a_recording_daemon_says_what_it_has_written(self):
        with tempfile.TemporaryDirectory() as folder, start("--record-dir", folder, "--record-reserve-mib", "0") as daemon:
            with camera(daemon) as one:
                one.tick(0.1, {})
            until(lambda: list(pathlib.Path(folder).glob("*.mcap")) and value(scrape(daemon.operators), "sightline_recording_sessions") == 0,
                  "the file is complete")
            families = scrape(daemon.operators)
            self.assertEqual(value(families, "sightline_recording_enabled"), 1)
            self.assertEqual(value(families, "sightline_recording_folder_usable"), 1)
            size = sum(path.stat().st_size for path in pathlib.Path(folder).glob("*.mcap"))
            self.assertEqual(value(families, "sightline_recording_bytes_total"), size)


BLIND = ("seeking", "blocked", "waiting", "lost")


def status_of(reply):
    return diagnostics_pb2.TrackingStatus.Name(reply.status)[len("TRACKING_STATUS_"):].lower()


def count(replies, required=(1, 2)):
    """What the replies say that the camera showed, by plain sums. The first reply ends no time."""
    sums = dict(target=0.0, shown=0.0, shot=0.0, kept=0.0, worth=0.0, cuts=sum(reply.cut for reply in replies))
    for before, reply in zip(replies, replies[1:]):
        passed_s = reply.time_s - before.time_s
        sums[status_of(reply)] = sums.get(status_of(reply), 0.0) + passed_s
        for target in reply.targets:
            if target.id in required:
                sums["target"] += passed_s
                sums["shown"] += passed_s * target.filtered_share * target.picture_share
        if reply.HasField("shot"):
            sums["shot"] += passed_s
            sums["worth"] += passed_s * reply.shot.worth
            sums["kept"] += passed_s * (max(reply.shot.side.deviation, reply.shot.height.deviation, reply.shot.distance.deviation) <= 0)
    return sums


class Cameras(unittest.TestCase):
    def film(self, one, seconds, begin_s=0.0):
        """A wall stands before both for the middle third."""
        replies = []
        ticks = round(60 * seconds)
        for i in range(1, ticks + 1):
            wall_z = 0.8 if ticks < 3 * i < 2 * ticks else 60
            replies.append(one.tick(begin_s + i / 60, {1: (-1 + i / 200, 0.9, 0), 2: (1, 0.9, i / 300), 3: (0, 2, wall_z)}))
        return replies

    def camera(self, daemon, **more):
        return Camera(daemon.address, position=(0, 1.6, 6), targets={1: capsule(radius=0.3, height=1.8), 2: capsule(radius=0.3, height=1.8)},
                      occluders={3: box(40, 30, 0.2)}, at={1: (-1, 0.9, 0), 2: (1, 0.9, 0), 3: (0, 2, 60)}, **more)

    def test_what_they_showed_is_what_their_replies_say(self):
        with start() as daemon:
            with self.camera(daemon) as one:
                replies = self.film(one, 6)
                expected = count(replies)
                until(lambda: value(scrape(daemon.operators), "sightline_steps_total", level="0") == len(replies), "all steps")
                families = scrape(daemon.operators)
            until(lambda: value(scrape(daemon.operators), "sightline_sessions_open") == 0, "the session ends")
            ended = scrape(daemon.operators)
        self.assertGreater(sum(expected.get(name, 0.0) for name in BLIND), 0.5, "the wall hides them")
        self.assertGreater(expected["tracking"], 1.0)
        for families in (families, ended):
            for status in ("tracking", "partial_view", "holding", *BLIND):
                self.assertAlmostEqual(value(families, "sightline_camera_seconds_total", status=status), expected.get(status, 0.0), places=6)
            for name, key in (("target_seconds", "target"), ("target_shown_seconds", "shown"), ("shot_seconds", "shot"), ("shot_kept_seconds", "kept"),
                              ("shot_worth_seconds", "worth"), ("cuts", "cuts")):
                self.assertAlmostEqual(value(families, f"sightline_{name}_total"), expected[key], places=6, msg=name)
        self.assertEqual(sum(value(ended, "sightline_sessions_by_status", status=status) for status in ("tracking", "partial_view", "holding", *BLIND)), 0)

    def test_sessions_lists_them_and_the_blind_one_first(self):
        with start() as daemon, self.camera(daemon, label="good") as good, self.camera(daemon, label="walled in") as bad:
            for i in range(1, 181):
                good.tick(i / 60, {})
                bad.tick(i / 60, {3: (0, 2, 0.8)})
            reply = bad.tick(181 / 60, {3: (0, 2, 0.8)})
            until(lambda: value(scrape(daemon.operators), "sightline_steps_total", level="0") == 361, "all steps")
            families = scrape(daemon.operators)  # first: after 5 s without a tick the longest time is told no more
            answer = subprocess.run([SIGHTLINE, "sessions", "--server", daemon.address, "--json"], capture_output=True, text=True, timeout=60)
            text = subprocess.run([SIGHTLINE, "sessions", "--address", daemon.address], capture_output=True, text=True, timeout=60)
        told = {row["label"]: row for row in json.loads(answer.stdout)["sessions"]}
        self.assertEqual(set(told), {"good", "walled in"})
        self.assertEqual(told["good"]["status"], "TRACKING_STATUS_TRACKING")
        self.assertEqual(told["good"]["blind_s"], 0)
        self.assertIn(status_of(reply), BLIND)
        self.assertEqual(told["walled in"]["status"], "TRACKING_STATUS_" + status_of(reply).upper())
        self.assertGreater(told["walled in"]["blind_s"], 2.0)
        self.assertEqual((int(told["good"]["steps"]), int(told["walled in"]["steps"])), (180, 181))
        self.assertEqual(value(families, "sightline_sessions_blind"), 1)
        self.assertAlmostEqual(value(families, "sightline_longest_blind_seconds"), told["walled in"]["blind_s"], places=6)
        self.assertEqual(value(families, "sightline_sessions_by_status", status="tracking"), 1)
        self.assertLess(text.stdout.index("walled in"), text.stdout.index("good"))

    def test_a_daemon_without_sessions_says_so(self):
        with start() as daemon:
            text = subprocess.run([SIGHTLINE, "sessions", "--server", daemon.address], capture_output=True, text=True, timeout=60)
        self.assertEqual(text.returncode, 0)
        self.assertIn("no session is open", text.stdout)


class Health(unittest.TestCase):
    def test_a_daemon_that_serves_is_alive_and_ready(self):
        with start() as daemon:
            self.assertEqual(get(daemon.operators, "/livez"), (200, "ok\n"))
            self.assertEqual(get(daemon.operators, "/readyz"), (200, "ok\n"))
            for flags in ((), ("--live",)):
                result = healthcheck("--address", daemon.address, *flags)
                self.assertEqual((result.returncode, result.stderr), (0, ""))
                self.assertIn("SERVING", result.stdout)

    def test_healthcheck_finds_the_daemon_by_the_daemon_s_own_flags(self):
        with tempfile.TemporaryDirectory() as folder:
            flags = ("--listen", "none", "--listen-unix", folder + "/socket")
            with Daemon(listen=flags) as daemon:
                self.assertEqual(healthcheck(*flags).returncode, 0)
                config = pathlib.Path(folder, "sightline.conf")
                config.write_text(subprocess.run([SIGHTLINED, *flags, "--print-config"], capture_output=True, text=True).stdout)
                self.assertEqual(healthcheck("--config", str(config)).returncode, 0)
                daemon.stop()
            result = healthcheck(*flags)
            self.assertEqual(result.returncode, 1)
            self.assertIn(folder + "/socket", result.stderr)

    def test_a_daemon_that_drains_is_alive_and_not_ready(self):
        # A client that does not react to `Drain` keeps its session, and the daemon waits for it.
        messages = queue.Queue()
        messages.put(opening())
        with start("--drain-s", "60") as daemon, grpc.insecure_channel(daemon.address) as channel:
            address = daemon.address
            replies = control(channel, iter(messages.get, None))
            self.assertTrue(next(replies).HasField("opened"))
            daemon.process.terminate()
            until(lambda: get(daemon.operators, "/readyz")[0] == 503, "not ready")
            self.assertIn("stopping", get(daemon.operators, "/readyz")[1])
            self.assertEqual(get(daemon.operators, "/livez")[0], 200)
            self.assertEqual(value(scrape(daemon.operators), "sightline_ready"), 0)
            result = healthcheck("--address", address)
            self.assertEqual(result.returncode, 1)
            self.assertIn("NOT_SERVING", result.stderr)
            self.assertEqual(healthcheck("--address", address, "--live").returncode, 0)
            messages.put(None)
            self.assertEqual(daemon.process.wait(30), 0)

    def hold(self, thread, name):
        with start("--stall-s", "1") as daemon:
            self.hold_in(daemon, thread, name)

    def hold_in(self, daemon, thread, name):
        try:
            held = HeldThread(daemon.pid, thread)
        except PermissionError:
            self.skipTest("this process may not trace another one")
        with held:
            until(lambda: get(daemon.operators, "/livez")[0] == 503, "not alive")
            self.assertEqual(get(daemon.operators, "/livez")[1], f"does not answer: {name}\n")
            self.assertEqual(get(daemon.operators, "/readyz")[0], 503)
            self.assertEqual(value(scrape(daemon.operators), "sightline_hanging_threads"), 1)
            self.assertEqual(healthcheck("--address", daemon.address, "--live").returncode, 1)
            daemon.wait_for_log("threads hang")
        until(lambda: get(daemon.operators, "/livez")[0] == 200, "alive again")
        until(lambda: healthcheck("--address", daemon.address).returncode == 0, "ready again")

    def test_an_event_loop_that_hangs_fails_liveness(self):
        self.hold("event-loop", "event loop")

    def test_an_event_loop_of_the_health_service_that_hangs_fails_liveness(self):
        self.hold("health", "event loop")

    def test_timers_that_hang_fail_liveness(self):
        # Something has to be due.
        with start("--stall-s", "1", "--open-timeout-s", "0.5") as daemon, grpc.insecure_channel(daemon.address) as channel:
            call = control(channel, iter(lambda: time.sleep(30), None))
            self.hold_in(daemon, "timers", "timers")
            call.cancel()

    def test_a_gate_that_hangs_fails_liveness(self):
        self.hold("relay", "gate")

    def test_an_idle_daemon_does_not_count_as_hanging(self):
        with start("--stall-s", "1") as daemon:
            end = time.monotonic() + 4
            while time.monotonic() < end:
                self.assertEqual(get(daemon.operators, "/livez"), (200, "ok\n"))
                time.sleep(0.1)


class Commands(unittest.TestCase):
    def run_command(self, *arguments):
        return subprocess.run([SIGHTLINE, *arguments], capture_output=True, text=True, timeout=60)

    def test_status_prints_what_the_metrics_say(self):
        with start() as daemon, camera(daemon) as one:
            for i in range(1, 31):
                one.tick(i / 60, {})
            until(lambda: value(scrape(daemon.operators), "sightline_steps_total", level="0") == 30, "30 steps")
            text = self.run_command("status", "--address", daemon.address)
            self.assertEqual((text.returncode, text.stderr), (0, ""))
            self.assertRegex(text.stdout, r"ready, up \d+ s")
            self.assertRegex(text.stdout, r"sessions +1 open of 256")
            self.assertRegex(text.stdout, r"tick age +30 ")
            answer = self.run_command("status", "--address", daemon.address, "--json")
            stats, families = json.loads(answer.stdout)["stats"], scrape(daemon.operators)
            self.assertEqual(int(stats["ticks"]), value(families, "sightline_ticks_received_total"))
            self.assertEqual(sum(map(int, stats["tick_age"]["counts"])), value(families, "sightline_tick_age_seconds_count"))
            self.assertAlmostEqual(stats["step"]["sum_s"], value(families, "sightline_step_seconds_sum"), places=9)
            # The same histogram twice: the protobuf has an element for each octave, Prometheus has cumulative buckets.
            for k in range(4, len(stats["step"]["counts"])):
                buckets = {float(dict(labels)["le"]): number for (name, labels), number in
                           families["sightline_step_seconds"].samples.items() if name.endswith("_bucket")}
                at = min(buckets, key=lambda le: abs(le - 2.0**k * 1e-6))
                self.assertEqual(sum(map(int, stats["step"]["counts"][:k + 1])), buckets[at])

    def test_top_shows_as_many_windows_as_it_is_asked_for(self):
        with start() as daemon:
            result = self.run_command("top", "--address", daemon.address, "--interval", "0.2", "--count", "2")
            self.assertEqual((result.returncode, result.stderr), (0, ""))
            self.assertEqual(result.stdout.count("In the last"), 2)

    def test_a_daemon_that_is_away_is_an_error(self):
        for verb in ("status", "top", "sessions"):
            result = self.run_command(verb, "--address", "unix:/nowhere/socket")
            self.assertEqual(result.returncode, 1)
            self.assertIn("/nowhere/socket", result.stderr)


if __name__ == "__main__":
    sys.argv[1:] = sys.argv[5:]
    unittest.main(verbosity=2)
