#!/usr/bin/env python3
"""deploy_test.py SIGHTLINED PYTHON_FOLDER DEPLOY_FOLDER: dashboard, alerts and unit file and Dockerfile, beside what the daemon exports and what the tools of
Prometheus and systemd say. What needs a tool that is not installed is skipped."""
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.parse
import urllib.request

SIGHTLINED, PYTHON_FOLDER, DEPLOY = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
TESTS = pathlib.Path(__file__).parents[1]
sys.path[:0] = [PYTHON_FOLDER, str(TESTS / "attack"), str(TESTS / "metrics")]

from daemon import Daemon  # noqa: E402
from exposition import scrape  # noqa: E402
from observed_daemon import start  # noqa: E402
from sightline_client import Camera, box, capsule  # noqa: E402

Daemon.path = SIGHTLINED
AFTER_DRAIN_S = 5  # as in manifests/manifests_test.go
# Labels that Prometheus adds, and those of its own metrics.
ADDED_LABELS, ADDED_METRICS = {"instance", "job"}, {"up", "ALERTS"}


def needs(tool):
    return unittest.skipUnless(shutil.which(tool), f"{tool} is not installed")


def run(*command, **more):
    return subprocess.run(command, capture_output=True, text=True, timeout=120, **more)


def camera(daemon):
    return Camera(daemon.address, position=(0, 1.6, 6), targets={1: capsule(radius=0.3, height=1.8)}, occluders={3: box(1, 4, 1)},
                  at={1: (-1, 0.9, 0), 3: (0, 2, 2)})


def dashboard():
    return json.loads((DEPLOY / "grafana/sightline.json").read_text())


def dashboard_queries():
    """(title, query), with what Grafana puts in for its variables."""
    for panel in dashboard()["panels"]:
        for target in panel["targets"]:
            yield panel["title"], target["expr"].replace("$__rate_interval", "10s").replace("$instance", ".*")


def alert_queries():
    text = (DEPLOY / "prometheus/alerts.yml").read_text()
    return re.findall(r"- alert: (\w+)\n\s+expr: (.*)\n", text)


def selectors(query):
    """(metric, [(label, operator, value)]) of every selector of a query."""
    for name, labels in re.findall(r"\b((?:sightline|process|up|ALERTS)\w*)(?:\{([^}]*)\})?", query):
        yield name, re.findall(r'(\w+)\s*(=~|!~|!=|=)\s*"([^"]*)"', labels or "")


