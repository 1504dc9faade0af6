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
        with contextlib.ExitStack() as begun:  # ends what has begun if anything here fails
            ports = {}  # by the port in the file
            for i in range(3):
                metrics = free_port()
                daemon = begun.enter_context(start("--metrics-listen", f"127.0.0.1:{metrics}"))
                self.daemons.append(daemon)
                self.operators.append(f"127.0.0.1:{metrics}")
                ports |= {f"5016{i + 1}": daemon.address.rsplit(":", 1)[1], f"5017{i + 1}": str(metrics)}
            ports["50150"] = str(free_port())
            file = pathlib.Path(begun.enter_context(tempfile.TemporaryDirectory()), "haproxy.cfg")
            # All ports at once: a free port may be one of those that the file names.
            file.write_text(re.sub(r"\b501[567]\d\b", lambda named: ports[named[0]], CONFIG.read_text()))
            proxy = subprocess.Popen(["haproxy", "-f", str(file)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            begun.callback(proxy.wait)
            begun.callback(proxy.terminate)
            self.address = f"127.0.0.1:{ports['50150']}"
            wait_for_listener(ports["50150"])
            self.push(begun.pop_all())

    def wait_until_moved(self, sessions):
        """Waits until the second and the third daemon have this many sessions."""
        deadline = time.monotonic() + 30
        while self.sessions_of(1) + self.sessions_of(2) < sessions and time.monotonic() < deadline:
            time.sleep(0.05)

    def sessions_of(self, i):
        return value(scrape(self.operators[i]), "sightline_sessions_open")
