"""Attacks on what a daemon's keeper asks it: probes at the metrics port, and the order to stop."""
import contextlib
import functools
import signal
import subprocess
import threading
import time

import attacks
import grpc
from attacks import Attack, until_end
from daemon import CONTROL, Daemon
from probing import HeldPort, operators_of, probe
from shifted_clock import ShiftedClock

METRICS = ("--metrics-listen", "127.0.0.1:0")


def probed(operators, seconds):
    """Asks for /livez twenty times a second; returns how often, how often the answer was 200, and the longest wait."""
    waits, well = [], 0

    def ask():
        nonlocal well
        begin = time.monotonic()
        well += probe(operators)[0] == 200
        waits.append(time.monotonic() - begin)
        time.sleep(0.05)
    until_end(seconds, ask)
    return f"/livez 200 in {well} of {len(waits)}, after {max(waits) * 1e3:.0f} ms at most"


def hold(behave, count, anywhere, daemon):
    operators = operators_of(daemon)
    with HeldPort(operators, behave, count, anywhere) as held:
        told = probed(operators, attacks.ATTACK_S)
    return f"{told}; {held.made} connections"


def end_of_unopened(address, seconds):
    """How long a call may be open without a message, at most `seconds`."""
    begin, stopping = time.monotonic(), threading.Event()
    with grpc.insecure_channel(address) as channel:
        with contextlib.suppress(grpc.RpcError):
            next(channel.stream_stream(CONTROL)(iter(lambda: stopping.wait(60), True), timeout=seconds))
    stopping.set()
    return time.monotonic() - begin


def clock_set_back(daemon):
    flags = (*METRICS, "--open-timeout-s", "2", "--stall-s", "3")
    with ShiftedClock() as clock, Daemon(*flags, environment=clock.environment) as other:
        operators = operators_of(other)
        clock.shift(-60)
        told = probed(operators, attacks.ATTACK_S)
        unopened = end_of_unopened(other.address, 20)
        begin = time.monotonic()
        other.process.send_signal(signal.SIGTERM)
        try:
            ended = f"exit status {other.process.wait(20)} after {time.monotonic() - begin:.1f} s"
        except subprocess.TimeoutExpired:
            ended = "it runs on 20 s after SIGTERM"
    return f"{told}; the open timeout of 2 s comes after {unopened:.1f} s; {ended}"


ATTACKS = [
    Attack(number, name, before, functools.partial(hold, behave, count, anywhere), flags=METRICS) for number, name, before, behave, count, anywhere in (
        ("27a", "eight silent connections to the metrics port", "/livez fails 4 of 4", "is_silent", 8, False),
        ("27b", "200 of them, each from another address", "", "is_silent", 200, True),
        ("27c", "200 that send a header now and then", "", "sends_a_header_now_and_then", 200, True),
        ("27d", "40 that take no answer", "", "takes_no_answer", 40, False),
        ("27e", "thousands of requests on one connection", "", "sends_many_requests_at_once", 8, False),
        ("27f", "headers without end", "", "sends_an_endless_header", 8, False),
        ("27g", "/metrics asked for without a pause", "", "asks_again_and_again", 8, False),
        ("27h", "connections made and reset", "", "resets", 8, False))
] + [
    Attack(28, "the wall clock is set back by 60 s", "/livez 503 after 10 s; no open timeout; SIGTERM hangs over 20 s", clock_set_back),
]
