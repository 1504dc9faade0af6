#!/usr/bin/env python3
"""locks_test.py SOURCE_ROOT BUILD: what a mutex guards (server/base/mutex.h) is used with that mutex held only, by clang's thread safety
analysis. The sources are parsed and not compiled: those that lock a mutex, and those whose header has one.

What the analysis cannot see: what constructors and destructors do, data that is passed on under a mutex and used without it, and data whose
guard is no mutex. ThreadSanitizer looks for these (tests/sanitizers.sh)."""
import json
import pathlib
import re
import shlex
import sys
import unittest

try:
    import clang.cindex as clang
except ImportError:
    clang = None

ROOT, BUILD = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
WRAPPER = ROOT / "server/base/mutex.h"
LOCKS = re.compile(r"\b(MutexLock|GUARDED|NEEDS)\b")
# The standard's own, which clang cannot check. A base class of spdlog's wants one; the sink itself has none.
BARE = re.compile(r"std::(mutex|shared_mutex|recursive_mutex|timed_mutex|lock_guard|unique_lock|scoped_lock|condition_variable)\b")
EXCUSED = "spdlog::sinks::base_sink<std::mutex>"


def sources():
    """The sources of the server that lock something, or whose header has something to lock."""
    for source in sorted((ROOT / "server").rglob("*.cpp")):
        if any(LOCKS.search(file.read_text()) for file in (source, source.with_suffix(".h")) if file.exists()):
            yield source


class Commands:
    def __init__(self):
        self.entries = {entry["file"]: entry for entry in json.loads((BUILD / "compile_commands.json").read_text())}

    def arguments(self, source):
        """Where the file's headers are, and its macros."""
        entry = self.entries[str(source)]
        words = iter(shlex.split(entry["command"]))
        kept = ["-working-directory", entry["directory"]]
        for word in words:
            if word in ("-I", "-isystem"):
                kept += [word, next(words)]
            elif word.startswith(("-I", "-D", "-std=")):
                kept.append(word)
        return [*kept, "-Wno-everything", "-Wthread-safety"]

    def complaints(self, source, texts=None):
        """What clang says, as FILE:LINE: WHAT. With `texts`: what it says of each of them, in place of what the file holds."""
        unit = clang.Index.create().parse(str(source), self.arguments(source), options=clang.TranslationUnit.PARSE_PRECOMPILED_PREAMBLE if texts else 0)
        if not texts:
            return of(unit)
        told = []
        for text in texts:
            unit.reparse([(str(source), text)])
            told.append("\n".join(of(unit)))
        return told


def of(unit):
    return [f"{found.location.file}:{found.location.line}: {found.spelling}" for found in unit.diagnostics if found.severity >= clang.Diagnostic.Warning]


@unittest.skipUnless(clang, "python3-clang-14 is not installed")
class Locks(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.commands = Commands()

    def test_what_a_mutex_guards_is_used_under_it(self):
        found = {complaint for source in sources() for complaint in self.commands.complaints(source)}
        self.assertEqual("", "\n".join(sorted(found)))

    def test_a_lock_that_is_left_out_given_up_too_early_or_taken_twice_is_noticed(self):
        source = ROOT / "server/service/daemon_state.cpp"
        text, lock = source.read_text(), "const MutexLock lock(mutex_);"
        places = [found.start() for found in re.finditer(re.escape(lock), text)]
        self.assertGreater(len(places), 3)
        left_out = [text[:at] + text[at + len(lock):] for at in places]
        *without, early, twice, good = self.commands.complaints(source, [*left_out, text.replace(lock, "MutexLock lock(mutex_); lock.unlock();"),
                                                                         text.replace(lock, lock + " const MutexLock again(mutex_);"), text])
        for told in (*without, early):
            self.assertIn("requires holding mutex 'mutex_'", told)
        self.assertIn("already held", twice)
        self.assertEqual(good, "")

    def test_a_condition_that_does_not_say_what_it_needs_is_noticed(self):
        source = ROOT / "server/service/watchdog.cpp"
        text = source.read_text()
        self.assertIn("() NEEDS(mutex_) {", text)
        (told,) = self.commands.complaints(source, [text.replace("() NEEDS(mutex_) {", " {")])
        self.assertIn("'stopping_' requires holding mutex 'mutex_'", told)


class Wrapper(unittest.TestCase):
    def test_no_other_mutex_is_used_in_the_server(self):
        bare = [f"{file.relative_to(ROOT)}: {line.strip()}" for file in sorted((ROOT / "server").rglob("*.[ch]*")) if file != WRAPPER
                for line in file.read_text().splitlines() if BARE.search(line.replace(EXCUSED, ""))]
        self.assertEqual(bare, [])


if __name__ == "__main__":
    sys.argv[1:] = sys.argv[3:]
    unittest.main(verbosity=2)
