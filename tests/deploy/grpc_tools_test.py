#!/usr/bin/env python3
"""grpc_tools_test.py SIGHTLINED GO FOLDER: runs the lines of deploy/README.md for grpcurl and ghz against a daemon. Both are installed into FOLDER by
the README's own lines, which pin their versions."""
import os
import pathlib
import re
import shlex
import subprocess
import sys
import unittest

SIGHTLINED, GO, FOLDER = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3]).absolute()
TESTS = pathlib.Path(__file__).parents[1]
sys.path[:0] = [str(TESTS / "attack"), str(TESTS / "house")]

from code_blocks import blocks_of  # noqa: E402
from daemon import Daemon  # noqa: E402
from docs_test import commands  # noqa: E402

Daemon.path = SIGHTLINED
ADDRESS = "127.0.0.1:50151"
UNREACHABLE = r"dial tcp|no such host|timeout|connection refused|proxyconnect|reading \S+: [45]\d\d|module lookup disabled"
REFUSED_OPENING = '{"open":{}}'
REFUSED = 64 + 3  # grpcurl's exit status: 64 and the code of the call, INVALID_ARGUMENT


def lines_with(program):
    """The commands of the README that begin with this program, as lists of words."""
    for block in blocks_of(TESTS.parent, "deploy/README.md"):
        for command in commands(block) if block.language == "sh" else ():
            if command.startswith(program + " "):
                yield shlex.split(command)


def install():
    """Why the tools cannot be had; None when they are there."""
    for words in lines_with("go"):
        done = subprocess.run([GO, *words[1:]], cwd=FOLDER, env=dict(os.environ, GOBIN=str(FOLDER)), capture_output=True, text=True)
        if done.returncode != 0:
            assert re.search(UNREACHABLE, done.stderr), done.stderr
            return f"{' '.join(words)}: {done.stderr.strip().splitlines()[-1]}"
    return None


class GrpcTools(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.daemon = Daemon()
        cls.daemon.__enter__()
        cls.addClassCleanup(cls.daemon.__exit__, None, None, None)

    def run_line(self, words):
        words = [word.replace(ADDRESS, self.daemon.address) for word in words]
        return subprocess.run([FOLDER / words[0], *words[1:]], capture_output=True, text=True, timeout=120)

    def test_grpcurl_needs_no_files(self):
        printed = ""
        for words in lines_with("grpcurl"):
            if REFUSED_OPENING not in words:
                done = self.run_line(words)
                self.assertEqual(done.returncode, 0, f"{words}: {done.stderr}")
                printed += done.stdout
        for part in ("grpc.reflection.v1.ServerReflection\ngrpc.reflection.v1alpha.ServerReflection\n", "message OpenSession {", '"sampler": "embree"',
                     '"opened": {', '"camera": {'):
            self.assertIn(part, printed)

    def test_grpcurl_prints_typed_errors(self):
        (words,) = (words for words in lines_with("grpcurl") if REFUSED_OPENING in words)
        done = self.run_line(words)
        self.assertEqual(done.returncode, REFUSED)
        for part in ("Code: InvalidArgument", '"@type": "type.googleapis.com/google.rpc.BadRequest"', '"field": "open.camera"'):
            self.assertIn(part, done.stderr)

    def test_ghz_measures_calls(self):
        (words,) = lines_with("ghz")
        done = self.run_line(words)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, r"\[OK\]\s+1000 responses")


if __name__ == "__main__":
    FOLDER.mkdir(parents=True, exist_ok=True)
    if reason := install():
        print(f"Skipped: {reason}")
        sys.exit(0)
    unittest.main(argv=sys.argv[:1])
