"""The mutation run itself, on a program of three functions: mutation_test.py CXX [CLASS.METHOD...]."""
import importlib.util
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

import execute
import keys
import reach
import refuse
import run_mutants
import score
from programs import Program

HERE = pathlib.Path(__file__).parent
CXX = sys.argv[1]
HAS_CLANG = importlib.util.find_spec("clang") is not None  # python3-clang-14
if HAS_CLANG:
    import rewrite

LIMIT = """int limited(int value) {
  return value > 10 ? 10 : value;
}
int doubled(int value) {
  return value + value;
}
namespace {
const int most = 7;
}
int small(int value) {
  return value < most;
}
"""
LIMIT_TEST = """#include <gtest/gtest.h>
int limited(int value);
int doubled(int value);
int small(int value);
TEST(Limit, HoldsLargeValues) { EXPECT_EQ(limited(20), 10); }
TEST(Limit, LeavesSmallValues) { EXPECT_EQ(limited(3), 3); }
TEST(Limit, TellsSmallValues) { EXPECT_EQ(small(7), 0); }
struct Prepared : testing::Test {
  static void SetUpTestSuite() { made = doubled(0); }
  static inline int made = 1;
};
TEST_F(Prepared, IsEven) { EXPECT_EQ(made % 2, 0); }
TEST_F(Prepared, IsNothing) { EXPECT_EQ(made, 0); }
"""
OTHER = "int other(int value) {\n  return value - 1;\n}\n"
SCRIPT = """import sys, unittest
class Base(unittest.TestCase):
    def test_inherited(self): pass
class Fine(Base):
    def test_good(self): pass
    def test_bad(self): self.fail()
unittest.main(argv=sys.argv)
"""
SLOW_SCRIPT = """import sys, time, unittest
class Slow(unittest.TestCase):
    @classmethod
    def setUpClass(cls): time.sleep(0.2)
    def test_one(self): pass
    def test_other(self): pass
unittest.main(argv=sys.argv)
"""


class Repository:
    """Two small folders and the sources that a mutation run adds, in git, with compile commands."""
    per_folder = 20

    def __init__(self, folder):
        self.root, self.tree = folder / "root", folder / "tree"
        self.tree.mkdir()
        for name, text in (("server/base/limit.cpp", LIMIT), ("server/move/other.cpp", OTHER)):
            self.write(name, text)
        self.write("tests/mutation/switch.h", (HERE / "switch.h").read_text())
        subprocess.run(["git", "init", "-q"], cwd=self.root, check=True)
        commands = [{"file": str(self.root / name), "command": f"{CXX} -std=c++20 -I{self.root} -o x.o -c {name}"}
                    for name in ("server/base/limit.cpp", "server/move/other.cpp")]
        self.commands = folder / "compile_commands.json"
        self.commands.write_text(json.dumps(commands))

    def write(self, name, text):
        (self.root / name).parent.mkdir(parents=True, exist_ok=True)
        (self.root / name).write_text(text)

    def rewrite(self, *folders):
        rewrite.digest.cache_clear()
        subprocess.run([sys.executable, str(HERE / "rewrite.py"), str(self.root), str(self.tree), str(self.commands), "1", "1", str(self.per_folder), *folders], check=True,
                       stdout=subprocess.DEVNULL)
        return [{**mutant, "folder": str(pathlib.PurePath(mutant["file"]).parent)} for mutant in json.loads((self.tree / "mutants.json").read_text())]

    def copied(self, name):
        return self.tree / "source" / name


class Case(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))


