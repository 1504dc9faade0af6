#!/usr/bin/env python3
"""Writes the page on trust, README.md, from the files beside it.

    make_page.py                               # the page
    make_page.py --add-executions FILE         # counts of tests/fuzz.sh are added to fuzz.csv first
    make_page.py --mixes FILE                  # mixes.json is written first, from what tests/attack/mixes.py wrote
"""
import argparse
import csv
import json
import pathlib
import re
import statistics
import sys

HERE = pathlib.Path(__file__).parent
TESTS = HERE.parents[1]
sys.path.insert(0, str(TESTS / "mutation"))
import score  # noqa: E402
HEAD = """# Trust

`tests/results/trust/make.sh` makes this page: do not edit it by hand. `make_page.py` writes it again from the files in this folder.
[SECURITY.md](../../../deploy/SECURITY.md) says what is promised, and against whom.
"""


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + " --- |" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(str(cell).replace("|", "\\|").replace("\n", " ") for cell in row) + " |" for row in rows]) + "\n"


def load(name):
    path = HERE / name
    return json.loads(path.read_text()) if path.exists() else None


def verdict(passed):
    return "**passed**" if passed else "**FAILED**"


def attacks():
    data = load("attacks.json")
    if not data:
        return "Not measured yet.\n"
    rows = []
    for row in data["rows"]:
        if "skipped" in row:
            rows.append([row["number"], "", "", "", "", "", f"skipped: {row['skipped']}", ""])
            continue
        p99 = f"{row['p99_ms']:.1f} ms" if row["p99_ms"] is not None else "none"
        answered = "" if row["answered"] == row["ticks"] else f", {row['answered']} of {row['ticks']} answered"
        memory = f"{row['memory_before_mib']:.0f}, {row['memory_most_mib']:.0f}, {row['memory_after_mib']:.0f} MiB"
        rows.append([row["number"] or "", row["name"], row["before"], row["seen"] + (f"; {row['error']}" if row["error"] else ""), p99 + answered,
                     memory, verdict(row["passed"])])
    rows = [row[:7] for row in rows]
    passed = sum(row.get("passed", False) for row in data["rows"])
    return (f"A session at 60 Hz runs beside each attack, for {data['seconds']:.0f} s, on {data['cpus']} CPUs that daemon, attacker and session share. "
            f"{'The daemon has ' + str(data['memory_limit_mib']) + ' MiB, as in the default container. ' if data.get('memory_limit_mib') else ''}"
            f"An attack passes when every tick of the session was answered with a p99 under 33 ms, and the daemon's memory was back within 10 % "
            f"{data['after_s']:.0f} s after it. Scenes that are kept for sessions to come may stay in memory; and an attack that stops the daemon itself "
            f"for {max(row.get('stopped_ms', 0) for row in data['rows']):.0f} ms may delay an answer by as much. The memory is before, at most, and after. \"Before\" is what the attack did when it was first tried, on "
            f"a daemon without gate and budgets. {passed} of {len(data['rows'])} passed.\n\n" +
            table(["#", "attack", "before", "now", "p99 beside it", "memory", ""], rows) +
            "\n`tests/attack` asserts the same without times (`ctest -R Attack_`); [its page](../../attack/README.md) says what stops each attack.\n")


def probes():
    data = load("probes.json")
    if not data:
        return "Not measured yet: `tests/attack/measure.py` with `--probes-out`.\n"
    rows = []
    for name, key in (("the gRPC health service", "health"), ("`/livez` of the metrics port", "livez")):
        all_of = [(row[key], row) for row in data["rows"]]
        longest, at = max(all_of, key=lambda pair: pair[0]["max_ms"])
        rows.append([name, f"{sum(of['asked'] for of, _ in all_of):,}", f"{sum(of['well'] for of, _ in all_of):,}",
                     f"{statistics.median(of['p50_ms'] for of, _ in all_of):.1f} ms", f"{longest['max_ms']:.0f} ms", f"{at['number']}: {at['name']}"])
    return (f"Beside each of these attacks, for {data['seconds']:.0f} s, a prober asked whether the daemon lives, ten times a second and each time on a new "
            f"connection, as Kubernetes does. It came from an address of its own. {data.get('note', '')}\n\n" +
            table(["asked", "times", "good answers", "median", "longest wait", "beside attack"], rows))


