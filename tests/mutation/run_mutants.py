#!/usr/bin/env python3
"""Switches mutants on, one at a time, and runs the tests that come past them:

  run_mutants.py BUILD MUTANTS_JSON OUT_JSON [--per-folder N] [--seed N] [--jobs N] [--budget SECONDS] [--programs N] [--again RESULTS_JSON]
                 FOLDER...

BUILD was made from sources that instrument.py has rewritten. First every test program of the folders (nearest.py) runs without a mutant, to
learn which tests come past which mutants, and how long each takes. Then N mutants of each folder, drawn with the seed, are tried: the tests
run from the quickest to the slowest, as many as fit into the budget of seconds. A mutant is killed when a test fails, crashes or takes
five times as long as usual, and does so again: some tests run real daemons, which a busy machine can make late. With --programs only the
first N programs of each folder count. With --again only those mutants run that survived in these results.
"""
import argparse
import collections
import concurrent.futures
import json
import os
import pathlib
import random
import subprocess
import sys
import tempfile
import time

from nearest import NEAREST, is_program

Test = collections.namedtuple("Test", "name program seconds reaches")
ENVIRONMENT = {**os.environ, "GTEST_FAIL_FAST": "1", "GTEST_BRIEF": "1"}


def run(command, environment, limit_s, folder):
    """True: it ended well in this time."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment, cwd=folder, start_new_session=True)
    try:
        return process.wait(limit_s) == 0
    except subprocess.TimeoutExpired:
        return False
    finally:
        # Daemons that the test started belong to its group. Nothing is left over.
        try:
            os.killpg(process.pid, 9)
        except ProcessLookupError:
            pass
        process.wait()


class Build:
    def __init__(self, path):
        self.path = pathlib.Path(path).resolve()

    def command(self, program):
        if is_program(program):
            return [str(self.path / "bin" / program)]
        return ["ctest", "--test-dir", str(self.path), "-R", f"^{program}$", "-Q"]

    def reach(self, program, count):
        """The tests of a program, with the mutants that each comes past. What was found for the same build is kept."""
        kept, stamp = self.path / "reach" / f"{program}.json", self.stamp(program)
        if kept.exists() and (found := json.loads(kept.read_text()))["stamp"] == stamp:
            return [Test(name, program, seconds, set(reaches)) for name, seconds, reaches in found["tests"]]
        tests, good = self.measured_reach(program, count)
        if good:
            kept.parent.mkdir(exist_ok=True)
            kept.write_text(json.dumps({"stamp": stamp, "tests": [[t.name, t.seconds, sorted(t.reaches)] for t in tests]}))
        return tests

    def stamp(self, program):
        """Changes when the program is built again, and for a test in Python when any script of the tests changes. A change of any mutant changes the
        sources, and so the programs."""
        if is_program(program):
            return [(self.path / "bin" / program).stat().st_mtime_ns]
        scripts = [script.stat().st_mtime_ns for script in self.path.parents[1].glob("tests/**/*.py")]
        return [*((self.path / "bin" / name).stat().st_mtime_ns for name in ("sightlined", "sightline")), len(scripts), max(scripts)]

    def measured_reach(self, program, count):
        with tempfile.TemporaryDirectory(dir=self.path) as folder:
            reached, report = pathlib.Path(folder, "reached"), pathlib.Path(folder, "report")
            reached.write_bytes(bytes(count))
            environment = {**os.environ, "GTEST_BRIEF": "1", "SIGHTLINE_REACHED": str(reached), "SIGHTLINE_REACH_REPORT": str(report)}
            start = time.monotonic()
            good = run(self.command(program), environment, 1200, folder)
            seconds = time.monotonic() - start
            if not is_program(program):
                tests = [Test(program, program, seconds, {i for i, b in enumerate(reached.read_bytes()) if b})] if good else []
            else:
                lines = [line.split() for line in report.read_text().splitlines()] if report.exists() else []
                tests = [Test(line[1], program, float(line[0]), set(map(int, line[2:]))) for line in lines if line[-1] != "failed"]
        print(f"{program}: {len(tests)} tests, {seconds:.0f} s{'' if good else ', of which some fail by themselves'}", flush=True)
        return tests, good

    def survives(self, mutant, tests):
        """The name of the program whose tests kill the mutant, or None."""
        groups = collections.OrderedDict()
        for test in tests:
            groups.setdefault(test.program, []).append(test)
        for program, group in groups.items():
            environment = {**ENVIRONMENT, "SIGHTLINE_MUTANT": str(mutant["id"])}
            if is_program(program):
                environment["GTEST_FILTER"] = ":".join(test.name for test in group)
            with tempfile.TemporaryDirectory(dir=self.path) as folder:
                limit_s = 10 + 5 * sum(test.seconds for test in group)
                if not any(run(self.command(program), environment, limit_s, folder) for _ in range(2)):
                    return program
        return None


def chosen_tests(mutant, tests, budget_s):
    """The tests that come past the mutant: those of its folder, unit tests before wider ones, then all others. Quick ones are first, and each of
    the two groups has the budget."""
    order = {program: place for place, program in enumerate(NEAREST[mutant["folder"]])}
    reaching = [t for t in tests if mutant["id"] in t.reaches]
    near = sorted((t for t in reaching if t.program in order), key=lambda t: (order[t.program], t.seconds))
    return within(near, budget_s) + within(sorted((t for t in reaching if t.program not in order), key=lambda t: t.seconds), budget_s)


def within(tests, budget_s):
    out, spent = [], 0.0
    for test in tests:
        if out and spent + test.seconds > budget_s or len(out) >= 400:
            continue
        out.append(test)
        spent += test.seconds
    return out


def key(mutant):
    return mutant["file"], mutant["kind"], mutant["change"], mutant["text"]


def write(options, results):
    """Replaces the file of results. It is written after every mutant, so that a run that is stopped keeps what it has found."""
    mutants = [{name: value for name, value in result.items() if name != "id"} for result in results]
    pathlib.Path(options.out).write_text(json.dumps({"seed": options.seed, "mutants": mutants}, indent=0) + "\n")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("build")
    parser.add_argument("mutants")
    parser.add_argument("out")
    parser.add_argument("--per-folder", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--budget", type=float, default=30.0)
    parser.add_argument("--programs", type=int, default=9)
    parser.add_argument("--again")
    parser.add_argument("folders", nargs="+")
    options = parser.parse_args()
    mutants = json.loads(pathlib.Path(options.mutants).read_text())
    for mutant in mutants:
        mutant["folder"] = str(pathlib.PurePath(mutant["file"]).parent)
    for folder, programs in NEAREST.items():
        NEAREST[folder] = programs[:options.programs]
    build = Build(options.build)
    programs = list(dict.fromkeys(program for folder in options.folders for program in NEAREST[folder]))
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        tests = [test for found in pool.map(lambda program: build.reach(program, len(mutants)), programs) for test in found]

    former = json.loads(pathlib.Path(options.again).read_text()) if options.again else None
    survivors = {key(m) for m in former["mutants"] if m["by"] is None} if former else set()
    results, jobs = [], []
    for folder in options.folders:
        own = [m for m in mutants if m["folder"] == folder]
        drawn = random.Random(f"{options.seed} {folder}").sample(own, min(options.per_folder, len(own)))
        jobs += [m for m in own if key(m) in survivors] if former else drawn

    def attempt(mutant):
        near = chosen_tests(mutant, tests, options.budget)
        return {**mutant, "reached": bool(near), "by": build.survives(mutant, near) if near else None}

    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        for result in pool.map(attempt, jobs):
            results.append(result)
            write(options, results)
            fate = f"killed by {result['by']}" if result["by"] else "survived" if result["reached"] else "not reached"
            print(f"{result['file']}:{result['line']}: {result['change']}: {result['text'][:70]}: {fate}", flush=True)
    if former:
        now = {key(m): m for m in results}
        results = [now.get(key(m), m) for m in former["mutants"]]
    write(options, results)
    killed = collections.Counter(m["folder"] for m in results if m["by"])
    every = collections.Counter(m["folder"] for m in results)
    for folder in sorted(every):
        print(f"{folder:20} {killed[folder]:3} of {every[folder]:3} killed, {killed[folder] / every[folder]:4.0%}")
    print(f"{'all':20} {sum(killed.values()):3} of {sum(every.values()):3} killed, {sum(killed.values()) / max(1, sum(every.values())):4.0%}")


if __name__ == "__main__":
    sys.exit(main())