@unittest.skipUnless(HAS_CLANG, "needs python3-clang-14: deploy/install-packages.sh mutation")
class Rewriting(Case):
    def test_a_file_is_rewritten_alike_whatever_else_is(self):
        repository = Repository(self.folder)
        alone = repository.rewrite("server/base")
        text, time = repository.copied("server/base/limit.cpp").read_text(), repository.copied("server/base/limit.cpp").stat().st_mtime_ns
        self.assertIn("mutation::on(", text)
        self.assertNotIn("mutation::", repository.copied("server/move/other.cpp").read_text())
        both = repository.rewrite("server/base", "server/move")
        self.assertEqual(alone, [mutant for mutant in both if mutant["folder"] == "server/base"])
        self.assertEqual(both, repository.rewrite("server/move"), "what was rewritten stays so")
        self.assertEqual(repository.copied("server/base/limit.cpp").read_text(), text)
        self.assertEqual(repository.copied("server/base/limit.cpp").stat().st_mtime_ns, time)

    def test_a_change_of_a_source_or_its_header_is_noticed(self):
        repository = Repository(self.folder)
        repository.rewrite("server/base")
        repository.write("server/base/limit.cpp", LIMIT.replace("10", "11"))
        self.assertIn("11 + 1", repository.copied("server/base/limit.cpp").read_text() if repository.rewrite("server/base") else "")
        repository.write("tests/mutation/switch.h", (HERE / "switch.h").read_text() + "// changed\n")
        repository.rewrite("server/move")
        self.assertNotIn("mutation::", repository.copied("server/base/limit.cpp").read_text(), "it is not chosen now, and its former text is out of date")

    def test_what_the_compiler_refuses_is_left_out(self):
        repository = Repository(self.folder)
        before = repository.rewrite("server/base")
        log = self.folder / "log"
        log.write_text("../server/base/limit.cpp:5:10: error: no match\n")
        self.assertEqual(refuse.main(log, repository.tree), 0)
        after = repository.rewrite("server/base")
        self.assertEqual({keys.key(m) for m in before} - {keys.key(m) for m in after}, {keys.key(m) for m in before if m["line"] == 5})
        self.assertEqual(refuse.main(log, repository.tree), 0)
        self.assertEqual(repository.rewrite("server/base"), [], "a file that fails again is left as it is")
        log.write_text("tests/base/hash_test.cpp:5:10: error: no match\n")
        self.assertEqual(refuse.main(log, repository.tree), 1)

    def test_only_the_first_ones_that_the_seed_draws_and_survivors_are_in_the_copy(self):
        repository = Repository(self.folder)
        repository.per_folder = 0  # about three, so that they compile
        every = repository.rewrite("server/base")
        self.assertTrue(all("id" in mutant for mutant in every), "of a folder without results all are taken")
        drawn = run_mutants.sample(every, "server/base", 1)
        results = {"seed": 1, "existing": {"server/base": len(every)}, "mutants": [{**drawn[-1], "by": None}, {**drawn[-2], "by": "a_test"}]}
        (repository.tree / "results.json").write_text(json.dumps(results))
        again = repository.rewrite("server/base")
        self.assertEqual({keys.key(m) for m in again}, {keys.key(m) for m in every}, "the list has all")
        taken = run_mutants.sample(again, "server/base", 1)
        self.assertGreaterEqual(len(taken), 2)
        self.assertLess(len(taken), len(every))
        self.assertEqual([keys.key(m) for m in taken], [keys.key(m) for m in [*drawn[:len(taken) - 1], drawn[-1]]])
        self.assertEqual(repository.copied("server/base/limit.cpp").read_text().count("mutation::"), len(taken))

    def test_names_are_unique_on_a_real_source(self):
        root = HERE.parents[1]
        source = rewrite.Source(root / "server/base/transform.cpp", ["-std=c++20", f"-I{root}", "-w"])
        self.assertEqual(source.find(), [])
        listed = [{"file": "f", "change": m.change, "text": source.text_of(m), "ordinal": m.ordinal} for m in source.mutants]
        self.assertGreater(len(listed), 20)
        self.assertEqual(len({keys.key(m) for m in listed}), len(listed))
        self.assertTrue(any(m["ordinal"] > 1 for m in listed))


