"""`sightline demo` and `sightlined demo`: demo_test.py SIGHTLINE SIGHTLINED [CLASS.METHOD...]."""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

SIGHTLINE, SIGHTLINED = sys.argv[1:3]


def run(program, *arguments, cwd=None, **environment):
    return subprocess.run([program, "demo", "--sampler", "embree", *arguments], cwd=cwd, env=dict(os.environ, **environment), capture_output=True,
                          text=True, timeout=300)


class DemoTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))

    def check_session(self, folder, scene, printed):
        page = folder / f"{scene}.html"
        text = page.read_text(encoding="utf-8")
        self.assertTrue(text.startswith("<!doctype html>"))
        self.assertIn("as fast as replies come", text)
        self.assertIn(f"page    {page}", printed)
        metrics = json.loads((folder / "metrics.json").read_text())
        (row,) = re.findall(r"r_N \(no target visible\) +([\d.]+) % +([\d.]+) %", printed)
        for value, name in zip(row, ("sightline", "follow")):
            self.assertAlmostEqual(float(value), 100 * metrics[name]["r_n"], delta=0.051)

    def test_plays_a_scene_and_leaves_a_page(self):
        for scene, program in (("rooms", SIGHTLINE), ("hall", SIGHTLINED)):
            with self.subTest(scene=scene):
                out = self.folder / scene
                done = run(program, "--scene", scene, "--duration", "1", "--out", str(out))
                self.assertEqual(done.returncode, 0, done.stderr)
                self.check_session(out, scene, done.stdout)
                self.assertNotIn("give --out", done.stdout)
                metrics = json.loads((out / "metrics.json").read_text())["sightline"]
                self.assertEqual((metrics["frames"], metrics["pictures"]), (61, 7), "a second at 60 Hz, of which every tenth frame is judged")

    def test_prints_json_alone_where_it_is_asked_to(self):
        for cwd, folder in (("/proc", self.folder / "sightline-demo"), (self.folder, pathlib.Path("sightline-demo"))):
            done = run(SIGHTLINE, "--duration", "0.2", "--json", cwd=cwd, TMPDIR=str(self.folder))
            self.assertEqual(done.returncode, 0, done.stderr)
            told = json.loads(done.stdout)
            self.assertEqual(told["files"]["page"], str(folder / "rooms.html"))
            self.assertEqual(told["sightline"]["frames"], 13)

    def test_uses_the_temporary_folder_where_the_working_folder_cannot_be_written(self):
        done = run(SIGHTLINE, "--duration", "0.5", cwd="/proc", TMPDIR=str(self.folder))
        self.assertEqual(done.returncode, 0, done.stderr)
        self.check_session(self.folder / "sightline-demo", "rooms", done.stdout)
        self.assertIn("give --out", done.stdout)

    def test_says_what_is_wrong(self):
        for arguments, code, text in ((("--out", "/proc/nowhere"), 1, "--out"),
                                      (("--daemon", "/nowhere/sightlined", "--out", str(self.folder)), 1, "/nowhere/sightlined"),
                                      (("--scene", "moon"), 2, "moon"), (("--warp",), 2, "--warp")):
            for program in (SIGHTLINE, SIGHTLINED):
                with self.subTest(arguments=arguments, program=program):
                    done = run(program, *arguments)
                    self.assertEqual(done.returncode, code, done.stderr)
                    self.assertIn(text, done.stderr)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[3:]])
