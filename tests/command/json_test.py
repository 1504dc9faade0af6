"""Every verb with --json, and its exit status: json_test.py SIGHTLINE SIGHTLINED MAKE_RECORDING [CLASS.METHOD...].

What a verb prints for a person, it prints for a program too: one JSON value on the standard output, or one a line. `dump` always prints lines of JSON.
"""
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import time
import unittest

SIGHTLINE, SIGHTLINED, MAKE_RECORDING = sys.argv[1:4]
DONE, NO, WRONG_FLAGS = 0, 1, 2


def run(*words):
    return subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=240)


def table(program):
    """The program's flags by verb."""
    commands = json.loads(run(program, "--describe").stdout)["commands"]
    return {command["name"]: {name for flag in command["flags"] for name in flag["names"]} for command in commands}


class Json(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        temporary = tempfile.TemporaryDirectory()
        cls.addClassCleanup(temporary.cleanup)
        cls.folder = pathlib.Path(temporary.name)
        made = run(MAKE_RECORDING, cls.folder)
        assert made.returncode == 0, made.stderr
        cls.yard = cls.folder / "yard.mcap"
        whole = cls.yard.read_bytes()
        cls.broken = cls.folder / "broken.mcap"
        cls.broken.write_bytes(whole[:len(whole) // 2])
        demo = run(SIGHTLINE, "demo", "--scene", "hall", "--sampler", "embree", "--duration", "1", "--out", cls.folder / "demo", "--json")
        assert demo.returncode == DONE, demo.stderr
        cls.demo = json.loads(demo.stdout)
        cls.scene = cls.folder / "demo/hall.glb"
        ready = cls.folder / "ready"
        daemon = subprocess.Popen([SIGHTLINED, "--listen", "127.0.0.1:0", "--sampler", "embree", "--log-level", "error", "--ready-file", ready])
        cls.addClassCleanup(daemon.wait, 20)
        cls.addClassCleanup(daemon.terminate)
        while not ready.exists():
            assert daemon.poll() is None
            time.sleep(0.02)
        cls.address = ready.read_text().split()[0]

    def values(self, *words, status=DONE):
        """The JSON values that the command prints, one a line or one in all."""
        done = run(SIGHTLINE, *words)
        self.assertEqual(done.returncode, status, done.stdout[-2000:] + done.stderr[-2000:])
        try:
            return [json.loads(done.stdout)]
        except json.JSONDecodeError:
            return [json.loads(line) for line in done.stdout.splitlines()]

    def value(self, *words, status=DONE):
        values = self.values(*words, status=status)
        self.assertEqual(len(values), 1)
        return values[0]

    def new(self, name):
        return self.folder / f"{self.id()}-{name}"

    def test_every_verb_has_it_or_prints_json_anyway(self):
        verbs = table(SIGHTLINE)
        self.assertEqual({verb for verb, flags in verbs.items() if "--json" not in flags}, {"dump"})
        tested = {name.removeprefix("test_of_") for name in dir(self) if name.startswith("test_of_")}
        self.assertEqual(tested, set(verbs), "every verb has a test here")
        self.assertIn("--json", table(SIGHTLINED)["devices"])

    def test_of_demo(self):
        self.assertEqual(self.demo["sightline"]["frames"], 61, "a second in lockstep, at 60 Hz")
        self.assertEqual(self.demo["sightline"]["pictures"], 7, "every tenth frame is judged")
        for path in self.demo["files"].values():
            self.assertGreater(pathlib.Path(path).stat().st_size, 0, path)
        self.assertIn("page", self.demo["files"])

    def test_of_drive(self):
        told = self.value("drive", self.scene, "--server", self.address, "--duration", "1", "--fast", "--truth-every", "20", "--out", self.new("out"), "--json")
        kept = json.loads(pathlib.Path(told["files"]["metrics"]).read_text())
        self.assertEqual(told["sightline"], kept["sightline"])
        self.assertEqual(told["follow"], kept["follow"])
        self.assertEqual(told["sampler"], "embree")
        latency = told["latency"]["reply_ms"]
        self.assertTrue(0 < latency["p50"] <= latency["p95"] <= latency["p99"])
        self.assertEqual(told["warnings"], [])
        self.value("scene", self.scene, "--json")
        self.assertEqual(run(SIGHTLINE, "drive", self.scene, "--server", "127.0.0.1:1", "--out", self.new("none"), "--json").returncode, NO)

    def test_of_shots(self):
        listed = {shot["name"]: shot["tick"] for shot in self.value("shots", "--json")["shots"]}
        self.assertIn("chase", listed)
        chase = self.value("shots", "chase", "--subject", "7", "--json")
        self.assertEqual(chase["shot"]["subjectIds"], ["7"])
        self.assertEqual(run(SIGHTLINE, "shots", "chase", "--json").returncode, NO)
        told = self.value("drive", self.scene, "--server", self.address, "--duration", "1", "--fast", "--truth-every", "20", "--shot", "two-shot", "--out",
                          self.new("out"), "--json")
        self.assertEqual(told["warnings"], [])

    def test_of_evaluate(self):
        told = self.value("evaluate", "--scene", self.scene, "--policy", "follow", "--policy", "sightline", "--seeds", "2", "--duration", "0.5", "--out",
                          self.new("out"), "--json")
        self.assertEqual([(row["scene"], row["policy"], row["runs"]) for row in told["figures"]], [("hall", "follow", 2), ("hall", "sightline", 2)])
        header, *rows = (pathlib.Path(told["folder"]) / "runs.csv").read_text().splitlines()
        columns = header.split(",")
        mean = sum(float(row.split(",")[columns.index("d_c_m")]) for row in rows if '"sightline"' in row) / 2
        self.assertAlmostEqual(told["figures"][1]["d_c_m"], mean, places=9)
        self.assertIn("goal_jumps_per_s", told["figures"][1])
        self.assertNotIn("goal_jumps_per_s", told["figures"][0])

    def test_of_bench(self):
        told = self.value("bench", "--address", self.address, "--warm-up", "0.2", "--window", "0.2", "--max-duration", "0.6", "--json", "-")
        self.assertEqual(told["load"]["sessions"], 1)
        self.assertEqual(told["latency_us"]["round_trip"].keys(), {"count", "p50", "p90", "p99", "p99_9", "max"})

    def test_of_scene(self):
        told = self.value("scene", self.scene, "--json")
        self.assertEqual(len(told["hash"]), 32)
        self.assertEqual(sum(node["role"].startswith("target") for node in told["nodes"]), 2)
        self.assertEqual([animation["name"] for animation in told["animations"]], ["scenario"])
        self.assertTrue(all(low < high for low, high in zip(told["extents"]["min_m"], told["extents"]["max_m"])))
        self.assertEqual(run(SIGHTLINE, "scene", self.yard, "--json").returncode, NO)

    def test_of_check(self):
        plan = self.new("plan.png")
        told = self.value("check", self.scene, "--plan", plan, "--strict", "--json")
        self.assertEqual(told["warnings"], [])
        self.assertEqual(told["roles"]["targets"], 2)
        self.assertGreater(told["size_m"][0], 10)
        self.assertIsNone(told["play"])
        self.assertEqual(plan.read_bytes()[:4], b"\x89PNG")
        played = self.value("check", self.scene, "--plan", "none", "--play", "--json")["play"]
        self.assertFalse(played["wandered"], "the scene has roles")
        self.assertGreater(played["pictures"], 0)
        self.assertEqual(run(SIGHTLINE, "check", self.yard, "--plan", "none", "--json").returncode, NO)

    def test_of_info(self):
        first, second = self.values("info", "--json", self.yard, self.broken)
        self.assertTrue(first["finished"])
        self.assertFalse(second["finished"])

    def test_of_verify(self):
        self.assertTrue(self.value("verify", "--json", self.yard)["sound"])
        self.assertFalse(self.value("verify", "--json", self.broken, status=NO)["sound"])

    def test_of_recover(self):
        told = self.value("recover", "--json", self.yard, "--out", self.new("whole.mcap"))
        self.assertTrue(told["was_finished"])
        self.assertEqual(told["lost"]["messages"], 0)
        self.assertTrue(self.value("verify", "--json", told["copy"])["sound"])
        told = self.value("recover", "--json", self.broken, "--out", self.new("part.mcap"), status=NO)
        self.assertFalse(told["was_finished"])
        self.assertGreater(told["lost"]["bytes"], 0)

    def test_of_dump(self):
        lines = self.values("dump", self.yard, "--topic", "/sightline/reply", "--limit", "3")
        self.assertEqual([line["topic"] for line in lines], ["/sightline/reply"] * 3)

    def test_of_cut(self):
        cut = self.new("cut.mcap")
        told = self.value("cut", self.yard, "--out", cut, "--start", "1", "--end", "2", "--json")
        self.assertGreater(told["messages"], 0)
        self.assertGreater(told["lead_messages"], 0, "the messages before the range, which a replay needs")
        self.assertEqual(self.value("replay", cut, "--json")["result"]["verdict"], "equal")
        self.assertEqual(run(SIGHTLINE, "cut", self.yard, "--out", self.new("none"), "--start", "2", "--end", "1", "--json").returncode, WRONG_FLAGS)

    def test_of_replay(self):
        told = self.value("replay", self.yard, "--json")
        replies = told["result"]["replies"]
        self.assertEqual(told["result"]["verdict"], "equal")
        self.assertEqual(replies["compared"], replies["equal"])
        self.assertEqual(replies["hash_recorded"], replies["hash_replayed"])
        self.assertEqual(told["figures"], [])
        told = self.value("replay", self.yard, "--json", "--set", "max_distance_m=5", "--truth", "--truth-every", "200")
        self.assertEqual(told["result"]["verdict"], "other settings")
        self.assertLess(told["result"]["replies"]["equal"], told["result"]["replies"]["compared"])
        self.assertIn("true: path length d_c", [row["name"] for row in told["figures"]])
        self.assertEqual(run(SIGHTLINE, "replay", self.yard, "--json", "--step").returncode, WRONG_FLAGS)

    def test_of_compare(self):
        self.assertTrue(self.value("compare", self.yard, self.yard, "--json")["equal"])
        other = self.new("other.mcap")
        self.value("replay", self.yard, "--set", "max_distance_m=5", "--out", other, "--json")
        told = self.value("compare", self.yard, other, "--json", status=NO)
        self.assertFalse(told["equal"])
        words = run(SIGHTLINE, "compare", self.yard, other).stdout
        self.assertIn("settings.max_distance_m", words)
        self.assertTrue(told["replies"]["fields"])
        for deviation in told["replies"]["fields"]:
            self.assertRegex(words, rf"{re.escape(deviation['field'])} +{deviation['replies']} +{deviation['first_sequence']} ")

    def test_of_report(self):
        page = self.new("page.html")
        told = self.value("report", self.yard, self.yard, "--out", page, "--pictures", "1", "--cells", "none", "--json")
        self.assertEqual(told["page"], str(page))
        self.assertEqual(len(told["recordings"]), 2)
        self.assertGreater(told["recordings"][0]["frames"], 100)
        self.assertGreater(page.stat().st_size, 0)

    def test_of_status(self):
        told = self.value("status", "--address", self.address, "--json")
        self.assertTrue(told["stats"]["ready"])
        self.assertIn("max_sessions", told["info"], "names are those of the contract")
        self.assertGreater(told["stats"]["uptime_s"], 0)
        self.assertEqual(told["stats"]["refused_ticks"], "0", "what is zero is told, too")
        self.assertEqual(run(SIGHTLINE, "status", "--address", "127.0.0.1:1", "--json").returncode, NO)

    def test_of_sessions(self):
        told = self.value("sessions", "--server", self.address, "--json")
        self.assertEqual(told, {"sessions": []})
        self.assertEqual(run(SIGHTLINE, "sessions", "--server", "127.0.0.1:1", "--json").returncode, NO)

    def test_status_and_top_take_the_flags_of_a_connection(self):
        for verb in ("status", "sessions", "top"):
            done = run(SIGHTLINE, verb, "--address", self.address, "--token-file", self.folder / "no-token")
            self.assertEqual(done.returncode, NO, verb)
            self.assertIn("--token-file", done.stderr)

    def test_top_as_text_clears_a_terminal_alone(self):
        done = run(SIGHTLINE, "top", "--address", self.address, "--interval", "0.1", "--count", "2")
        self.assertEqual(done.returncode, DONE, done.stderr)
        self.assertEqual(done.stdout.count("In the last 0."), 2)
        self.assertNotIn("\x1b", done.stdout)

    def test_of_top(self):
        lines = self.values("top", "--address", self.address, "--interval", "0.2", "--count", "2", "--json")
        self.assertEqual(len(lines), 2)
        for line in lines:
            self.assertGreater(line["window"]["seconds"], 0)
            self.assertTrue({"tick age", "queue", "step", "sample"} <= line["window"]["durations"].keys())
            self.assertTrue(line["stats"]["ready"])

    def test_devices_of_the_daemon(self):
        done = run(SIGHTLINED, "devices", "--json", "--sampler", "embree")
        self.assertEqual(done.returncode, DONE)
        told = json.loads(done.stdout)
        self.assertEqual([device["kind"] for device in told["devices"] if device["used"]], ["embree"])


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[4:]])
