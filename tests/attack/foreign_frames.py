"""Attacks with frames that carry nothing, or next to nothing. The attackers have other addresses than the healthy session."""
import contextlib
import pathlib
import ssl
import struct
import tempfile
import threading
import time

import attacks
import grpc
from certificates import Authority
from daemon import (CONTINUATION, CONTROL, DATA, END_HEADERS, END_STREAM, GOAWAY, HEADERS, SERVICE, Daemon, FlowingConnection, RawConnection, flood, frame,
                    in_containers, is_cut, message, request_headers)
from service_stub import CameraControlServiceStub
from sessions import Crowd
from sightline.v1 import server_pb2
from sightline.v1.camera_pb2 import Pose3, Vec3
from sightline.v1.scene_pb2 import NewInstance, Shape

SOURCE = "127.0.0.2"
TOKEN = "valid-0123456789abcdef"


def flood_with(make, connections=1):
    """An attack that sends `make(connection)` on each connection, and connects again when it is cut."""
    def run(daemon):
        end, sent, cuts = time.monotonic() + attacks.ATTACK_S, [0], [0]

        def attacker():
            while time.monotonic() < end:
                with contextlib.suppress(OSError):
                    connection = RawConnection(daemon.address, source=SOURCE)
                    sent[0] += flood(connection, make(connection), max(0.0, end - time.monotonic()))
                    cuts[0] += is_cut(connection, 0.2)
                    connection.close()
                time.sleep(0.02)
        attackers = [threading.Thread(target=attacker) for _ in range(connections)]
        for one in attackers:
            one.start()
        for one in attackers:
            one.join()
        return f"{sent[0] / 1e6:.1f} MB sent; cut {cuts[0]} times"
    return run


def goaways(_):
    frames = 2048 * frame(GOAWAY, 0, 0, struct.pack(">II", 0, 0))
    return lambda: frames


def on_open_call(frames_of):
    """Frames on a call that was begun and has ended for its client: of a stream below the newest one."""
    def make(connection):
        stream, call = connection.call(CONTROL)
        connection.send(call + connection.call(CONTROL)[1])
        frames = 2048 * frames_of(stream)
        return lambda: frames
    return make


def below_newest(connection):
    """Headers of calls that were never begun and have a lower number than one that was. gRPC skips them."""
    connection.next_stream = 1_000_001
    connection.send(connection.call(CONTROL)[1])
    frames = b"".join(frame(HEADERS, END_HEADERS, stream, request_headers(CONTROL)) for stream in range(1, 4001, 2))
    return lambda: frames


def continuations(connection):
    """Of a header block that never ends, without a byte."""
    connection.send(frame(HEADERS, 0, 1, request_headers(CONTROL)))
    frames = 2048 * frame(CONTINUATION, END_STREAM, 1)
    return lambda: frames


