#!/usr/bin/env python3
"""haproxy_test.py SIGHTLINED PYTHON_FOLDER: nine sessions on three daemons behind HAProxy, as deploy/haproxy/haproxy.cfg sets it up. One daemon
is killed: its sessions go on elsewhere, and the others do not notice. Prints how long the gaps were."""
import json
import os
import pathlib
import shutil
import subprocess
import sys
import time
import unittest

SIGHTLINED, PYTHON_FOLDER = sys.argv[1:3]
HERE = pathlib.Path(__file__).parent
sys.path[:0] = [PYTHON_FOLDER, str(HERE.parent / "attack")]

from daemon import Daemon  # noqa: E402
from three_daemons import ThreeDaemons  # noqa: E402

Daemon.path = SIGHTLINED
SESSIONS = 9
# A camera at the default limits moves far less between two ticks. A jump to where a new session starts is longer.
FARTHEST_STEP_M = 1.0


class Game:
    def __init__(self, address):
        self.process = subprocess.Popen([sys.executable, str(HERE / "proxied_session.py"), address], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                        text=True, env={**os.environ, "PYTHONPATH": PYTHON_FOLDER})
        assert self.process.stdout.readline().strip() == "opened"

    def result(self):
        out, _ = self.process.communicate("", timeout=60)
        return json.loads(out)


@unittest.skipUnless(shutil.which("haproxy"), "haproxy is not installed")
class Proxy(unittest.TestCase):
    def test_a_daemon_that_is_killed_loses_no_session(self):
        three = self.enterContext(ThreeDaemons(Daemon))
        games = [Game(three.address) for _ in range(SESSIONS)]
        before = [three.sessions_of(i) for i in range(3)]
        self.assertEqual(before, [3, 3, 3], "connections are spread evenly")
        time.sleep(1)
        three.daemons[0].process.kill()
        three.wait_until_moved(SESSIONS)
        time.sleep(1)
        results = [game.result() for game in games]
        moved = [result for result in results if result["resyncs"] > 0]
        stayed = [result for result in results if result["resyncs"] == 0]
        print(f"\n{len(moved)} sessions moved, longest gap {max(r['longest_gap_s'] for r in moved):.3f} s; {len(stayed)} stayed, longest gap "
              f"{max(r['longest_gap_s'] for r in stayed):.3f} s; largest step of a camera {max(r['largest_step_m'] for r in results):.3f} m")
        self.assertEqual((len(moved), len(stayed)), (3, 6))
        for result in results:
            self.assertLess(result["largest_step_m"], FARTHEST_STEP_M)


if __name__ == "__main__":
    sys.argv[1:] = sys.argv[3:]
    unittest.main(verbosity=2)
