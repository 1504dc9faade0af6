"""Holds the contract to its promises: contract_test.py BUF SOURCE_DIR OUT.

`buf lint` finds nothing. `buf breaking` finds no change that would break a client of the kept descriptor
(proto/sightline/v1/v1.binpb), and finds a break that the test makes on purpose."""
import pathlib
import shutil
import subprocess
import sys
import unittest

BUF, SOURCE, OUT = (pathlib.Path(argument) for argument in sys.argv[1:4])
PROTO = SOURCE / "proto"
KEPT = PROTO / "sightline" / "v1" / "v1.binpb"


def buf(*words, folder=PROTO):
    done = subprocess.run([BUF, *words], cwd=folder, capture_output=True, text=True, timeout=120)
    return done.returncode, done.stdout + done.stderr


def copy_with(name, old, new):
    """A copy of the contract in which `old` has become `new`."""
    copy = OUT / "planted"
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(PROTO, copy)
    file = copy / "sightline" / "v1" / name
    text = file.read_text()
    assert old in text, f"{name} has no {old!r}"
    file.write_text(text.replace(old, new, 1))
    return copy


class Contract(unittest.TestCase):
    def test_lint_finds_nothing(self):
        self.assertEqual(buf("lint"), (0, ""))

    def test_lint_finds_what_is_planted(self):
        code, text = buf("lint", folder=copy_with("session.proto", "string reason = 1;", "string Reason = 1;"))
        self.assertNotEqual(code, 0)
        self.assertIn("session.proto", text)

    def test_nothing_breaks_a_client_of_the_kept_version(self):
        self.assertEqual(buf("breaking", "--against", KEPT), (0, ""))

    def test_a_planted_break_is_found(self):
        for name, old, new in (("session.proto", "double time_s = 2;", "float time_s = 2;"),
                               ("scene.proto", "double radius = 1;", "double size = 1;"),
                               ("diagnostics.proto", "TARGET_STATE_OCCLUDED = 3;", "TARGET_STATE_OCCLUDED = 7;")):
            code, text = buf("breaking", "--against", KEPT, folder=copy_with(name, old, new))
            self.assertNotEqual(code, 0, f"{name}: {new}")
            self.assertIn(name, text)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