def mixes():
    data = load("mixes.json")
    if not data:
        return "Not measured yet: `tests/results/trust/make.sh --mixes 1000`.\n"
    late = "none" if not data["late"] else ", ".join(str(number) for number in data["late"])
    rows = [["healthy session, p99 beside a mix", f"{data['p99_ms']['p50']} ms in the median, {data['p99_ms']['p99']} ms at the 99th percentile, "
             f"{data['p99_ms']['max']} ms at most", ""],
            ["the same between mixes", f"{data['quiet_p99_ms']} ms", ""],
            ["mixes that delayed it each of three times", late, verdict(not data["late"])],
            ["all ticks answered, and the memory back within 10 %", data["failed"] or "yes", verdict(not data["failed"])]]
    return (f"`tests/attack/mixes.py` draws frames of every type and size at random, with counts, flags and streams that a client may or may not send, and "
            f"floods for {data['seconds']:g} s with each of {data['mixes']:,} mixes, {data['sent_mb']:,} MB in all. One session of another client ticks at "
            f"60 Hz all the while. A mix is late when the session's p99 is over 33 ms and over three times that of the quiet times before it. The daemon "
            f"has 512 MiB. {data.get('note', '')}\n\n" + table(["", "figure", ""], rows))


def sum_up_mixes(path):
    """Writes mixes.json from what `tests/attack/mixes.py --out` wrote."""
    of = json.loads(pathlib.Path(path).read_text())
    waits = sorted(row["p99_ms"] for row in of["rows"])
    data = {"mixes": len(waits), "seconds": of["seconds"], "sent_mb": round(sum(row["sent_mb"] for row in of["rows"])),
            "p99_ms": {"p50": waits[len(waits) // 2], "p99": waits[int(0.99 * len(waits))], "max": waits[-1]}, "quiet_p99_ms": of["quiet_p99_ms"],
            "late": [row["mix"] for row in of["rows"] if row["late"]], "failed": of["failed"]}
    (HERE / "mixes.json").write_text(json.dumps(data, indent=1) + "\n")


def soak():
    data = load("soak.json")
    if not data:
        return "Not measured yet: `tests/soak.sh HOURS`.\n"
    totals = ", ".join(f"{count:,} {name}" for name, count in data["totals"].items())
    rows = [[name, entry["figure"], verdict(entry["passed"])] for name, entry in data["verdicts"].items()]
    return (f"`tests/soak.sh {data['hours']:g}`: 16 sessions at 60 Hz for {data['hours'] * 60:.0f} minutes on {data['cpus']} CPUs, with scene changes, sessions "
            f"that are closed or cut off, and uploads: {totals}.\n\n" + table(["of the daemon", "figure", ""], rows))


def faults():
    data = load("faults.json")
    if not data:
        return "Not measured yet: `tests/fault.sh`.\n"
    wait = data["wait_ms"]
    rows = [[name, f"{count:,}"] for name, count in data["faults"].items()]
    return (f"`tests/fault.sh`, on {data['cpus']} CPUs: {data['sessions']} sessions that tick at 60 Hz at most, {data['ticks']:,} ticks. Every "
            f"camera must go on within {data['most_wait_s']:g} s, and never move farther in a tick than its speed limit allows. Only a network that falls silent "
            f"and a daemon that is stopped may take longer: the client's reply timeout notices them.\n\n" +
            table(["fault", "times"], rows) +
            f"\n{data['resumed']:,} streams were resumed, and {data['opened_again']:,} sessions were opened again in the other daemon. After a fault the camera waited "
            f"{wait['p50']} ms in the median, {wait['p99']} ms at the 99th percentile and {wait['max']} ms at most, silent networks included. "
            f"{data['late']} ticks waited for too long, and {data['jumps']} cameras jumped: {verdict(data['passed'])}. "
            "[Its page](../../fault/README.md) describes the faults.\n")


def deltas():
    path = HERE / "deltas.txt"
    return f"`build/release/bin/delta_storm 100000`:\n\n```text\n{path.read_text().strip()}\n```\n" if path.exists() else "Not measured yet.\n"


def fuzz_counts():
    path = HERE / "fuzz.csv"
    return {row["target"]: [int(row["executions"]), int(row["seconds"])] for row in csv.DictReader(path.open())} if path.exists() else {}


def add_executions(file):
    counts = fuzz_counts()
    for line in pathlib.Path(file).read_text().splitlines():
        target, executions, seconds = line.split()
        former = counts.setdefault(target, [0, 0])
        former[0] += int(executions)
        former[1] += int(seconds)
    with (HERE / "fuzz.csv").open("w") as out:
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(("target", "executions", "seconds"))
        writer.writerows((target, *counts[target]) for target in sorted(counts))


READS = {"access": "access files", "config": "configuration files", "control": "messages of a session: opening, ticks, deltas, in any order",
         "delta": "scene deltas, against a plain model of the scene", "frames": "HTTP/2 frames", "gltf": "scene files", "mcap": "recordings"}


# The targets that read what clients and operators send; the others read for the gate.
MAIN_TARGETS = ("control", "delta", "gltf", "config", "mcap")


def kept_corpus(target):
    """The number of files in a target's kept corpus, and their size in bytes."""
    folder = TESTS / "record/mcap_corpus" if target == "mcap" else TESTS / "fuzz/corpus" / target
    files = [path.stat().st_size for path in folder.iterdir()]
    return len(files), sum(files)


def fuzzing():
    counts = fuzz_counts()
    findings = (HERE / "findings.md").read_text()

    def row(name, reads, targets):
        executions, seconds = (sum(counts.get(target, (0, 0))[i] for target in targets) for i in (0, 1))
        files, size = (sum(kept_corpus(target)[i] for target in targets) for i in (0, 1))
        found = sum(len(re.findall(rf"^- `{target}`", findings, re.M)) for target in targets)
        return [name, reads, f"{executions:,}", f"{seconds:,}", f"{executions / max(seconds, 1):,.0f}", f"{files} files, {size / 1024:.0f} KiB", found]

    others = sorted(set(READS) - set(MAIN_TARGETS))
    rows = [row(target, READS[target], [target]) for target in MAIN_TARGETS]
    rows.append(row("**these five**", "", MAIN_TARGETS))
    rows += [row(target, READS[target], [target]) for target in others]
    return ("`tests/fuzz.sh MINUTES`, with AddressSanitizer and UndefinedBehaviorSanitizer; leaks are looked for. Every test run reads the kept corpora.\n\n" +
            table(["target", "reads", "executions", "seconds", "a second", "kept corpus", "findings"], rows) + "\n" + findings)


def mutation():
    data = load("mutants.json")
    if not data:
        return "Not measured yet: `tests/mutation.sh`.\n"
    survivors = load("survivors.json") or []
    found = score.scores(data["mutants"], data["existing"], survivors)
    rows = [[name, one.all, one.mutants, one.killed, one.equal or "", score.share(one)] for name, one in found.items()]
    alive = [mutant for mutant in data["mutants"] if mutant["by"] is None]
    reasons = score.reasons_by_key(survivors)
    equal = [mutant for mutant in alive if reasons.get(score.key(mutant), {}).get("equal")]
    return (f"`tests/mutation.sh`: small changes of the program, drawn with seed {data['seed']}; a test that fails, crashes or hangs kills one. A mutant meets "
            "the tests that come past it: those of its folder and the nearest wider ones (`tests/mutation/nearest.py`) for 12 s, and then all others of that "
            "table for 12 s; some survivors were tried again for 60 s each. The golden recording is not among them: it notices every bit. Headers are not mutated, and so neither is what stands in them "
            "alone. Mutants that no test can notice are listed apart and do not count. The score is the share of the others that is killed, in brackets with "
            "its 95 % interval (Wilson), which says how far the drawn ones may mislead about the folder. The last row counts all that were drawn, whatever "
            "the sizes of the folders. The goal is 85 %. Many tests were written with the drawn mutants in view, so another seed may give a lower "
            "score.\n\n" +
            table(["folder", "mutants", "tried", "killed", "equal", "score"], rows) +
            "\nThose that survived:\n\n" + survivor_table([mutant for mutant in alive if mutant not in equal], reasons) +
            ("\nThose that no test can notice:\n\n" + survivor_table(equal, reasons) if equal else ""))


def survivor_table(mutants, reasons):
    rows = []
    for mutant in mutants:
        known = reasons.get(score.key(mutant), {}).get("reason", "not examined" if mutant["reached"] else "no test comes past it")
        rows.append([f"{mutant['file']}:{mutant['line']}", mutant["change"], f"`{mutant['text'][:60]}`", known])
    return table(["place", "change", "of", "reason"], rows)


def skew():
    return ("The Python client of version 0.1 plays a session on this daemon, and gets the replies that today's client gets, field by field. Today's client "
            "reads what the server of version 0.1 answered, and finds everything that the former contract finds in the bytes. These answers, of the golden "
            "recording of version 0.1, are kept in `tests/skew/former`; `tests/skew.sh` builds the former daemon from the history and plays both ways again. `ctest -R VersionSkew`.\n")


def page():
    parts = [HEAD, "## Attacks\n\n" + attacks(), "## Probes\n\n" + probes(), "## Mixes of frames\n\n" + mixes(), "## Soak\n\n" + soak(), "## Faults\n\n" + faults(), "## Deltas under overload\n\n" + deltas(), "## Fuzzing\n\n" + fuzzing(),
             "## Versions\n\n" + skew(), "## Mutants\n\n" + mutation(), "## What users expect of such a service\n\n" + (HERE / "promises.md").read_text()]
    return "\n".join(parts)


def commands():
    """The tests that the page names: (regular expression of ctest)."""
    return re.findall(r"ctest -R '?([^'`\s]+)'?", (HERE / "promises.md").read_text().replace("\\|", "|"))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--add-executions", metavar="FILE")
    parser.add_argument("--mixes", metavar="FILE")
    options = parser.parse_args()
    if options.mixes:
        sum_up_mixes(options.mixes)
    if options.add_executions:
        add_executions(options.add_executions)
    (HERE / "README.md").write_text(page(), encoding="utf-8")