@unittest.skipUnless(HAS_CLANG, "needs python3-clang-14: deploy/install-packages.sh mutation")
class Running(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory()))
        repository = Repository(folder)
        cls.mutants = repository.rewrite("server/base")
        (folder / "limit_test.cpp").write_text(LIMIT_TEST)
        sources = [repository.copied("server/base/limit.cpp"), folder / "limit_test.cpp", HERE / "reach_listener.cpp"]
        compilers = [subprocess.Popen([CXX, "-std=c++20", "-w", f"-I{HERE.parents[1]}", "-c", str(source), "-o", str(folder / f"{source.stem}.o")])
                     for source in sources]
        assert not any([compiler.wait() for compiler in compilers])
        program = str(folder / "limit_test")
        subprocess.run([CXX, *(str(folder / f"{source.stem}.o") for source in sources), "-lgtest", "-lgtest_main", "-o", program], check=True)
        cls.reach = reach.learn(Program("limit_test", [program], {"unit"}))
        cls.runner = run_mutants.Runner([cls.reach], 12)

    def mutant(self, change, text):
        return next(m for m in self.mutants if (m["change"], m["text"]) == (change, text))

    def reached_by(self, mutant):
        return {test.name for test in self.reach.tests if mutant["id"] in test.reaches}

    def test_each_test_is_learnt_with_the_mutants_that_it_comes_past(self):
        self.assertEqual(self.reached_by(self.mutant("> -> >=", "value > 10")), {"Limit.HoldsLargeValues", "Limit.LeavesSmallValues"})

    def test_a_constant_counts_for_every_test(self):
        self.assertEqual(len(self.reached_by(self.mutant("7 -> 7 + 1", "7"))), 5)

    def test_what_a_suite_prepares_counts_for_all_its_tests(self):
        self.assertEqual(self.reached_by(self.mutant("+ -> -", "value + value")), {"Prepared.IsEven", "Prepared.IsNothing"})

    def test_a_mutant_that_a_test_notices_is_killed(self):
        for mutant in (self.mutant("< -> <=", "value < most"), self.mutant("7 -> 7 + 1", "7")):
            self.assertEqual(self.runner.attempt(mutant)["by"], "limit_test", mutant)

    def test_a_mutant_that_no_test_notices_survives(self):
        for mutant in (self.mutant("> -> >=", "value > 10"), self.mutant("+ -> -", "value + value")):
            result = self.runner.attempt(mutant)
            self.assertEqual((result["by"], result["reached"]), (None, True), mutant)


class Limits(unittest.TestCase):
    def test_a_program_ends_well_badly_or_late(self):
        self.assertEqual(execute.run(["true"], {}, 5), execute.End.WELL)
        self.assertEqual(execute.run(["false"], {}, 5), execute.End.BADLY)
        self.assertEqual(execute.run(["sleep", "5"], {}, 0.1), execute.End.LATE)

    def test_a_program_cannot_take_all_memory(self):
        self.assertEqual(execute.run([sys.executable, "-c", "bytes(1 << 28)"], {}, 10), execute.End.WELL)
        self.assertEqual(execute.run([sys.executable, "-c", "bytes(5 << 30)"], {}, 10), execute.End.BADLY)


class Scripts(Case):
    def test_each_method_is_a_test(self):
        script = self.folder / "tests" / "fake_test.py"
        script.parent.mkdir()
        script.write_text(SCRIPT)
        program = Program("Fake", [sys.executable, str(script)], {"client"})
        self.assertEqual(program.methods(), ["Base.test_inherited", "Fine.test_good", "Fine.test_bad", "Fine.test_inherited"])
        self.assertFalse(program.steady)
        learnt = reach.learn(program)
        self.assertEqual([test.name for test in learnt.tests], ["Base.test_inherited", "Fine.test_good", "Fine.test_inherited"])
        self.assertEqual(learnt.overhead_s, 0)

    def test_what_setUpClass_takes_counts_once(self):
        script = self.folder / "slow_test.py"
        script.write_text(SLOW_SCRIPT)
        learnt = reach.learn(Program("Slow", [sys.executable, str(script)], {"client"}))
        self.assertGreaterEqual(learnt.overhead_s, 0.2)
        self.assertEqual(min(test.seconds for test in learnt.tests), 0)

    def test_scripts_run_the_tests_that_they_are_given(self):
        for name in ("attack/budgets", "attack/process", "attack/transport", "attack/trust", "command/command_line", "command/json", "demo/demo",
                     "fault/injected", "metrics/metrics"):
            self.assertRegex((HERE.parent / f"{name}_test.py").read_text(), r"sys\.argv\[\d:\]", name)


