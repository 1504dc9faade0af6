#!/usr/bin/env python3
"""Switches mutants on, one at a time, and runs the tests that come past them:

  run_mutants.py BUILD MUTANTS_JSON OUT_JSON [OPTION...] FOLDER...

BUILD was made from sources that rewrite.py has written. First every test program of the folders (nearest.py) runs without a mutant (reach.py).
Then N mutants of each folder are tried, one folder after the other in turn, so that a run that is stopped has a sample of every folder. Their
order in a folder depends on the seed alone: a larger N extends a smaller one. OUT_JSON keeps all results, and what is in it is not tried again,
except a survivor that has not met all the programs of this run.

A mutant meets the tests of its folder's own programs, quick ones first, for as many seconds as the budget has, and then other tests for as long
again. They run in slices: in a process those that take a second together, then those that take five, then the rest. A mutant is killed when
a slice fails, crashes or takes five times as long as usual and three seconds more. A slice that is late must be so twice, the second time with
twice the time: a busy machine delays it too. A slice of a program that starts daemons, or waits for something, must also fail twice.
"""
import argparse
import collections
import concurrent.futures
import itertools
import json
import os
import pathlib
import signal
import sys
import threading
import time

import score
from execute import End, run
from keys import key, place
from nearest import NEAREST
from programs import programs
from reach import keep, learn, learnt

SURVIVORS = pathlib.Path(__file__).parents[1] / "results" / "trust" / "survivors.json"
SLICES_S = (1.0, 5.0)  # the longest sums of the first slices; all other tests are in the last one
MOST_TESTS = 400       # of a mutant, near ones and others each
Slice = collections.namedtuple("Slice", "program tests seconds")


class Stopped(Exception):
    """The run was told to end."""


# --- which tests, and in which order

def within(tests, budget_s):
    """The first ones that fit into the budget; at least one."""
    out, spent = [], 0.0
    for test in tests:
        if out and spent + test.seconds > budget_s or len(out) >= MOST_TESTS:
            continue
        out.append(test)
        spent += test.seconds
    return out


def slices(tests):
    """The tests as slices. All programs' first slices run before the second ones; tests of a program are in the order of their time."""
    grouped = collections.OrderedDict()
    for test in tests:
        grouped.setdefault(test.program, []).append(test)
    ranked = []
    for program, group in grouped.items():
        parts, rank, spent = [[] for _ in range(len(SLICES_S) + 1)], 0, 0.0
        for test in sorted(group, key=lambda test: test.seconds):
            while rank < len(SLICES_S) and spent + test.seconds > SLICES_S[rank]:
                rank, spent = rank + 1, 0.0
            parts[rank].append(test)
            spent += test.seconds
        ranked += [(rank, Slice(program, part, sum(test.seconds for test in part))) for rank, part in enumerate(parts) if part]
    return [part for _, part in sorted(ranked, key=lambda entry: entry[0])]


def chosen_slices(mutant, tests, near_programs, budget_s):
    """The slices that a mutant meets: those of its folder's programs, unit tests before wider ones, then those of all others."""
    order = {program: place for place, program in enumerate(near_programs)}
    reaching = [test for test in tests if mutant["id"] in test.reaches]
    near = sorted((t for t in reaching if t.program in order), key=lambda t: (order[t.program], t.seconds))
    others = sorted((t for t in reaching if t.program not in order), key=lambda t: t.seconds)
    return slices(within(near, budget_s)) + slices(within(others, budget_s))


def programs_in(chosen):
    return sorted({part.program for part in chosen})


# --- trying a mutant

class Runner:
    def __init__(self, reaches, budget_s):
        self.reaches = {reach.program.name: reach for reach in reaches}
        self.tests = [test for reach in reaches for test in reach.tests]
        self.budget_s = budget_s
        self.stop = threading.Event()

    def passes(self, number, part):
        """Whether the tests of a slice leave the mutant alive."""
        reach = self.reaches[part.program]
        command, environment = reach.program.run_of([test.name for test in part.tests])
        environment = {**environment, "GTEST_FAIL_FAST": "1", "SIGHTLINE_MUTANT": str(number)}
        limit_s = 3 + 5 * (part.seconds + reach.overhead_s)
        for patience in (1, 2):
            if self.stop.is_set():
                raise Stopped
            end = run(command, environment, patience * limit_s)
            if end != End.LATE and (end == End.WELL or reach.program.steady):
                break
        return end == End.WELL

    def attempt(self, mutant):
        """The result: the mutant, with the name of the program that kills it or None in `by`."""
        start = time.monotonic()
        chosen = self.chosen(mutant)
        by = next((part.program for part in chosen if not self.passes(mutant["id"], part)), None)
        told = {name: value for name, value in mutant.items() if name not in ("id", "last_line")}
        return {**told, "reached": bool(chosen), "by": by, "met": programs_in(chosen), "seconds": round(time.monotonic() - start, 1)}

    def chosen(self, mutant):
        return chosen_slices(mutant, self.tests, NEAREST[mutant["folder"]], self.budget_s)

    def is_open(self, mutant, result):
        """Whether the mutant is still to be tried: it has no result, or has survived a run of fewer programs."""
        return result is None or result["by"] is None and not set(programs_in(self.chosen(mutant))) <= set(result["met"])


# --- which mutants

