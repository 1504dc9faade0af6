"""What the format's own library in another language makes of a recording, `sightline` still reads.

usage: copies_test.py LANGUAGE TOOL BUILD_FOLDER MAKE_RECORDING SIGHTLINE

LANGUAGE is node, rust or go, and TOOL is its package client: npm, cargo or go. The program in the folder of that name copies
recordings. Each copy must be sound and replay equal. The test is skipped where the library cannot be downloaded."""
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

LANGUAGE, TOOL = sys.argv[1:3]
BUILD, MAKE_RECORDING, SIGHTLINE = (pathlib.Path(word).resolve() for word in sys.argv[3:6])
SOURCE = pathlib.Path(__file__).resolve().parent / LANGUAGE

# The library's own way to fetch, then to build, then to run.
FETCH = {"node": ["ci", "--prefer-offline", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error"],
         "rust": ["fetch", "--locked"],
         "go": ["mod", "download"]}
MAKE = {"node": None, "rust": ["build", "--release", "--locked", "--target-dir", BUILD / "target"],
        "go": ["build", "-mod=readonly", "-buildvcs=false", "-o", BUILD / "copies", "."]}
PROGRAM = {"node": ["node", BUILD / "source" / "copies.mjs"], "rust": [BUILD / "target/release/copies"], "go": [BUILD / "copies"]}
NAMES = {"sorted", "filtered", "zstd", "lz4", "none", "unchunked", "unindexed"}
MAGIC, RECORD_HEAD, SCHEMA = 8, 9, 3  # bytes of the magic and of a record's opcode and length; the opcode of a schema
NOT_WRITTEN = {"node": {"lz4"}}  # what the library cannot write


def run(*command, status=0, **options):
    done = subprocess.run(command, capture_output=True, text=True, **options)
    assert done.returncode == status, (command, done.returncode, done.stdout[-2000:], done.stderr[-2000:])
    return done.stdout


def build():
    source = BUILD / "source"
    shutil.copytree(SOURCE, source, dirs_exist_ok=True, ignore=shutil.ignore_patterns("node_modules", "target"))
    fetched = subprocess.run([TOOL, *FETCH[LANGUAGE]], cwd=source, capture_output=True, text=True)
    if fetched.returncode != 0:
        print("Skipped: the library cannot be downloaded:", fetched.stderr[-500:])
        sys.exit(0)
    if MAKE[LANGUAGE]:
        run(TOOL, *MAKE[LANGUAGE], cwd=source)


def check(path, original):
    """The copy is sound, replays equal, and holds the session and the attachments of the original."""
    told = json.loads(run(SIGHTLINE, "verify", "--json", path))
    assert told["sound"], (path, told)
    replayed = run(SIGHTLINE, "replay", path)
    assert "\nresult      equal\n" in replayed, (path, replayed)
    info = json.loads(run(SIGHTLINE, "info", "--json", path))
    for part in ("session", "game_time"):
        assert info[part] == original[part], (path, part, info[part], original[part])


def records(data):
    """The opcode and the bytes of each record of an MCAP file, from after the magic."""
    at = MAGIC
    while at + RECORD_HEAD <= len(data):
        length = int.from_bytes(data[at + 1:at + RECORD_HEAD], "little")
        yield data[at], data[at:at + RECORD_HEAD + length]
        at += RECORD_HEAD + length


def with_a_schema_twice(unchunked):
    """The file with its first schema written twice in a row, which the official doctor warns of."""
    data = unchunked.read_bytes()
    schema = next(record for opcode, record in records(data) if opcode == SCHEMA)
    twice = unchunked.with_name("schema-twice.mcap")
    twice.write_bytes(data.replace(schema, schema + schema, 1))
    return twice


def examine(recording, unchunked):
    """As strict as `mcap doctor --strict-message-order`, which cannot be had as a package."""
    run(*PROGRAM["go"], "examine", recording)
    run(*PROGRAM["go"], "examine", with_a_schema_twice(unchunked), status=1)


def main():
    build()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        run(MAKE_RECORDING, folder)
        for recording in ("yard", "hall"):
            out = folder / f"copies-of-{recording}"
            out.mkdir()
            names = run(*PROGRAM[LANGUAGE], folder / f"{recording}.mcap", out).split()
            assert set(names) == NAMES - NOT_WRITTEN.get(LANGUAGE, set()), names
            if LANGUAGE == "go":
                examine(folder / f"{recording}.mcap", out / "unchunked.mcap")
            original = json.loads(run(SIGHTLINE, "info", "--json", folder / f"{recording}.mcap"))
            for name in names:
                check(out / f"{name}.mcap", original)
            print(f"{recording}: {len(names)} copies are sound and replay equal: {', '.join(names)}")


main()
