"""The table of clients and sessions in client/README.md, made from the results of the test."""
import pathlib
import re

BEGIN, END = "<!-- conformance: written by tests/conformance/conformance_test.py --write -->\n", "<!-- end of conformance -->\n"
COLUMNS = {"convention_gltf": "glTF", "convention_godot": "Godot", "convention_unity": "Unity", "convention_unreal": "Unreal", "convention_ros": "ROS",
           "convention_custom": "custom", "numbers": "64-bit numbers", "errors": "errors", "settings": "settings", "resync": "lost daemons", "resume": "broken streams"}


def rows_of(text):
    """The rows of a table by their first cell, without it."""
    rows = [[cell.strip() for cell in line.strip("|\n ").split("|")] for line in text.splitlines() if line.startswith("|")]
    return {row[0]: row[1:] for row in rows[2:]}


def check(readme, results, sessions, write):
    """Compares the rows of the clients that played with the committed ones. write: replaces them, and keeps the others."""
    path = pathlib.Path(readme)
    text = path.read_text()
    found = re.search(re.escape(BEGIN) + "(.*)" + re.escape(END), text, re.S)
    assert found, f"{readme} has no place for the table"
    assert sorted(COLUMNS) == sorted(sessions), "each session has a column"
    kept = rows_of(found.group(1))
    made = {client: ["yes" if played[name] else "**no**" for name in COLUMNS] for client, played in results.items()}
    if write:
        lines = [["client", *COLUMNS.values()], ["---"] * (len(COLUMNS) + 1), *([name, *cells] for name, cells in {**kept, **made}.items())]
        table = "".join(f"| {' | '.join(line)} |\n" for line in lines)
        path.write_text(text[:found.start()] + BEGIN + "\n" + table + "\n" + END + text[found.end():])
    else:
        for client, cells in made.items():
            assert kept.get(client) == cells, f"{readme}: the row of {client} should be {cells}; run this test with --write"
