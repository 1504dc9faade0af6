"""The command `sightline` as typed: command_line_test.py SIGHTLINE [CLASS.METHOD...]."""
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

SIGHTLINE = sys.argv[1]
WRONG_FLAGS = 2

# The arguments that each sub-command needs. FILE is a file that exists, NEW one that does not.
COMMANDS = {
    "drive": ("FILE",),
    "demo": (),
    "evaluate": (),
    "bench": (),
    "scene": ("FILE",),
    "check": ("FILE", "--plan", "NEW"),
    "info": ("FILE",),
    "verify": ("FILE",),
    "recover": ("FILE", "--out", "NEW"),
    "dump": ("FILE",),
    "cut": ("FILE", "--out", "NEW", "--start", "1"),
    "replay": ("FILE",),
    "compare": ("FILE", "FILE"),
    "report": ("FILE",),
    "shots": (),
    "status": (),
    "sessions": (),
    "top": (),
}
ON_RECORDINGS = ("info", "verify", "recover", "dump", "cut", "replay", "compare", "report")


def run(*arguments):
    return subprocess.run([SIGHTLINE, *arguments], capture_output=True, text=True, timeout=60)


def run_on(command, file, *more):
    """Runs `command` with the arguments that it needs and `more`. Returns the result and the file that it could have made."""
    new = f"{file}.new"
    needed = [argument.replace("FILE", file).replace("NEW", new) for argument in COMMANDS[command]]
    return run(command, *needed, *more), pathlib.Path(new)


class CommandLineTest(unittest.TestCase):
    def test_says_its_version(self):
        result = run("--version")
        self.assertEqual(result.returncode, 0)
        self.assertRegex(result.stdout, r"^sightline \d+\.\d+\.\d+$")

    def test_every_sub_command_has_a_help_text(self):
        # This test covers exactly the sub-commands that --help lists.
        listed = run("--help").stdout.split("Subcommands:")[1].splitlines()
        self.assertEqual({line.split()[0] for line in listed if line.startswith("  ") and line[2] != " "}, set(COMMANDS))
        for command in COMMANDS:
            with self.subTest(command=command):
                result = run(command, "--help")
                self.assertEqual(result.returncode, 0)
                self.assertGreater(len(result.stdout.splitlines()), 3)

    def test_help_lists_the_flags_of_the_page_with_their_defaults(self):
        page = (pathlib.Path(__file__).parents[2] / "deploy/COMMAND_LINE.md").read_text()
        page = page[page.index("\n## sightline\n"):]
        for command in COMMANDS:
            section = page.split(f"\n### sightline {command}\n")[1].split("\n#")[0]
            rows = [[cell.strip() for cell in line.split(" | ")] for line in section.splitlines() if line.startswith("| `--")]
            self.assertTrue(rows, command)
            shown = run(command, "--help").stdout
            for names, _, default, *_ in rows:
                with self.subTest(command=command, flag=names):
                    for name in names.strip("| ").split(", "):
                        self.assertIn(name.strip("`"), shown)
                    self.assertIn(default, shown)

    def test_describe_names_the_sub_commands_and_their_flags(self):
        commands = {command["name"]: command for command in json.loads(run("--describe").stdout)["commands"]}
        self.assertEqual(set(commands), set(COMMANDS))
        for name, command in commands.items():
            names = {name for flag in command["flags"] if not flag["positional"] for name in flag["names"]}
            self.assertLessEqual({"-h", "--help"}, names, name)
            shown = set(re.findall(r"(?<![\w-])--?[a-z][a-z-]*", run(name, "--help").stdout))
            self.assertLessEqual(names, shown, name)

    def test_a_flag_that_no_sub_command_has_is_an_error_that_names_it(self):
        with tempfile.NamedTemporaryFile(suffix=".glb") as file:
            for command in COMMANDS:
                with self.subTest(command=command):
                    result, new = run_on(command, file.name, "--warp")
                    self.assertEqual(result.returncode, WRONG_FLAGS)
                    self.assertIn("--warp", result.stderr)
                    self.assertFalse(new.exists())

    def test_nothing_and_the_unknown_are_errors(self):
        with tempfile.NamedTemporaryFile(suffix=".glb") as file:
            for arguments in ((), ("fly",), ("--fast",), ("drive",), ("drive", file.name, "--warp"),
                              ("drive", file.name, "--rate", "0"), ("drive", file.name, "--preset", "magic"),
                              ("drive", "/nowhere.glb"), ("scene",), *((command,) for command in ON_RECORDINGS),
                              ("cut", file.name, "--out", "/nowhere/new.mcap", "--start", "-1"),
                              ("dump", file.name, "--end", "soon"), ("replay", file.name, "--rate", "0"),
                              ("replay", file.name, "--sampler", "eyes"), ("report", file.name, "--cells", "some"),
                              ("compare", file.name), ("recover", file.name),
                              ("bench", "--sessions", "0"), ("bench", "--rate", "fast"), ("bench", "--daemon-pid", "1"),
                              ("bench", "--address", "unix:/nowhere", "--tcp")):
                result = run(*arguments)
                self.assertEqual(result.returncode, WRONG_FLAGS, arguments)
                self.assertTrue(result.stderr, arguments)

    def test_numbers_are_taken_up_to_the_ends_of_their_ranges(self):
        with tempfile.NamedTemporaryFile(suffix=".glb") as file:
            on_nothing = {"drive": ("drive", file.name), "evaluate": ("evaluate", "--scene", "/nowhere.glb")}
            for verb, flag, taken, refused in (("drive", "--rate", ("0.1", "1000"), ("0", "1001")), ("drive", "--duration", ("0", "86400"), ("-1", "86401")),
                                               ("drive", "--truth-every", ("1", "1000"), ("0", "1001")),
                                               ("evaluate", "--seeds", ("1", "100"), ("0", "101")), ("evaluate", "--rate", ("0.1", "1000"), ("0", "1001")),
                                               ("evaluate", "--duration", ("0", "86400"), ("-1", "86401")),
                                               ("evaluate", "--truth-every", ("1", "1000"), ("0", "1001")),
                                               ("evaluate", "--jobs", ("1", "1024"), ("0", "1025"))):
                for values, status in ((taken, 1), (refused, WRONG_FLAGS)):
                    for value in values:
                        with self.subTest(verb=verb, flag=flag, value=value):
                            self.assertEqual(run(*on_nothing[verb], flag, value).returncode, status)

    def test_a_file_that_is_no_scene_is_an_error_and_not_a_crash(self):
        with tempfile.NamedTemporaryFile(suffix=".glb") as file:
            for command in ("scene", "check", "drive"):
                result = run(command, file.name)
                self.assertEqual(result.returncode, 1, result.stdout)
                self.assertTrue(result.stderr)

    def test_a_file_that_is_no_recording_is_an_error_and_not_a_crash(self):
        with tempfile.NamedTemporaryFile(suffix=".mcap") as file:
            file.write(b"no recording")
            file.flush()
            for command in ON_RECORDINGS:
                with self.subTest(command=command):
                    result, new = run_on(command, file.name)
                    self.assertEqual(result.returncode, 1, result.stdout)
                    self.assertIn(file.name, result.stderr)
                    self.assertFalse(new.exists())


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]])
