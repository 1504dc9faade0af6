#!/usr/bin/env python3
"""Keeps a copy of the repository in which sources contain the mutants that a run may try:

  rewrite.py ORIGINAL TREE COMPILE_COMMANDS JOBS SEED PER_FOLDER FOLDER...

TREE/source is the copy, and TREE/mutants.json the list of all mutants: file, lines, kind, change, text and ordinal, and the number of those that
are in the copy. These are the first ones that the seed draws of each folder, enough for PER_FOLDER of them, and the survivors in
TREE/results.json: fewer compile sooner, and leave inner loops as fast as they are. Of a folder that the results do not know all are taken. The
sources of the folders are rewritten (instrument.py). Those of other folders stay as a former run has rewritten them, where nothing that they
include has changed since, so that another choice of folders compiles nothing again. COMPILE_COMMANDS are those of a build of ORIGINAL, which has
made the generated sources. TREE/refused.json names mutants that the compiler refused although clang did not (refuse.py).
"""
import functools
import hashlib
import json
import math
import multiprocessing
import pathlib
import shlex
import subprocess
import sys

from instrument import Source
from keys import BLOCK, first_numbers, key, place
from nearest import NEAREST


@functools.cache
def digest(path):
    try:
        return hashlib.sha256(pathlib.Path(path).read_bytes()).hexdigest()
    except FileNotFoundError:
        return None


def sources(root, folders):
    return sorted(str(path.relative_to(root)) for folder in folders for path in (root / folder).glob("*.cpp") if path.name != "example.cpp")


def compile_arguments(commands, root):
    """Arguments for clang by file."""
    out = {}
    for entry in json.loads(pathlib.Path(commands).read_text()):
        file = pathlib.Path(entry["file"]).resolve()
        if not file.is_relative_to(root):
            continue
        words = shlex.split(entry["command"])
        start = next(i for i, word in enumerate(words) if word.startswith("-"))  # after the compiler, and a launcher before it
        arguments = [word for word in words[start:words.index("-o")] if not word.startswith("-W")]
        out[str(file.relative_to(root))] = [*arguments, "-w", "-ferror-limit=0"]
    return out


class Choice:
    """Which mutants are put into the copy."""

    def __init__(self, seed, per_folder, results):
        self.seed, self.per_folder, self.existing = seed, per_folder, results["existing"]
        self.survivors = [mutant for mutant in results["mutants"] if mutant["by"] is None]

    def share(self, file):
        """Of the folder's mutants: a power of 1/2, so that a few mutants more or less change nothing. Some that are drawn do not compile."""
        existing = self.existing.get(str(pathlib.PurePath(file).parent), 0)
        wanted = 1.3 * self.per_folder + 3
        return 1.0 if existing <= wanted else min(1.0, 2.0 ** math.ceil(math.log2(wanted / existing)))

    def survivors_of(self, file):
        """Those that the share does not take anyway."""
        share = self.share(file)
        return [list(key(m)) for m in self.survivors if m["file"] == file and place(m, self.seed) >= share]

    def takes(self, mutant):
        return place(mutant, self.seed) < self.share(mutant["file"]) or list(key(mutant)) in self.survivors_of(mutant["file"])


