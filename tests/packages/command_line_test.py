#!/usr/bin/env python3
"""command_line_test.py GENERATED SIGHTLINED SIGHTLINE ROOT: the manual pages, completions and the page about flags, beside --help, and read by the
tools that they are for. What needs a tool that is not installed is skipped."""
import gzip
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

GENERATED, SIGHTLINED, SIGHTLINE, ROOT = (pathlib.Path(argument) for argument in sys.argv[1:5])
PROGRAMS = {"sightlined": SIGHTLINED, "sightline": SIGHTLINE}
MANUALS = {"sightlined": "sightlined.8.gz", "sightline": "sightline.1.gz"}


def run(*command, **more):
    return subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=300, **more)


def needs(tool):
    return unittest.skipUnless(shutil.which(tool), f"{tool} is not installed")


def commands(name):
    return [command["name"] for command in json.loads(run(PROGRAMS[name], "--describe").stdout)["commands"]]


def help_flags(name, *verb):
    """The long flags that --help lists."""
    return set(re.findall(r"^ +(?:-\w,)?((?:--[\w-]+,?)+)", run(PROGRAMS[name], *verb, "--help").stdout, re.M))


def words(flags):
    return {word for group in flags for word in group.split(",") if word}


def complete(program, *typed):
    """What bash offers after the typed words; the last one is unfinished."""
    script = (f"source {GENERATED}/completions/bash/{program}\nCOMP_WORDS=({' '.join(map(json.dumps, (program, *typed)))})\n"
              f"COMP_CWORD={len(typed)}\n_{program}\nprintf '%s\\n' \"${{COMPREPLY[@]}}\"")
    done = run("bash", "-euc", script)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


class CommandLinePages(unittest.TestCase):
    def test_the_page_about_flags_is_current(self):
        self.assertEqual((GENERATED / "COMMAND_LINE.md").read_text(), (ROOT / "deploy/COMMAND_LINE.md").read_text(),
                         f"cp {GENERATED}/COMMAND_LINE.md deploy/")

    def test_every_flag_of_help_is_on_the_page_and_in_the_manual(self):
        page = (ROOT / "deploy/COMMAND_LINE.md").read_text()
        for name in PROGRAMS:
            manual = gzip.decompress((GENERATED / "man" / MANUALS[name]).read_bytes()).decode().replace("\\-", "-")
            for verb in ((), *((command,) for command in commands(name) if (name, command) != ("sightlined", "demo"))):
                flags = words(help_flags(name, *verb)) - {"--help"}
                self.assertTrue(flags or verb in (("dump",),), verb)
                for flag in flags:
                    self.assertIn(f"`{flag}`", page)
                    self.assertIn(f"\\fB{flag}\\fR", manual)

    @needs("man")
    def test_manual_pages_are_without_warnings(self):
        for name, manual in MANUALS.items():
            with tempfile.TemporaryDirectory() as folder:
                plain = pathlib.Path(folder, manual.removesuffix(".gz"))
                plain.write_bytes(gzip.decompress((GENERATED / "man" / manual).read_bytes()))
                done = run("man", "--warnings", "-E", "UTF-8", "-l", "-Tutf8", "-Z", plain)
                self.assertEqual((done.returncode, done.stderr), (0, ""))
                shown = run("man", "-l", plain, env={"MANPAGER": "cat", "MANWIDTH": "200", "PATH": "/usr/bin:/bin"}).stdout
                self.assertIn(name, shown)
                self.assertIn("EXIT STATUS", re.sub(".\b", "", shown))

    def test_bash_completes_verbs_flags_and_values(self):
        self.assertEqual(complete("sightline", "re"), ["recover", "replay", "report"])
        self.assertEqual(complete("sightline", "replay", "--sa"), ["--sampler"])
        self.assertEqual(complete("sightline", "replay", "--sampler", "e"), ["egl", "embree"])
        self.assertEqual(complete("sightline", "drive", "--out", "/"), [], "names of files are bash's own work")
        self.assertIn("--require-gpu", complete("sightlined", "--re"))
        self.assertEqual(complete("sightlined", "--log-format", ""), ["json", "text"])
        self.assertIn("--listen-unix", complete("sightlined", "healthcheck", "--listen"), "it takes the daemon's flags too")

    def test_bash_knows_every_flag(self):
        for name in PROGRAMS:
            for verb in commands(name):
                if (name, verb) != ("sightlined", "demo"):
                    self.assertLessEqual(words(help_flags(name, verb)), set(complete(name, verb, "--")), verb)

    @needs("zsh")
    def test_zsh_reads_its_completions(self):
        for name in PROGRAMS:
            script = f"autoload -U compinit; compinit -D; compdef() {{ true }}; _arguments() {{ true }}; source {GENERATED}/completions/zsh/_{name}"
            done = run("zsh", "-fc", script)
            self.assertEqual((done.returncode, done.stderr), (0, ""))

    @needs("fish")
    def test_fish_completes(self):
        for name, typed, expected in (("sightline", "sightline rep", {"replay", "report"}), ("sightlined", "sightlined --log-format ", {"json", "text"})):
            with tempfile.TemporaryDirectory() as home:
                done = run("fish", "--no-config", "-c", f"source {GENERATED}/completions/fish/{name}.fish; complete -C '{typed}'",
                           env={"HOME": home, "PATH": "/usr/bin:/bin"})
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertLessEqual(expected, {line.split("\t")[0] for line in done.stdout.splitlines()})


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
