"""The command `sightline` as typed: command_line_test.py SIGHTLINE."""
import subprocess
import sys
import tempfile
import unittest

SIGHTLINE = sys.argv[1]


def run(*arguments):
    return subprocess.run([SIGHTLINE, *arguments], capture_output=True, text=True, timeout=60)


class CommandLineTest(unittest.TestCase):
    def test_says_its_version(self):
        result = run("--version")
        self.assertEqual(result.returncode, 0)
        self.assertRegex(result.stdout, r"^sightline \d+\.\d+\.\d+$")

    def test_every_sub_command_has_a_help_text(self):
        for command in ("drive", "evaluate", "bench", "echo", "scene"):
            self.assertIn(command, run("--help").stdout)
            result = run(command, "--help")
            self.assertEqual(result.returncode, 0)
            self.assertGreater(len(result.stdout.splitlines()), 3)

    def test_nothing_and_the_unknown_are_errors(self):
        with tempfile.NamedTemporaryFile(suffix=".glb") as file:
            for arguments in ((), ("fly",), ("--fast",), ("drive",), ("drive", file.name, "--warp"),
                              ("drive", file.name, "--rate", "0"), ("drive", file.name, "--preset", "magic"),
                              ("drive", "/nowhere.glb"), ("scene",),
                              ("bench", "--sessions", "0"), ("bench", "--rate", "fast"), ("bench", "--daemon-pid", "1"),
                              ("bench", "--address", "unix:/nowhere", "--tcp"), ("echo",)):
                result = run(*arguments)
                self.assertNotEqual(result.returncode, 0, arguments)
                self.assertTrue(result.stderr, arguments)

    def test_a_file_that_is_no_scene_is_an_error_and_not_a_crash(self):
        with tempfile.NamedTemporaryFile(suffix=".glb") as file:
            for command in ("scene", "drive"):
                result = run(command, file.name)
                self.assertGreater(result.returncode, 0, result.stdout)
                self.assertTrue(result.stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