class Rewriter:
    """Rewrites files one at a time, and keeps what it has made beside all that this depends on."""

    def __init__(self, root, tree, arguments, first, choice):
        self.root, self.kept, self.arguments, self.first, self.choice = root, tree / "rewritten", arguments, first, choice
        refused = tree / "refused.json"
        self.refused = json.loads(refused.read_text()) if refused.exists() else {}

    def former(self, file):
        """What was made of the file before, if nothing has changed that it depends on."""
        path = self.kept / f"{file}.json"
        if not path.exists() or file not in self.arguments:
            return None
        made = json.loads(path.read_text())
        current = made["asked"] == self.asked(file) and all(digest(path) == known for path, known in made["read"].items())
        return made if current else None

    def asked(self, file):
        chosen = [self.choice.seed, self.choice.share(file), self.choice.survivors_of(file)]
        return [self.arguments[file], self.first[file], self.refused_of(file), chosen, digest(pathlib.Path(__file__).with_name("instrument.py"))]

    def refused_of(self, file):
        """Keys of mutants that the compiler refused; None: of all."""
        entry = self.refused.get(file)
        return entry["keys"] if entry and entry["source"] == digest(self.root / file) else []

    def make(self, file):
        source = Source(self.root / file, self.arguments[file])
        rest = []
        try:
            if errors := source.find():
                raise ValueError(f"clang cannot read it: {errors[0]}")
            rest = self.leave_out(file, source)
            source.compile_out()
            text = source.render(self.first[file])[0].decode()
        except ValueError as error:
            print(f"{file}: left as it is: {error}", file=sys.stderr)
            source.mutants = []
        numbered = [{"id": self.first[file] + number, **told} for number, told in enumerate(self.listed(file, source))]
        made = {"asked": self.asked(file), "read": self.read_by(source), "mutants": numbered + rest}
        made["text"] = text if source.mutants else source.original()
        path = self.kept / f"{file}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(made))
        print(f"{file}: {len(numbered)} of {len(made['mutants'])} mutants", flush=True)
        return made

    def leave_out(self, file, source):
        """Keeps the chosen mutants that no compiler has refused. Returns those that are not chosen."""
        refused = self.refused_of(file)
        allowed = [(mutant, told) for mutant, told in zip(source.mutants, self.listed(file, source))
                   if refused is not None and list(key(told)) not in refused]
        source.mutants = [mutant for mutant, told in allowed if self.choice.takes(told)]
        if len(source.mutants) > BLOCK:
            raise ValueError(f"{len(source.mutants)} mutants, of {BLOCK} at most")
        return [told for _, told in allowed if not self.choice.takes(told)]

    def read_by(self, source):
        """Digests of the project's own files that the source depends on. Libraries stay the same."""
        inside = {path for path in map(pathlib.Path, source.headers) if path.is_relative_to(self.root)}
        return {str(path): digest(path) for path in sorted({*inside, pathlib.Path(source.path)})}

    def listed(self, file, source):
        return [{"file": file, "line": source.lines_of(mutant)[0], "last_line": source.lines_of(mutant)[1],
                 "kind": mutant.kind, "change": mutant.change, "text": source.text_of(mutant), "ordinal": mutant.ordinal}
                for mutant in source.mutants]


def write_copy(root, copy, rewritten):
    """Files keep their times unless they change, so a second build compiles little."""
    listed = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"], cwd=root, capture_output=True, check=True)
    files = {file for file in listed.stdout.decode().split("\0") if file and (root / file).is_file()}
    for file in files:
        text = rewritten[file].encode() if file in rewritten else (root / file).read_bytes()
        to = copy / file
        if not to.exists() or to.read_bytes() != text:
            to.parent.mkdir(parents=True, exist_ok=True)
            to.write_bytes(text)
        to.chmod((root / file).stat().st_mode)
    for folder in [folder for folder in copy.iterdir() if folder.is_dir() and folder.name != "build"]:
        for path in [path for path in folder.rglob("*") if path.is_file() and str(path.relative_to(copy)) not in files]:
            path.unlink()


def results_of(tree):
    path = tree / "results.json"
    return json.loads(path.read_text()) if path.exists() else {"existing": {}, "mutants": []}


def main(original, tree, commands, jobs, seed, per_folder, *folders):
    root, tree = pathlib.Path(original).resolve(), pathlib.Path(tree).resolve()
    every = sources(root, NEAREST)
    choice = Choice(int(seed), int(per_folder), results_of(tree))
    rewriter = Rewriter(root, tree, compile_arguments(commands, root), first_numbers(every), choice)
    made = {file: former for file in every if (former := rewriter.former(file))}
    wanted = [file for file in sources(root, folders) if file not in made and file in rewriter.arguments]
    with multiprocessing.Pool(int(jobs)) as pool:
        made.update(zip(wanted, pool.imap(rewriter.make, wanted)))
    write_copy(root, tree / "source", {file: entry["text"] for file, entry in made.items()})
    mutants = [mutant for file in sorted(made) for mutant in made[file]["mutants"]]
    (tree / "mutants.json").write_text(json.dumps(mutants, indent=0))
    numbered = sum("id" in mutant for mutant in mutants)
    print(f"{numbered} of {len(mutants)} mutants in {len(made)} files, of which {len(wanted)} are rewritten now")


if __name__ == "__main__":
    main(*sys.argv[1:])
