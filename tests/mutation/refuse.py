#!/usr/bin/env python3
"""Notes which mutants a compiler refused, so that rewrite.py leaves them out: refuse.py BUILD_LOG TREE

g++ refuses a few that clang lets through. Those go that begin on a line with an error, or else contain it; a file that fails again loses all its
mutants. Fails when no mutant is to blame.
"""
import hashlib
import json
import pathlib
import re
import sys

from keys import key

ERROR = re.compile(r"((?:server|client)/[\w./-]+\.cpp):(\d+):\d+: (?:fatal )?error:")


def blamed(mutants, lines):
    """The mutants that the errors on these lines of a file may come from."""
    out = []
    for line in lines:
        begun = [m for m in mutants if m["line"] == line]
        out += begun or [m for m in mutants if m["line"] <= line <= m["last_line"]]
    return sorted({key(mutant) for mutant in out})


def main(log, tree):
    tree = pathlib.Path(tree)
    mutants = [mutant for mutant in json.loads((tree / "mutants.json").read_text()) if "id" in mutant]
    path = tree / "refused.json"
    refused = json.loads(path.read_text()) if path.exists() else {}
    rewritten = {mutant["file"] for mutant in mutants}
    errors = {}
    for file, line in ERROR.findall(pathlib.Path(log).read_text(errors="replace")):
        errors.setdefault(file, set()).add(int(line))
    progress = False
    for file in errors.keys() & rewritten:
        made = json.loads((tree / "rewritten" / f"{file}.json").read_text())
        source = next(known for name, known in made["read"].items() if name.endswith(f"/{file}"))
        before = refused.get(file)
        again = before is not None and before["source"] == source
        keys = blamed([m for m in mutants if m["file"] == file], errors[file])
        refused[file] = {"source": source, "keys": None if again or not keys else keys}
        print(f"{file}: the compiler refuses {'all mutants' if refused[file]['keys'] is None else f'{len(keys)} mutants'}")
        progress = True
    path.write_text(json.dumps(refused, indent=0))
    return 0 if progress else 1


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
