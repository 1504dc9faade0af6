#!/usr/bin/env python3
"""haproxy_test.py SIGHTLINED PYTHON_FOLDER DEPLOY_FOLDER: nine sessions on three daemons behind HAProxy, as deploy/haproxy/haproxy.cfg sets it up. One daemon
is killed: its sessions go on elsewhere, and the others do not notice. Prints how long the gaps were."""
import json
import os
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import unittest

SIGHTLINED, PYTHON_FOLDER, DEPLOY = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
HERE = pathlib.Path(__file__).parent
sys.path[:0] = [PYTHON_FOLDER, str(HERE.parent / "attack"), str(HERE.parent / "metrics")]

from daemon import Daemon  # noqa: E402
from exposition import scrape, value  # noqa: E402

Daemon.path = SIGHTLINED
SESSIONS = 9
# What a camera at the default limits can do between two ticks is far less; a jump to where a new session starts is more.
FARTHEST_STEP_M = 1.0


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def wait_for_listener(port):
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline:
        try:
            return socket.create_connection(("127.0.0.1", port), timeout=1).close()
        except ConnectionRefusedError:
            time.sleep(0.05)
    raise AssertionError("HAProxy does not listen")


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
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.daemons, self.operators = [], []
        config = (DEPLOY / "haproxy/haproxy.cfg").read_text()
        for i in range(3):
            metrics = free_port()
            daemon = Daemon("--metrics-listen", f"127.0.0.1:{metrics}")
            self.addCleanup(daemon.__exit__)
            self.daemons.append(daemon)
            self.operators.append(f"127.0.0.1:{metrics}")
            config = config.replace(f"127.0.0.1:5016{i + 1} port 5017{i + 1}", f"{daemon.address} port {metrics}")
        port = free_port()
        config = config.replace("127.0.0.1:50150", f"127.0.0.1:{port}")
        self.assertFalse(re.search(r"\b501[567]\d\b", config), "every port of the file was replaced")
        file = pathlib.Path(self.folder.name, "haproxy.cfg")
        file.write_text(config)
        self.proxy = subprocess.Popen(["haproxy", "-f", str(file)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(self.proxy.wait)
        self.addCleanup(self.proxy.terminate)
        self.address = f"127.0.0.1:{port}"
        wait_for_listener(port)

    def sessions_of(self, i):
        return value(scrape(self.operators[i]), "sightline_sessions_open")

    def test_a_daemon_that_is_killed_loses_no_session(self):
        games = [Game(self.address) for _ in range(SESSIONS)]
        before = [self.sessions_of(i) for i in range(3)]
        self.assertEqual(before, [3, 3, 3], "connections are spread evenly")
        time.sleep(1)
        self.daemons[0].process.kill()
        deadline = time.monotonic() + 30
        while self.sessions_of(1) + self.sessions_of(2) < SESSIONS and time.monotonic() < deadline:
            time.sleep(0.05)
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
    sys.argv[1:] = sys.argv[4:]
    unittest.main(verbosity=2)