def pieces(connection, announced=4_000_000, calls=1):
    """Messages that never end, in frames of one byte."""
    streams, data = [], b""
    for _ in range(calls):
        stream, call = connection.call(CONTROL)
        streams.append(stream)
        data += call + frame(DATA, 0, stream, struct.pack(">BI", 0, announced))
    connection.send(data)
    frames = b"".join(frame(DATA, 0, stream, b"x") for stream in streams) * (4096 // calls)
    return lambda: frames


def spheres(count):
    """All distinct, so each has a mesh of its own."""
    return [NewInstance(id=100 + n, shape=Shape(sphere=Shape.Sphere(radius=0.1 + 1e-5 * n)), pose=Pose3(position=Vec3(x=n % 100, y=5, z=n // 100)))
            for n in range(count)]


def spheres_and_pieces(daemon):
    """Uses up the memory of sessions, and then that of messages which are not complete."""
    with Crowd(daemon.address, 64, instances=spheres(400)) as crowd:
        whole = message(bytes((4 << 20) - 8))[:-1]
        large = [FlowingConnection(daemon.address, source=SOURCE) for _ in range(8)]
        sending = [threading.Thread(target=lambda of=of: of.send_all({of.start_call(SERVICE + "GetServerInfo"): whole for _ in range(32)}, attacks.ATTACK_S / 2))
                   for of in large]
        for thread in sending:
            thread.start()
        tiny = flood_with(lambda connection: pieces(connection, calls=64), connections=8)(daemon)
        for thread in sending:
            thread.join()
        for connection in large:
            connection.close()
        return f"{len(crowd.sessions)} sessions of 400 distinct spheres; {tiny}"


@contextlib.contextmanager
def container():
    in_containers()
    try:
        yield {} if Daemon.memory_limit_mib else {"skip": "no control group with a limit of memory can be made here"}
    finally:
        Daemon.memory_limit_mib = None


# --- places

class Files:
    """What a daemon with TLS and tokens reads, and what its clients need."""

    def __init__(self, folder):
        authority = Authority(folder)
        certificate, key = authority.sign("server")
        access = pathlib.Path(folder, "access")
        access.write_text(f"token valid control {TOKEN}\nuser * control\n")
        self.flags = ("--tls-cert", str(certificate), "--tls-key", str(key), "--access-file", str(access))
        self.authority = authority.certificate.read_bytes()
        self.tls = ssl.create_default_context(cafile=str(authority.certificate))
        self.tls.set_alpn_protocols(["h2"])

    def may_speak(self, address):
        """Whether a new client with the valid token is answered at once."""
        channel = grpc.secure_channel(address, grpc.ssl_channel_credentials(self.authority), [("grpc.use_local_subchannel_pool", 1)])
        with channel, contextlib.suppress(grpc.RpcError):
            metadata = [("authorization", "Bearer " + TOKEN)]
            return bool(CameraControlServiceStub(channel).GetServerInfo(server_pb2.GetServerInfoRequest(), timeout=3, metadata=metadata).version)
        return False


@contextlib.contextmanager
def tokens_and_unix_socket():
    with tempfile.TemporaryDirectory() as folder:
        files = Files(folder)
        yield {"more": (*files.flags, "--listen-unix", folder + "/socket"), "files": files}


def take_places(address, files, source, count):
    """Connections with one call each that is refused, since it has no token."""
    held = []
    for _ in range(count):
        with contextlib.suppress(OSError):
            connection = RawConnection(address, source=source, tls=files.tls)
            connection.send(connection.call(CONTROL)[1])
            held.append(connection)
    return held


def places(daemon):
    address, files = daemon.ready.read_text().split()[0], daemon.files
    held = [connection for source in ("127.0.0.2", "127.0.0.3") for connection in take_places(address, files, source, 140)]
    tries, answered, end = 0, 0, time.monotonic() + attacks.ATTACK_S / 2
    while time.monotonic() < end:
        tries, answered = tries + 1, answered + files.may_speak(address)
    for connection in held:
        connection.close()
    return f"beside {len(held)} connections with a refused call each, {answered} of {tries} new clients with a valid token were answered"


TRAILERS = b"\x00\x01x\x01y"
ATTACKS = [
    attacks.Attack(21, "GOAWAY flood", "never cut; others' p50 2.2 s, p99 4.7 s", flood_with(goaways)),
    attacks.Attack(24, "512 MiB: distinct spheres, then messages that never end in frames of one byte", "killed for memory, 2 of 2", spheres_and_pieces,
                   options=container),
    attacks.Attack(25, "DATA frames of one byte", "946 MiB for 88 MB; others' p99 4 s", flood_with(lambda c: pieces(c, calls=64), connections=4)),
    attacks.Attack("26a", "HEADERS below the newest call", "others' p99 1,028 ms",
                   flood_with(below_newest)),
    attacks.Attack("26b", "trailers of calls that have ended", "others' p99 547 ms",
                   flood_with(on_open_call(lambda stream: frame(HEADERS, END_HEADERS | END_STREAM, stream, TRAILERS)))),
    attacks.Attack("26c", "empty CONTINUATION with flag 1", "others' p99 357 ms", flood_with(continuations)),
    attacks.Attack("26d", "empty DATA with END_STREAM", "others' p99 371 ms", flood_with(on_open_call(lambda stream: frame(DATA, END_STREAM, stream)))),
    attacks.Attack(29, "two addresses without a token, one refused call a connection", "all 256 places held for 60 s", places, options=tokens_and_unix_socket,
                   beside_is_another_client=True),
]