class Queries(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        with start() as daemon:
            cls.values = {}  # metric -> label -> values
            for family in scrape(daemon.operators).values():
                for name, labels in family.samples:
                    known = cls.values.setdefault(name, {})
                    for label, value in labels:
                        known.setdefault(label, set()).add(value)

    def check(self, where, query):
        found = list(selectors(query))
        self.assertTrue(found, where)
        for name, labels in found:
            if name in ADDED_METRICS:
                continue
            self.assertIn(name, self.values, where)
            for label, operator, value in labels:
                if label in ADDED_LABELS:
                    continue
                self.assertIn(label, self.values[name], where)
                if operator in ("=", "!="):
                    self.assertIn(value, self.values[name][label], where)

    def test_the_dashboard_and_the_alerts_ask_for_what_is_exported(self):
        for where, query in (*dashboard_queries(), *alert_queries()):
            with self.subTest(where):
                self.check(where, query)

    def test_grouping_is_by_labels_that_are_exported(self):
        for where, query in (*dashboard_queries(), *alert_queries()):
            for labels in re.findall(r"\b(?:by|without|ignoring|on)\s*\(([^)]*)\)", query):
                known = {label for name, _ in selectors(query) for label in self.values.get(name, ())} | ADDED_LABELS
                for label in labels.replace(" ", "").split(","):
                    self.assertIn(label, known, f"{where}: {query}")

    def test_a_metric_a_label_and_a_value_that_do_not_exist_are_noticed(self):
        for query in ("rate(sightline_steps[5m])", 'sightline_steps_total{stage="move"}', 'sightline_ticks_total{outcome="lost"}'):
            with self.assertRaises(AssertionError):
                self.check("planted", query)

    def test_the_metrics_page_lists_every_family_and_no_other(self):
        listed = set(re.findall(r"^\| `((?:sightline|process)_\w+)`", (DEPLOY / "METRICS.md").read_text(), re.M))
        exported = {re.sub(r"_(bucket|sum|count)$", "", name) if name.endswith(("_bucket", "_sum", "_count")) else name for name in self.values}
        self.assertEqual(listed, exported)

    def test_every_alert_has_an_entry_in_the_troubleshooting_page(self):
        page = (DEPLOY / "TROUBLESHOOTING.md").read_text()
        for name, _ in alert_queries():
            self.assertIn(f"`{name}`", page)


class PrometheusTools(unittest.TestCase):
    @needs("promtool")
    def test_the_rules_are_valid_silent_for_a_healthy_daemon_and_each_fires_on_its_own_data(self):
        for command in (("check", "rules", "alerts.yml"), ("check", "config", "prometheus.yml"), ("test", "rules", "alerts_test.yml")):
            result = run("promtool", *command, cwd=DEPLOY / "prometheus")
            self.assertEqual(result.returncode, 0, result.stdout + result.stderr)

    def test_the_rule_tests_say_for_every_alert_on_which_data_it_fires(self):
        told = re.findall(r'alertname="(\w+)", instance="[\w-]+"', (DEPLOY / "prometheus/alerts_test.yml").read_text())
        self.assertEqual(told, [name for name, _ in alert_queries()])

    @needs("promtool")
    def test_the_rule_tests_notice_alerts_that_have_each_others_queries_and_one_that_never_fires(self):
        rules = (DEPLOY / "prometheus/alerts.yml").read_text()
        queries = [query for _, query in alert_queries()]
        rotated = iter(queries[1:] + queries[:1])
        planted = [re.sub(r"expr: .*", lambda _: "expr: " + next(rotated), rules),
                   rules.replace(queries[-1], queries[-1] + " and vector(1) < 0")]
        with tempfile.TemporaryDirectory() as folder:
            shutil.copy(DEPLOY / "prometheus/alerts_test.yml", folder)
            for text in planted:
                pathlib.Path(folder, "alerts.yml").write_text(text)
                result = run("promtool", "test", "rules", "alerts_test.yml", cwd=folder)
                self.assertEqual(result.returncode, 1, result.stdout + result.stderr)

    @needs("prometheus")
    def test_every_query_of_the_dashboard_finds_data_in_a_real_prometheus(self):
        with tempfile.TemporaryDirectory() as folder, start("--record-dir", folder + "/recordings", "--record-reserve-mib", "0") as daemon:
            pathlib.Path(folder, "prometheus.yml").write_text(
                "global: {scrape_interval: 1s}\nscrape_configs:\n"
                f"  - {{job_name: sightline, static_configs: [{{targets: ['{daemon.operators}']}}]}}\n")
            with open(folder + "/log", "w") as log, Prometheus(folder, log) as prometheus, camera(daemon) as one:
                prometheus.wait_until_ready()
                missing = dict(enumerate(dashboard_queries()))
                end = time.monotonic() + 60
                time_s = 0.0
                while missing and time.monotonic() < end:
                    for _ in range(30):
                        time_s += 1 / 60
                        one.tick(time_s, {})
                    time.sleep(0.5)
                    missing = {i: pair for i, pair in missing.items() if not prometheus.has_data(pair[1])}
                self.assertEqual(list(missing.values()), [])


class Prometheus:
    def __init__(self, folder, log):
        import socket
        with socket.socket() as one:
            one.bind(("127.0.0.1", 0))
            self.address = f"127.0.0.1:{one.getsockname()[1]}"
        self.process = subprocess.Popen(["prometheus", f"--config.file={folder}/prometheus.yml", f"--storage.tsdb.path={folder}/data",
                                         f"--web.listen-address={self.address}"], stdout=log, stderr=log)

    def ask(self, path):
        with urllib.request.urlopen(f"http://{self.address}{path}", timeout=10) as answer:
            return answer.read()

    def wait_until_ready(self):
        for _ in range(600):
            try:
                return self.ask("/-/ready")
            except OSError:
                time.sleep(0.1)
        raise AssertionError("Prometheus did not start")

    def has_data(self, query):
        """Whether the query gives numbers. An empty histogram gives NaN, which is no number."""
        answer = json.loads(self.ask("/api/v1/query?query=" + urllib.parse.quote(query)))
        return any(sample["value"][1] != "NaN" for sample in answer["data"]["result"])

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait()


class Unit(unittest.TestCase):
    TEXT = (DEPLOY / "systemd/sightlined.service").read_text()

    def setting(self, name):
        return re.search(rf"^{name}=(.*)$", self.TEXT, re.M).group(1)

    def default(self, flag):
        return float(re.search(rf'^{flag}\s*=\s*"?([0-9.]+)', run(SIGHTLINED, "--print-config").stdout, re.M).group(1))

    def test_it_is_killed_later_than_the_drain_takes(self):
        self.assertNotIn("--drain-s", self.setting("ExecStart"))
        self.assertGreaterEqual(float(self.setting("TimeoutStopSec")), self.default("drain-s") + AFTER_DRAIN_S)

    def test_its_flags_are_flags_of_the_daemon(self):
        result = run(SIGHTLINED, *self.setting("ExecStart").split()[1:], "--check-config")
        self.assertEqual(result.returncode, 0, result.stderr)

    @needs("systemd-analyze")
    def test_systemd_finds_no_mistake(self):
        with tempfile.TemporaryDirectory() as folder:
            unit = pathlib.Path(folder, "sightlined.service")
            unit.write_text(self.TEXT.replace("/usr/bin/sightlined", SIGHTLINED))
            result = run("systemd-analyze", "verify", str(unit))
            self.assertEqual((result.returncode, result.stdout, result.stderr), (0, "", ""))
            unit.write_text(unit.read_text().replace("WatchdogSec", "WatchdogSeconds"))
            self.assertIn("WatchdogSeconds", run("systemd-analyze", "verify", str(unit)).stderr)

    def test_systemd_is_told_of_start_life_and_end(self):
        import os
        import socket
        with tempfile.TemporaryDirectory() as folder:
            manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            manager.bind(folder + "/notify")
            manager.settimeout(30)
            os.environ["NOTIFY_SOCKET"] = folder + "/notify"
            try:
                with Daemon() as daemon:
                    told = {manager.recv(4096).decode() for _ in range(3)}
                    self.assertEqual(told, {"READY=1", "WATCHDOG=1"})
                    daemon.stop()
                    while "STOPPING=1" not in told:
                        told.add(manager.recv(4096).decode())
            finally:
                del os.environ["NOTIFY_SOCKET"]
                manager.close()


class Dockerfile(unittest.TestCase):
    def test_all_stages_start_from_the_base_or_from_one_another(self):
        text = (DEPLOY.parent / "Dockerfile").read_text()
        (base,) = re.findall(r"^ARG BASE=(\S+)$", text, re.M)
        self.assertRegex(base, r"^debian:bookworm-slim(@sha256:[0-9a-f]{64})?$")
        stages = re.findall(r"^FROM (\S+) AS (\S+)$", text, re.M)
        self.assertEqual(len(stages), len(re.findall(r"^FROM ", text, re.M)))
        for i, (start, name) in enumerate(stages):
            self.assertIn(start, ["${BASE}", *(earlier for _, earlier in stages[:i])], name)
        self.assertEqual(stages[-1][1], "cpu", "the image that is built when none is named")

    def test_each_image_has_its_own_bill_of_materials(self):
        text = (DEPLOY.parent / "Dockerfile").read_text()
        parts = dict(re.findall(r"^FROM \S+ AS (\S+)\n(.*?)(?=^FROM |\Z)", text, re.M | re.S))
        for image in ("cpu", "gpu"):
            self.assertIn(f"COPY --from={image}-sbom /build/sbom.spdx.json /usr/share/doc/sightline/", parts[image])
            self.assertEqual(set(re.findall(r"COPY --from=(\S+)", parts[f"{image}-sbom"])), {f"{image}-system"})
            self.assertIn(f"--root /image --name sightline-{image}", parts[f"{image}-sbom"])


if __name__ == "__main__":
    sys.argv[1:] = sys.argv[4:]
    unittest.main(verbosity=2)
