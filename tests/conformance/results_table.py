"""The table of clients and sessions in client/README.md, made from the results of the test."""
import datetime
import pathlib
import re
import subprocess

BEGIN, END = "<!-- conformance: written by tests/conformance/conformance_test.py --write -->\n", "<!-- end of conformance -->\n"
EVERY_RUN = "every test run"
COLUMNS = {"convention_gltf": "glTF", "convention_godot": "Godot", "convention_unity": "Unity", "convention_unreal": "Unreal", "convention_ros": "ROS",
           "convention_custom": "custom", "numbers": "64-bit numbers", "errors": "errors", "settings": "settings", "body": "bodies of parts", "resync": "lost daemons",
           "resume": "broken streams", "shift": "moved origins"}


def rows_of(text):
    """The rows of a table by their first cell, without it."""
    rows = [[cell.strip() for cell in line.strip("|\n ").split("|")] for line in text.splitlines() if line.startswith("|")]
    return {row[0]: row[1:] for row in rows[2:]}


def stamp(folder):
    """The commit that is tested, and today. Changes that are not committed show as "-dirty"."""
    commit = subprocess.run(["git", "describe", "--always", "--dirty", "--exclude=*"], cwd=folder, capture_output=True, text=True, check=True).stdout.strip()
    return f"{commit}, {datetime.date.today()}"


def check(readme, results, sessions, write, slow):
    """Compares the rows of the clients that played with the committed ones. write: replaces them, and keeps the others. slow: the clients do not play in
    every test run, so their rows say when they played last."""
    path = pathlib.Path(readme)
    text = path.read_text()
    found = re.search(re.escape(BEGIN) + "(.*)" + re.escape(END), text, re.S)
    assert found, f"{readme} has no place for the table"
    assert sorted(COLUMNS) == sorted(sessions), "each session has a column"
    kept = rows_of(found.group(1))
    made = {client: ["yes" if played[name] else "**no**" for name in COLUMNS] for client, played in results.items()}
    if write:
        last = stamp(path.parent) if slow else EVERY_RUN
        rows = kept | {client: [*cells, last] for client, cells in made.items()}
        lines = [["client", *COLUMNS.values(), "played last"], ["---"] * (len(COLUMNS) + 2), *([name, *cells] for name, cells in rows.items())]
        table = "".join(f"| {' | '.join(line)} |\n" for line in lines)
        path.write_text(text[:found.start()] + BEGIN + "\n" + table + "\n" + END + text[found.end():])
    else:
        for client, cells in made.items():
            assert kept.get(client, [])[:-1] == cells, f"{readme}: the row of {client} should be {cells}; run this test with --write"
