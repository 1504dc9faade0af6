#!/usr/bin/env python3
"""The programs whose tests a mutant meets: those of gtest, and scripts of unittest, whose methods are tests of their own.

  programs.py BUILD PROGRAM...        prints the targets that must be built so that these can run
"""
import ast
import json
import pathlib
import subprocess
import sys

# A program of these kinds does the same on every run. Others start daemons, or wait for something.
STEADY = {"unit", "gl"}


def is_program(name):
    """Names with a capital letter are those of ctest, which runs a script."""
    return name[0].islower()


class Program:
    """How the tests of a program are run."""

    def __init__(self, name, command, labels):
        self.name, self.command = name, command
        self.script = None if is_program(name) else next(pathlib.Path(word) for word in command if word.endswith("_test.py"))
        self.steady = self.script is None and bool(labels) and labels <= STEADY

    def run_of(self, tests):
        """Command and additions to the environment that run these tests, up to the first failure; all tests of gtest without a list."""
        if self.script:
            return [*self.command, "-f", *tests], {}
        return self.command, {"GTEST_FILTER": ":".join(tests) or "*", "GTEST_BRIEF": "1"}

    def files(self):
        """What the tests depend on: programs, also those that they may start, and for a script all scripts of the tests."""
        if not self.script:
            program = pathlib.Path(self.command[0])
            started = [] if self.steady else [program.with_name(name) for name in ("sightlined", "sightline")]
            return [program, *(path for path in started if path.exists())]
        folder = next(parent for parent in self.script.parents if parent.name == "tests")
        return [*(pathlib.Path(word) for word in self.command[1:] if pathlib.Path(word).parent.name == "bin"), *sorted(folder.rglob("*.py"))]

    def prepares_once(self):
        return self.script is not None and "def setUpClass" in self.script.read_text()

    def methods(self):
        """The names of a script's tests: Class.test_method."""
        classes = {node.name: node for node in ast.parse(self.script.read_text()).body if isinstance(node, ast.ClassDef)}

        def tests_of(node):
            own = [part.name for part in node.body if isinstance(part, ast.FunctionDef) and part.name.startswith("test")]
            inherited = [name for base in node.bases if getattr(base, "id", None) in classes for name in tests_of(classes[base.id])]
            return list(dict.fromkeys(own + inherited))

        return [f"{name}.{test}" for name, node in classes.items() for test in tests_of(node)]


def told_by_ctest(build):
    """All tests that ctest knows: [(name, command, labels)]."""
    told = subprocess.run(["ctest", "--test-dir", str(build), "--show-only=json-v1"], capture_output=True, check=True, text=True)
    for test in json.loads(told.stdout)["tests"]:
        labels = [value for entry in test.get("properties", []) if entry["name"] == "LABELS" for value in entry["value"]]
        yield test["name"], test.get("command", []), set(labels)


def programs(build, names):
    """{name: Program}. A name that ctest does not know is an error."""
    build = pathlib.Path(build).resolve()
    out = {}
    for test, command, labels in told_by_ctest(build):
        program = pathlib.Path(command[0]).name if command else ""
        if test in names and not is_program(test):
            out[test] = Program(test, command, labels)
        elif program in names and program not in out:
            out[program] = Program(program, [str(build / "bin" / program)], labels)
    if missing := [name for name in names if name not in out]:
        raise ValueError(f"ctest knows no tests of {', '.join(missing)}")
    return {name: out[name] for name in names}


def targets(build, names):
    """What these programs need: themselves, or the programs and the Python stubs that a script's command names."""
    out, build = {name for name in names if is_program(name)}, pathlib.Path(build).resolve()
    for test, command, _ in told_by_ctest(build):
        if test in names and not is_program(test):
            words = [pathlib.Path(word) for word in command[1:]]
            out |= {word.name for word in words if word.parent == build / "bin"}
            out |= {"sightline_python_stubs" for word in words if word == build / "python"}
    return sorted(out)


if __name__ == "__main__":
    print(*targets(sys.argv[1], sys.argv[2:]), sep="\n")
