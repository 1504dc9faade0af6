"""Learns which tests come past which mutants, and how long each takes."""
import collections
import json
import pathlib
import tempfile
import time

from execute import End, run
from keys import NUMBERS

Test = collections.namedtuple("Test", "name program seconds reaches")
LONGEST_S = 1200  # of a program without mutants


class Reach:
    """The tests of one program. Its own start and end, and what it prepares for many tests, take `overhead_s`."""

    def __init__(self, program, tests, overhead_s):
        self.program, self.tests, self.overhead_s = program, tests, overhead_s


def learnt(program, kept):
    """What was found before for the same build, if anything. A change of any mutant changes the sources, and so the programs."""
    path = kept / f"{program.name}.json"
    if not path.exists() or (found := json.loads(path.read_text()))["stamp"] != stamp(program):
        return None
    return Reach(program, [Test(name, program.name, seconds, set(reaches)) for name, seconds, reaches in found["tests"]], found["overhead_s"])


def keep(reach, kept):
    kept.mkdir(exist_ok=True)
    told = {"stamp": stamp(reach.program), "overhead_s": reach.overhead_s, "tests": [[t.name, t.seconds, sorted(t.reaches)] for t in reach.tests]}
    (kept / f"{reach.program.name}.json").write_text(json.dumps(told))


def stamp(program):
    return [path.stat().st_mtime_ns for path in program.files()]


def learn(program):
    """Tests that fail without a mutant are left out, when they do so twice."""
    start = time.monotonic()
    reach, failed = learn_script(program) if program.script else learn_program(program)
    if failed:
        again, failed = learn_script(program, failed) if program.script else learn_program(program)
        reach.tests = list({test.name: test for test in reach.tests + again.tests}.values())
    if program.prepares_once() and reach.tests:
        share_preparation(reach)
    told = f", without {' '.join(failed)}" if failed else ""
    print(f"{program.name}: {len(reach.tests)} tests, {time.monotonic() - start:.0f} s{told}", flush=True)
    return reach


def share_preparation(reach):
    """What setUpClass takes was measured with every test, but several tests in one process pay for it once."""
    reach.overhead_s = min(test.seconds for test in reach.tests)
    reach.tests = [test._replace(seconds=test.seconds - reach.overhead_s) for test in reach.tests]


def measured(program, tests):
    """(whether they passed, seconds, lines of the report, numbers of the mutants that were reached)"""
    command, environment = program.run_of(tests)
    with tempfile.TemporaryDirectory() as folder:
        reached, report = pathlib.Path(folder, "reached"), pathlib.Path(folder, "report")
        reached.write_bytes(bytes(NUMBERS))
        start = time.monotonic()
        end = run(command, {**environment, "SIGHTLINE_REACHED": str(reached), "SIGHTLINE_REACH_REPORT": str(report)}, LONGEST_S)
        lines = [line.split() for line in report.read_text().splitlines()] if report.exists() else []
        return end == End.WELL, time.monotonic() - start, lines, {number for number, byte in enumerate(reached.read_bytes()) if byte}


def learn_program(program):
    good, seconds, lines, _ = measured(program, [])
    tests = [Test(line[1], program.name, float(line[0]), set(map(int, line[2:]))) for line in lines if line[-1] != "failed"]
    failed = [line[1] for line in lines if line[-1] == "failed"] or ([] if good else ["those after a crash"])
    return Reach(program, tests, max(0.0, seconds - sum(float(line[0]) for line in lines))), failed


def learn_script(program, methods=None):
    tests, failed = [], []
    for method in methods or program.methods():
        good, seconds, _, reaches = measured(program, [method])
        if good:
            tests.append(Test(method, program.name, seconds, reaches))
        else:
            failed.append(method)
    return Reach(program, tests, 0.0), failed
