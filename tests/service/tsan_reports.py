"""Reads ThreadSanitizer's reports and prints those that are about our code: tsan_reports.py FOLDER. Exits with 1 when there is one.

Debian's gRPC, Abseil and protobuf are not instrumented: the sanitizer does not see their locks and reference counts. So only a report counts
whose two accesses both happen in our code: the first frame that belongs neither to the sanitizer nor to the C++ library is ours. Other kinds
of reports, such as a lock that is taken twice, count when our code is anywhere in them.
"""
import pathlib
import re
import sys

FRAME = re.compile(r"^\s+#\d+ (.*?) (?:\S+:\d+|<null>|\S+) ?\(.*$")
LIBRARY = re.compile(r"^(operator (new|delete)|memcpy|memmove|memset|memcmp|strlen|free|malloc|calloc|realloc|pthread_|std::|__gnu_cxx::|void std::|bool std::|__tsan)")
OURS = re.compile(r"\bsightline::")


def stacks(report):
    """The stacks of the two accesses, each a list of functions."""
    out = []
    for line in report.splitlines():
        if re.match(r"^\s+(Previous |)(atomic |)(read|write) of size", line, re.I):
            out.append([])
        elif out and (frame := FRAME.match(line)):
            out[-1].append(frame[1])
        elif out and not line.strip():
            if len(out) == 2:
                break
    return out


def is_ours(report):
    if "data race" not in report.splitlines()[0]:
        return bool(OURS.search(report))
    accesses = stacks(report)
    innermost = [next((frame for frame in frames if not LIBRARY.match(frame)), "") for frames in accesses]
    # An access without a stack is one that the sanitizer no longer remembers.
    return len(accesses) == 2 and all(OURS.search(frame) for frame in innermost)


def reports_in(text):
    return [part for part in re.split(r"=+\n", text) if part.startswith("WARNING: ThreadSanitizer")]


def main(folder):
    every = [report for path in sorted(pathlib.Path(folder).iterdir()) for report in reports_in(path.read_text(errors="replace"))]
    ours = [report for report in every if is_ours(report)]
    if every:
        print(f"{len(every)} reports of ThreadSanitizer, {len(ours)} about our code on both sides")
    for report in ours:
        print(report)
    return 1 if ours else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
