"""Three daemons behind HAProxy, as deploy/haproxy/haproxy.cfg sets it up, at ports that are free."""
import contextlib
import pathlib
import re
import socket
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).parent
sys.path.append(str(HERE.parent / "metrics"))

from exposition import scrape, value  # noqa: E402

CONFIG = HERE.parents[1] / "deploy/haproxy/haproxy.cfg"


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


class ThreeDaemons(contextlib.ExitStack):
    """`start(*flags)` gives a daemon: a context manager with `address` and `process`. `address` is that of the proxy."""

    def __init__(self, start):
        super().__init__()
        self.daemons, self.operators = [], []
        config = CONFIG.read_text()
        for i in range(3):
            metrics = free_port()
            daemon = self.enter_context(start("--metrics-listen", f"127.0.0.1:{metrics}"))
            self.daemons.append(daemon)
            self.operators.append(f"127.0.0.1:{metrics}")
            config = config.replace(f"127.0.0.1:5016{i + 1} port 5017{i + 1}", f"{daemon.address} port {metrics}")
        port = free_port()
        config = config.replace("127.0.0.1:50150", f"127.0.0.1:{port}")
        assert not re.search(r"\b501[567]\d\b", config), "every port of the file was replaced"
        file = pathlib.Path(self.enter_context(tempfile.TemporaryDirectory()), "haproxy.cfg")
        file.write_text(config)
        proxy = subprocess.Popen(["haproxy", "-f", str(file)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.callback(proxy.wait)
        self.callback(proxy.terminate)
        self.address = f"127.0.0.1:{port}"
        wait_for_listener(port)

    def wait_until_moved(self, sessions):
        """Waits until the second and the third daemon have this many sessions."""
        deadline = time.monotonic() + 30
        while self.sessions_of(1) + self.sessions_of(2) < sessions and time.monotonic() < deadline:
            time.sleep(0.05)

    def sessions_of(self, i):
        return value(scrape(self.operators[i]), "sightline_sessions_open")