def sample(mutants, folder, seed):
    """The mutants of the folder that can be switched on, in the order that the seed draws."""
    return sorted((mutant for mutant in mutants if mutant["folder"] == folder and "id" in mutant), key=lambda mutant: place(mutant, seed))


def in_turn(lists):
    return [entry for row in itertools.zip_longest(*lists) for entry in row if entry is not None]


class Results:
    """All results by key. The file is replaced after every mutant, so that a run that is stopped keeps what it has found."""

    def __init__(self, path, seed, mutants, fresh):
        self.path, self.seed, self.by_key = pathlib.Path(path), seed, {}
        self.existing = collections.Counter(mutant["folder"] for mutant in mutants)
        if not fresh and self.path.exists():
            self.read({key(mutant) for mutant in mutants}, {mutant["folder"] for mutant in mutants})

    def read(self, keys, folders):
        """Takes over former results. Those of mutants that are gone are dropped, but not those of folders that are not rewritten now."""
        former = json.loads(self.path.read_text())
        if former["seed"] != self.seed:
            raise ValueError(f"{self.path} is of seed {former['seed']}: give --seed {former['seed']}, or --fresh to begin anew")
        self.by_key = {key(m): m for m in former["mutants"] if key(m) in keys or m["folder"] not in folders}
        self.existing = collections.Counter({**former["existing"], **self.existing})

    def add(self, result):
        self.by_key[key(result)] = result
        self.write()

    def scores(self):
        survivors = json.loads(SURVIVORS.read_text()) if SURVIVORS.exists() else []
        return score.scores(self.by_key.values(), self.existing, survivors)

    def write(self):
        told = {"seed": self.seed, "existing": dict(self.existing), "scores": {name: found._asdict() for name, found in self.scores().items()},
                "mutants": sorted(self.by_key.values(), key=lambda m: (m["file"], m["line"], key(m)))}
        temporary = self.path.with_suffix(".tmp")
        temporary.write_text(json.dumps(told, indent=0) + "\n")
        temporary.replace(self.path)


def jobs_of(options, mutants, results, runner):
    """The mutants to try: those of each folder's first N that are open, or all that survived."""
    lists = []
    for folder in options.folders:
        drawn = sample(mutants, folder, options.seed)
        if options.again:
            lists.append([m for m in drawn if results.by_key.get(key(m), {"by": ""})["by"] is None])
        else:
            lists.append([m for m in drawn[:options.per_folder] if runner.is_open(m, results.by_key.get(key(m)))])
    return in_turn(lists)


# --- the run

def learn_all(options, wanted):
    """The tests of all programs. Those that are known from a former run cost nothing, except with --learn, which measures the times anew."""
    kept = pathlib.Path(options.build) / "reach"

    def known(program):
        reach = None if options.learn else learnt(program, kept)
        if reach is None:
            reach = learn(program)
            keep(reach, kept)
        return reach

    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        return list(pool.map(known, programs(options.build, wanted).values()))


def try_all(runner, jobs, results, workers):
    with concurrent.futures.ThreadPoolExecutor(workers) as pool:
        try:
            for done in concurrent.futures.as_completed([pool.submit(runner.attempt, mutant) for mutant in jobs]):
                result = done.result()
                results.add(result)
                fate = f"killed by {result['by']}" if result["by"] else "survived" if result["reached"] else "not reached"
                print(f"{result['file']}:{result['line']}: {result['change']}: {result['text'][:70]}: {fate}, {result['seconds']} s", flush=True)
        except KeyboardInterrupt:
            runner.stop.set()
            pool.shutdown(cancel_futures=True)
            print("stopped; the same command goes on", flush=True)


def print_scores(results):
    for name, found in results.scores().items():
        equal = f", {found.equal} equal" if found.equal else ""
        print(f"{name:20} {found.killed:4} of {found.mutants:4} killed{equal}: {score.share(found)}; {found.all} mutants")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build")
    parser.add_argument("mutants")
    parser.add_argument("out")
    parser.add_argument("--per-folder", type=int, default=20, metavar="N", help="mutants of each folder; a folder with fewer is tried whole (20)")
    parser.add_argument("--seed", type=int, default=1, help="of the order of a folder's mutants (1)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), metavar="N", help="processes at a time (all CPUs)")
    parser.add_argument("--budget", type=float, default=12.0, metavar="SECONDS", help="of near tests, and of other tests again (12)")
    parser.add_argument("--programs", type=int, default=9, metavar="N", help="only the first N programs of each folder (9)")
    parser.add_argument("--again", action="store_true", help="only mutants that have survived, after tests were added")
    parser.add_argument("--fresh", action="store_true", help="forget former results")
    parser.add_argument("--learn", action="store_true", help="only learn, anew, which tests come past which mutants and how long they take: best on an idle machine")
    parser.add_argument("folders", nargs="+", metavar="FOLDER")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    mutants = json.loads(pathlib.Path(options.mutants).read_text())
    for mutant in mutants:
        mutant["folder"] = str(pathlib.PurePath(mutant["file"]).parent)
    wanted = list(dict.fromkeys(program for folder in options.folders for program in NEAREST[folder][:options.programs]))
    runner = Runner(learn_all(options, wanted), options.budget)
    if options.learn:
        return
    results = Results(options.out, options.seed, mutants, options.fresh)
    try_all(runner, jobs_of(options, mutants, results, runner), results, options.jobs)
    results.write()
    print_scores(results)


if __name__ == "__main__":
    sys.exit(main())
