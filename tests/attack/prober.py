"""Asks a daemon whether it lives, as an orchestrator does: prober.py ADDRESS OPERATORS SECONDS.

Ten times a second, each time on a new connection, it asks the gRPC health service at ADDRESS and /livez at OPERATORS. "unix:" addresses and TCP are
known. It comes from an address of its own, as a node of a cluster does, so that what is counted for the attacker is not counted for it. Prints "asked"
after the first answers, and then a JSON object with the figures of both: how often it asked, how often the answer was good, and the longest wait.
"""
import json
import sys
import time

import daemon
import probing

SOURCE = "127.0.77.1"
PERIOD_S = 0.1
# Far longer than a probe has, to see for how long a daemon is held.
PATIENCE_S = 30


def ask_health(address):
    with daemon.connect(address, PATIENCE_S, None if address.startswith("unix:") else SOURCE) as connection:
        return probing.asks_health(connection) == 1


def ask_http(address):
    return probing.probe(address, patience_s=PATIENCE_S)[0] == 200


class Figures:
    def __init__(self):
        self.waits, self.well, self.trouble = [], 0, ""

    def take(self, ask, address):
        begin = time.monotonic()
        try:
            self.well += ask(address)
        except OSError as trouble:
            self.trouble = repr(trouble)
        self.waits.append(time.monotonic() - begin)

    def told(self):
        waits = sorted(self.waits)
        return {"asked": len(waits), "well": self.well, "p50_ms": round(1e3 * waits[len(waits) // 2], 1), "max_ms": round(1e3 * waits[-1], 1),
                "trouble": self.trouble}


def main(address, operators, seconds):
    health, http = Figures(), Figures()
    end = time.monotonic() + float(seconds)
    while not health.waits or time.monotonic() < end:
        health.take(ask_health, address)
        http.take(ask_http, operators)
        if len(health.waits) == 1:
            print("asked", flush=True)
        time.sleep(max(0.0, PERIOD_S - health.waits[-1] - http.waits[-1]))
    print(json.dumps({"health": health.told(), "livez": http.told()}))


if __name__ == "__main__":
    main(*sys.argv[1:])