class Order(unittest.TestCase):
    def timed(self, *seconds, program="a"):
        return [reach.Test(f"{program}{n}", program, time, {1}) for n, time in enumerate(seconds)]

    def test_quick_tests_run_together_and_first(self):
        found = run_mutants.slices(self.timed(0.2, 4.0, 0.3, 9.0, 0.6) + self.timed(0.1, program="b"))
        self.assertEqual([(part.program, [test.seconds for test in part.tests]) for part in found],
                         [("a", [0.2, 0.3]), ("b", [0.1]), ("a", [0.6, 4.0]), ("a", [9.0])])

    def test_near_tests_and_others_have_a_budget_each(self):
        tests = self.timed(5, 6, 7) + self.timed(1, 10, 2, program="b")
        found = run_mutants.chosen_slices({"id": 1}, tests, ["a"], 12)
        self.assertEqual(sum((part.tests for part in found), []), [tests[0], tests[1], tests[3], tests[5]])

    def test_a_larger_sample_extends_a_smaller_one(self):
        mutants = [{"file": "f", "change": "c", "text": str(n), "ordinal": 1, "folder": "server/base", "id": n} for n in range(30)]
        drawn = run_mutants.sample(mutants, "server/base", 1)
        self.assertEqual(run_mutants.sample(mutants[5:], "server/base", 1), [m for m in drawn if m in mutants[5:]])
        self.assertNotEqual(drawn, run_mutants.sample(mutants, "server/base", 2))

    def test_folders_take_turns(self):
        self.assertEqual(run_mutants.in_turn([[1, 2, 3], [4], [5, 6]]), [1, 4, 5, 2, 6, 3])


class Keeping(Case):
    MUTANTS = [{"file": "server/base/a.cpp", "line": n, "change": "c", "text": "t", "ordinal": n, "folder": "server/base", "id": n} for n in (1, 2, 3, 4)]

    def options(self, per_folder, again=False):
        return type("Options", (), {"folders": ["server/base"], "seed": 1, "per_folder": per_folder, "again": again})

    def test_a_second_run_goes_on_and_again_takes_survivors(self):
        path = self.folder / "results.json"
        runner = run_mutants.Runner([], 12)
        first = run_mutants.Results(path, 1, self.MUTANTS, False)
        jobs = run_mutants.jobs_of(self.options(2), self.MUTANTS, first, runner)
        self.assertEqual(len(jobs), 2)
        for mutant, by in zip(jobs, (None, "x")):
            first.add({**mutant, "by": by, "reached": True, "met": []})
        second = run_mutants.Results(path, 1, self.MUTANTS, False)
        self.assertEqual(len(run_mutants.jobs_of(self.options(4), self.MUTANTS, second, runner)), 2)
        self.assertEqual(run_mutants.jobs_of(self.options(4, again=True), self.MUTANTS, second, runner), jobs[:1])
        with self.assertRaises(ValueError):
            run_mutants.Results(path, 2, self.MUTANTS, False)
        self.assertEqual(run_mutants.Results(path, 2, self.MUTANTS, True).by_key, {})

    def test_a_survivor_that_other_programs_reach_now_is_open(self):
        runner = run_mutants.Runner([], 12)
        runner.tests = [reach.Test("A.B", "a", 1, {1})]
        mutant = {**self.MUTANTS[0], "id": 1}
        self.assertTrue(runner.is_open(mutant, None))
        self.assertTrue(runner.is_open(mutant, {"by": None, "met": ["b"]}))
        self.assertFalse(runner.is_open(mutant, {"by": None, "met": ["a", "b"]}))
        self.assertFalse(runner.is_open(mutant, {"by": "b", "met": ["b"]}))

    def test_equal_mutants_do_not_count(self):
        mutants = [{**mutant, "by": by, "reached": True} for mutant, by in zip(self.MUTANTS, ("x", "x", None, None))]
        equal = [{"file": "server/base/a.cpp", "change": "c", "text": "t", "ordinal": 3, "equal": True, "reason": "why"}]
        found = score.scores(mutants, {"server/base": 90}, equal)["server/base"]
        self.assertEqual(found[:4], (90, 4, 2, 1))
        self.assertEqual(score.share(found), "67% (21 to 94)")

    def test_the_interval_is_wilsons(self):
        for killed, tried, low, high in ((8, 10, 0.490, 0.943), (0, 10, 0.0, 0.278), (0, 0, 0.0, 1.0)):
            self.assertAlmostEqual(score.wilson(killed, tried)[0], low, 3)
            self.assertAlmostEqual(score.wilson(killed, tried)[1], high, 3)

    def test_files_have_numbers_of_their_own(self):
        files = [f"server/base/{n}.cpp" for n in range(600)]
        first = keys.first_numbers(files)
        self.assertEqual(len(set(first.values())), 600)
        self.assertLessEqual(max(first.values()) + keys.BLOCK, keys.NUMBERS)


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]])
