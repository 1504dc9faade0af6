"""A real daemon under all kinds of work for a short time: short_load.py SIGHTLINED SOAK_CLIENT SECONDS.

Sessions at 60 Hz come and go, change their scenes, upload files, break and are resumed (soak_client.cpp), and all are recorded. Meanwhile the metrics
port is read, the health service is asked, and SIGHUP has the configuration read again. SIGTERM comes while the sessions play. The exit status is 0
when all of that happened, nothing failed and the daemon ended with 0. It asserts no times, so that it also judges a daemon under a sanitizer, whose
reports are read by tests/sanitizers.sh.
"""
import json
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).parents[1] / "attack"))
from daemon import Daemon  # noqa: E402
from probing import operators_of, probe  # noqa: E402

SESSIONS, LIFE_S, PATIENCE_S = 6, 4, 120
PAGES = ("/livez", "/readyz", "/metrics")


def keep_busy(daemon, seconds, failures):
    """Asks the daemon what operators ask it. Returns how often the configuration was read again."""
    operators, end, rounds = operators_of(daemon), time.monotonic() + seconds, 0
    while time.monotonic() < end and daemon.process.poll() is None:
        for page in PAGES:
            status, text = probe(operators, page, PATIENCE_S)
            if status != 200:
                failures.append(f"{page} answered {status}: {text}")
        if rounds % 4 == 0:
            health = subprocess.run([Daemon.path, "healthcheck", "--address", daemon.address], capture_output=True, text=True)
            # A daemon that is ten times slower than usual may answer after the time for which the command waits.
            if health.returncode != 0 and "not known" not in health.stderr:
                failures.append(f"healthcheck: {health.stderr}")
        daemon.process.send_signal(signal.SIGHUP)
        rounds += 1
        time.sleep(1)
    return daemon.log().count("configuration read again")


def counts_of(lines):
    windows = [json.loads(line) for line in lines]
    counts = {key: sum(window[key] for window in windows) for key in ("answered", "opened", "cut", "resumed", "uploads")}
    return counts, [error for window in windows for error in window["errors"]]


def main(sightlined, client, seconds):
    Daemon.path = sightlined
    failures = []
    with tempfile.TemporaryDirectory() as folder:
        config = pathlib.Path(folder, "sightline.conf")
        config.write_text("log-level = info\n")
        recordings = pathlib.Path(folder, "recordings")
        with Daemon("--config", str(config), "--metrics-listen", "127.0.0.1:0", "--record-dir", str(recordings)) as daemon:
            clients = subprocess.Popen([client, daemon.address, str(int(seconds) + PATIENCE_S), str(SESSIONS), str(LIFE_S)], stdout=subprocess.PIPE, text=True)
            try:
                read_again = keep_busy(daemon, float(seconds), failures)
                code = daemon.stop(PATIENCE_S)
                counts, errors = counts_of(clients.communicate(timeout=PATIENCE_S)[0].splitlines())
            finally:
                clients.kill()
            ended = [path.read_bytes().endswith(b"\x89MCAP0\r\n") for path in recordings.glob("*.mcap")]
            log = daemon.log()
    counts.update(read_again=read_again, recordings=len(ended))
    print(", ".join(f"{count} {name.replace('_', ' ')}" for name, count in counts.items()))
    failures += errors + [f"nothing was {name.replace('_', ' ')}" for name, count in counts.items() if count == 0]
    if code != 0:
        failures.append(f"the daemon ended with {code}")
    if not all(ended):
        failures.append(f"{ended.count(False)} recordings have no end")
    if failures:
        print(log[-4000:], "FAILED", *failures[:20], sep="\n")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:4]))
