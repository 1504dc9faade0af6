#!/usr/bin/env python3
"""Every client's PoseSampler gives what the vectors say: sampler_test.py STUBS NAME=COMMAND..."""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, sys.argv[1])
from players import Player, commands_of  # noqa: E402

PLAYERS = commands_of(sys.argv[2:])
VECTORS = json.loads((HERE / "vectors.json").read_text())
TOLERANCE = 1e-9


def error(got, expected):
    """The greatest difference. A rotation equals its negative."""
    sign = 1 if sum(a * b for a, b in zip(got[3:7], expected[3:7])) > 0 else -1
    return max(abs(a - b) for a, b in zip([*got[:3], *(sign * value for value in got[3:7]), got[7]], expected))


class Vectors(unittest.TestCase):
    def test_every_client_gives_what_the_vectors_say(self):
        for name, command in PLAYERS.items():
            player = Player(name, command)
            for story in VECTORS:
                with self.subTest(client=name, story=story["name"]):
                    player.run({"sampler_new": {}})
                    self.play(player, story["steps"])
            player.close()

    def play(self, player, steps):
        for step in steps:
            if "add" in step:
                self.assertEqual(step["taken"], player.run({"sampler_add": step["add"]})["taken"], step)
                continue
            if "shift" in step:
                player.run({"sampler_shift": step["shift"]})
                continue
            got = player.run({"sampler_at": {"time_s": step["at"], "target": step["target"] or []}})["sample"]
            if step["expect"] is None or got is None:
                self.assertEqual(step["expect"], got, step)
            else:
                self.assertEqual(step["expect"][8], bool(got[8]), step)
                self.assertLess(error(got, step["expect"]), TOLERANCE, (step, got))

    def test_the_vectors_are_what_the_generator_writes(self):
        with tempfile.NamedTemporaryFile() as made:
            subprocess.run([sys.executable, HERE / "make_vectors.py", made.name], check=True)
            self.assertEqual(json.loads(pathlib.Path(made.name).read_text()), VECTORS)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
