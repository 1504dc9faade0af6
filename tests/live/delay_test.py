#!/usr/bin/env python3
"""How near each client's PoseSampler comes to a camera without delay: delay_test.py SIGHTLINED STUBS PAGE NAME=COMMAND... [--write]

PAGE: the document with the table, which must be up to date; --write brings the rows of these clients up to date.
"""
import math
import pathlib
import re
import sys
import unittest

HERE = pathlib.Path(__file__).parent
SIGHTLINED, STUBS, PAGE, *COMMANDS = (argument for argument in sys.argv[1:] if argument != "--write")
sys.path[:0] = [STUBS, str(HERE.parent / "conformance")]

from daemon import Daemon  # noqa: E402
from game import ANNA  # noqa: E402
from google.protobuf import json_format  # noqa: E402
from players import Player, commands_of  # noqa: E402
from runs import Ideal, line_place, places, play, rotation, xyz  # noqa: E402
from sightline_client import PoseSampler  # noqa: E402

PLAYERS = commands_of(COMMANDS)
DELAYS_MS = (0, 50, 100)
PICTURES_HZ = 144
AS_IT_IS, RELATIVE = "newest pose as it is", "newest `unrotated_pose` alone"
BEGIN, END = "<!-- delays: written by tests/live/delay_test.py --write -->\n", "<!-- end of delays -->\n"
HEADER = ["144 pictures a second, 60 replies", *(f"{delay} ms late" for delay in DELAYS_MS)]


class AsItIs:
    def add(self, reply):
        self.newest = reply

    def sample(self, time_s, target):
        return xyz(self.newest.pose.position), rotation(self.newest)


class Relative(AsItIs):
    def sample(self, time_s, target):
        return [a + b for a, b in zip(target, xyz(self.newest.relative_pose.unrotated_pose.position))], rotation(self.newest)


class Played:
    """The sampler of a client."""

    def __init__(self, player):
        self.player = player
        player.run({"sampler_new": {}})

    def add(self, reply):
        self.player.run({"sampler_add": json_format.MessageToDict(reply)})

    def sample(self, time_s, target):
        values = self.player.run({"sampler_at": {"time_s": time_s, "target": target}})["sample"]
        return values[:3], values[3:7]


def figures(way, replies, delay_s):
    """Mean error in metres; mean and 95th percentile in lines of the picture at the worse target; 95th percentile of the shake in lines."""
    ideal, waiting = Ideal(replies), list(replies)
    metres, lines, shakes, before = [], [], [], None
    for picture in range(round(PICTURES_HZ * (replies[-1].time_s - 0.1))):
        time_s = picture / PICTURES_HZ
        while waiting and waiting[0].time_s + delay_s <= time_s:
            way.add(waiting.pop(0))
        if time_s < 1.0:
            continue
        now = places(time_s)
        shown, best = way.sample(time_s, now[ANNA]), ideal.at(time_s)
        errors = [[a - b for a, b in zip(line_place(*shown, point), line_place(*best, point))] for point in now.values()]
        metres.append(math.dist(shown[0], best[0]))
        lines.append(max(math.hypot(*error) for error in errors))
        if before:
            shakes.append(max(math.dist(a, b) for a, b in zip(errors, before)))
        before = errors
    return mean(metres), mean(lines), p95(lines), p95(shakes)


def mean(values):
    return sum(values) / len(values)


def p95(values):
    return sorted(values)[len(values) * 95 // 100]


def cell(metres, lines, worst, shake):
    return f"{metres:.3f} m; {lines:.1f}, {worst:.1f}; {shake:.1f} lines"


def numbers(text):
    return [float(number) for number in re.findall(r"\d+\.\d+", text)]


def rows_of(text):
    rows = [[part.strip() for part in line.strip("| \n").split("|")] for line in text.splitlines() if line.startswith("|")]
    return {row[0]: row[1:] for row in rows[2:]}


class Delays(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with Daemon(SIGHTLINED) as daemon:
            cls.replies, cls.in_unity = play(daemon.address), play(daemon.address, unity=True)
        cls.rows = {AS_IT_IS: [figures(AsItIs(), cls.replies, delay / 1e3) for delay in DELAYS_MS],
                    RELATIVE: [figures(Relative(), cls.replies, delay / 1e3) for delay in DELAYS_MS]}
        for name, command in PLAYERS.items():
            player = Player(name, command)
            label = f"`PoseSampler`, {name.removesuffix(':base64')}"
            cls.rows[label] = [figures(Played(player), cls.replies, delay / 1e3) for delay in DELAYS_MS]
            player.close()

    def test_a_sampler_is_far_better_than_the_newest_pose(self):
        for label, row in self.rows.items():
            if label in (AS_IT_IS, RELATIVE):
                continue
            for (metres, lines, _, shake), as_it_is, relative in zip(row, self.rows[AS_IT_IS], self.rows[RELATIVE]):
                self.assertLess(metres, as_it_is[0] / 5, label)
                self.assertLess(lines, relative[1] / 2, label)
                self.assertLess(shake, relative[3] / 2, label)

    def test_velocities_and_turns_lead_to_the_next_replies_in_both_handednesses(self):
        for replies in (self.replies, self.in_unity):
            guessed, held = [], []
            for now, later in list(zip(replies, replies[3:]))[60:]:
                sampler = PoseSampler()
                sampler.add(now)
                shown = sampler.sample(later.time_s)
                guessed.append((math.dist(shown.position, xyz(later.pose.position)), self.angle(shown.rotation, rotation(later))))
                held.append((math.dist(xyz(now.pose.position), xyz(later.pose.position)), self.angle(rotation(now), rotation(later))))
            for kind in (0, 1):
                self.assertLess(mean([error[kind] for error in guessed]), mean([error[kind] for error in held]) / 5)

    @staticmethod
    def angle(p, q):
        return 2 * math.acos(min(abs(sum(a * b for a, b in zip(p, q))), 1.0))

    def test_the_page_shows_these_figures(self):
        path = pathlib.Path(PAGE)
        text = path.read_text()
        found = re.search(re.escape(BEGIN) + "(.*)" + re.escape(END), text, re.S)
        self.assertTrue(found, f"{PAGE} has no place for the table")
        shown = rows_of(found.group(1))
        made = {label: [cell(*values) for values in row] for label, row in self.rows.items()}
        if "--write" in sys.argv:
            lines = [HEADER, ["---"] * len(HEADER), *([label, *cells] for label, cells in (shown | made).items())]
            table = "".join(f"| {' | '.join(line)} |\n" for line in lines)
            path.write_text(f"{text[:found.start()]}{BEGIN}\n{table}\n{END}{text[found.end():]}")
            return
        for label, cells in made.items():
            self.assertIn(label, shown, "run this test with --write")
            for here, there in zip(cells, shown[label], strict=True):  # the last bits of a step depend on the processor
                for value, on_page in zip(numbers(here), numbers(there), strict=True):
                    self.assertAlmostEqual(value, on_page, delta=max(0.2 * value, 0.005 if value < 0.1 else 0.2), msg=f"{label}: {here}")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
