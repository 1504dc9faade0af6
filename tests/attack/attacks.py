"""The attacks as measure.py runs them: each takes a daemon, does harm for some seconds beside a healthy session, and returns what it saw.
`before` is what happened when the attack was first tried, on a daemon without the gate and without budgets."""
import contextlib
import dataclasses
import os
import pathlib
import re
import resource
import signal
import struct
import subprocess
import tempfile
import threading
import time
from typing import Callable

import grpc
from daemon import (CONTINUATION, CONTROL, HEADERS, HEALTH, RST_STREAM, Daemon, RawConnection, connect, flood, frame, is_cut,
                    request_headers)
from scenes import crowd_tuning, dear_tuning, empty_parts, glb, largest_tuning, many_instances, scene_of, stacked_plates
from sessions import Crowd, info, open_session, status_of, stub, upload

ATTACK_S = 8
SERVICE = CONTROL.rsplit("/", 1)[0] + "/"


@dataclasses.dataclass
class Attack:
    number: int | str  # attacks of one kind have a letter after their number
    name: str
    before: str
    run: Callable
    flags: tuple = ()
    limits: dict = dataclasses.field(default_factory=dict)
    # A context that gives more options of Daemon; each run enters one of its own.
    options: Callable = dict
    # The healthy session is at the unix socket, and so another client than the attacker.
    beside_is_another_client: bool = False
    # Memory of uploads that stay for sessions to come, as they should.
    stays_mib: float = 0.0
    # How much later an answer may come because the attack keeps the daemon from running at all.
    stopped_ms: float = 0.0


def refusal(call, *arguments, **more):
    """The code and the text of an RPC that must fail."""
    try:
        call(*arguments, **more)
    except grpc.RpcError as error:
        return f"{error.code().name}: {error.details()}"
    return "it succeeded"


def until_end(seconds, action):
    """Repeats an action for some seconds; returns the last result and how often it ran."""
    end, count, last = time.monotonic() + seconds, 0, None
    while time.monotonic() < end:
        last, count = action(), count + 1
    return last, count


def idle_connections(daemon):
    resource.setrlimit(resource.RLIMIT_NOFILE, (4096, resource.getrlimit(resource.RLIMIT_NOFILE)[1]))
    idle = [connect(daemon.address) for _ in range(1074)]
    time.sleep(ATTACK_S / 2)
    during = bool(info(daemon.address).version)
    for connection in idle:
        connection.close()
    time.sleep(1)
    return f"a new client is served while they are open ({during}) and when they are closed ({bool(info(daemon.address).version)})"


def rapid_resets(daemon):
    attacker = RawConnection(daemon.address)

    def make():
        frames = b""
        for _ in range(64):
            stream, call = attacker.call(CONTROL)
            frames += call + frame(RST_STREAM, 0, stream, struct.pack(">I", 8))
        return frames
    sent = flood(attacker, make, ATTACK_S)
    cut = is_cut(attacker)
    # The same again on new connections, as an attacker would.
    again = 0
    end = time.monotonic() + ATTACK_S / 2
    while time.monotonic() < end:
        attacker = RawConnection(daemon.address)
        again += flood(attacker, make, 1)
        attacker.close()
    return f"cut: {cut}, after {sent / 1e6:.1f} MB; then {again / 1e6:.1f} MB on new connections; {daemon.log_bytes() / 1e6:.2f} MB of log"


def endless_headers(daemon):
    attacker = RawConnection(daemon.address)
    attacker.send(frame(HEADERS, 0, 1, request_headers(CONTROL)))
    attacker.send(frame(CONTINUATION, 0, 1, b"\x00\x01x\x7f\xff\xff\xff\xff\x07"))
    sent = flood(attacker, lambda: 4 * frame(CONTINUATION, 0, 1, bytes(16384)), ATTACK_S)
    return f"cut: {is_cut(attacker)}, after {sent / 1e6:.1f} MB"


def compressed_bombs(daemon):
    bomb = bytes(96 << 20)
    with grpc.insecure_channel(daemon.address, compression=grpc.Compression.Gzip) as channel:
        last, count = until_end(ATTACK_S, lambda: refusal(channel.unary_unary(HEALTH + "Check"), bomb, timeout=60))
    return f"{count} refused; {last}"


def unread_log(daemon):
    def session():
        open_session(daemon.address, label="x" * 60).close()
    _, count = until_end(ATTACK_S, session)
    return f"{count} sessions opened and closed although nobody reads the log"


def largest_settings(daemon):
    """The dearest steps that pass, in two sessions that tick as fast as they are answered."""
    steps = []

    def play():
        with open_session(daemon.address, targets=32, tuning=dear_tuning()) as session:
            steps.append(until_end(ATTACK_S, session.tick)[1])
    players = [threading.Thread(target=play) for _ in range(2)]
    for player in players:
        player.start()
    for player in players:
        player.join()
    return f"the largest are refused ({refusal(open_session, daemon.address, targets=32, tuning=largest_tuning())}); beside two sessions " \
           f"with 32 targets that tick at once again, {sum(steps)} steps"


def silent_reflection(daemon):
    methods = [f"/grpc.reflection.{version}.ServerReflection/ServerReflectionInfo" for version in ("v1", "v1alpha")]
    with grpc.insecure_channel(daemon.address) as channel:
        stopping = threading.Event()

        def silent():
            yield b"\x3a\x01*"
            stopping.wait(ATTACK_S + 5)
        held = [channel.stream_stream(method)(silent()) for method in methods * 32]
        served, count = until_end(ATTACK_S, lambda: bool(info(daemon.address).version) and bool(upload(daemon.address, glb("x")).hash))
        stopping.set()
        for call in held:
            call.cancel()
    return f"GetServerInfo and uploads answered: {served}, {count} times"


def many_of_one_triangle(daemon):
    scene = many_instances(999_000)

    def attempt():
        return refusal(lambda: open_session(daemon.address, scene=scene_of(upload(daemon.address, scene).hash)))
    last, count = until_end(ATTACK_S, attempt)
    return f"{count} refused; {last}"


def heavy_messages(daemon):
    message = empty_parts(1_900_000)

    def attempt():
        with grpc.insecure_channel(daemon.address, options=[("grpc.max_send_message_length", -1)]) as channel:
            result = refusal(lambda: next(channel.stream_stream(CONTROL)(iter([message]), timeout=20)))
        time.sleep(0.5)
        return result
    last, count = until_end(ATTACK_S, attempt)
    return f"{count} refused; {last}"


def all_sessions(daemon):
    """Another client, at the unix socket, must get in."""
    tcp, unix = daemon.ready.read_text().split()
    held = []
    told = ""
    with contextlib.ExitStack() as stack:
        channel = stack.enter_context(grpc.insecure_channel(tcp))
        for _ in range(256):
            try:
                held.append(stack.enter_context(open_session(tcp, channel=channel)))
            except grpc.RpcError as error:
                told = f"{error.code().name}: {error.details()}"
                break
        with open_session(unix) as other:
            answered = other.tick().sequence == 1
        time.sleep(ATTACK_S / 2)
    return f"{len(held)} opened, then {told}; another client gets in: {answered}"


def dripping_uploads(daemon):
    """The scene of another client, at the unix socket, must stay until it opens it."""
    from sightline.v1 import camera_control_pb2
    stopping = threading.Event()

    def drip():
        while not stopping.wait(0.5):
            yield camera_control_pb2.UploadSceneRequest(chunk=b"x")
    tcp, unix = daemon.ready.read_text().split()
    first = upload(unix, glb("first")).hash
    with stub(tcp) as service:
        slow = [service.UploadScene.future(drip()) for _ in range(8)]
        time.sleep(3)
        in_time = bool(upload(tcp, glb("quick")).hash)
        _, small = until_end(ATTACK_S - 3, lambda: upload(tcp, glb(f"other {time.monotonic()}")))
        stopping.set()
        for call in slow:
            call.cancel()
    open_session(unix, scene=scene_of(first)).close()
    return f"an upload beside eight that drip: {in_time}; another client's scene stays after {small} small uploads"


def stuck_recording(daemon):
    with open_session(daemon.address) as session:
        end = time.monotonic() + ATTACK_S
        degraded = False
        while time.monotonic() < end:
            degraded = session.tick().flags.recording_degraded
            time.sleep(0.05)
    files = [name for name in os.listdir(daemon.recordings) if "stuck" not in name and name.endswith(".mcap")]
    return f"{len(files)} files beside the one that cannot be deleted; the recording says that it lost something: {degraded}"


@contextlib.contextmanager
def folder_with_stuck_file():
    with tempfile.TemporaryDirectory() as folder:
        stuck = pathlib.Path(folder, "sightline-20200101T000000.000Z-stuck-p001.mcap")
        stuck.write_bytes(bytes(3 << 20))
        immutable = subprocess.run(["chattr", "+i", str(stuck)], capture_output=True).returncode == 0
        try:
            yield folder if immutable else None
        finally:
            subprocess.run(["chattr", "-i", str(stuck)], capture_output=True)


def second_daemon(daemon):
    with tempfile.TemporaryDirectory() as folder:
        path = folder + "/socket"
        listen = ("--listen", "none", "--listen-unix", path)
        with Daemon(listen=listen) as first:
            os.unlink(path)
            with Daemon(listen=listen) as second:
                code = first.stop()
                time.sleep(0.5)
                return f"the first ends with {code}; the second's socket answers: {bool(info(second.address).version)}"


def signals(daemon):
    for number in (signal.SIGHUP, signal.SIGUSR1, signal.SIGUSR2) * 20:
        daemon.process.send_signal(number)
        time.sleep(ATTACK_S / 80)
    with Daemon() as other, open_session(other.address) as session:
        other.process.send_signal(signal.SIGQUIT)
        drained = session.waits_for_drain()
        session.close()
        code = other.process.wait(10)
    return f"60 signals ignored or obeyed; SIGQUIT drains: {drained}, exit status {code}"


def wrong_configurations(daemon):
    told = []
    for text in ("[x\n", "drain-s = nan\n", "step-budget-ms = nan\n", "max-sessions = 8\nbogus = 3\n"):
        with tempfile.NamedTemporaryFile("w", suffix=".conf") as file:
            file.write(text)
            file.flush()
            result = subprocess.run([Daemon.path, "--config", file.name, "--check-config"], capture_output=True, text=True)
        line = re.search(r"line \d+", result.stderr + result.stdout)
        told.append(f"{result.returncode}, {line[0] if line else 'no line'}")
    return "exit status and place: " + "; ".join(told)


def no_memory(daemon):
    in_use = int(re.search(r"VmSize:\s+(\d+)", pathlib.Path(f"/proc/{daemon.pid}/status").read_text())[1]) << 10
    resource.prlimit(daemon.pid, resource.RLIMIT_AS, (in_use + (400 << 20),) * 2)
    status = status_of(daemon.address, upload=400 << 20)
    return f"{status.code().name}: {status.details()}; others are answered: {bool(info(daemon.address).version)}"


def labels(daemon):
    _, count = until_end(ATTACK_S / 2, lambda: open_session(daemon.address, label="a\u009b31mb\u202ec").close())
    time.sleep(0.5)
    bare = re.search("[\u0080-\u009f\u202e]", daemon.log())
    with tempfile.NamedTemporaryFile() as file, Daemon("--record-dir", file.name + "/sub") as other, open_session(other.address) as session:
        promised = session.opened.recording_file or "none"
    return f"bare control characters in the log of {count} sessions: {'yes' if bare else 'none'}; file promised by an unusable folder: {promised}"


def crowd_of_one_client(daemon):
    with Crowd(daemon.ready.read_text().split()[0], 256, targets=8, tuning=crowd_tuning()) as crowd:
        before = crowd.answers
        time.sleep(ATTACK_S)
        answers = crowd.answers - before
    return f"{len(crowd.sessions)} sessions with 8 targets, then {crowd.told}; {answers} of their ticks answered"


def long_steps(daemon):
    with Crowd(daemon.ready.read_text().split()[0], 6, targets=16, instances=stacked_plates(15_000)) as crowd:
        time.sleep(ATTACK_S)
    return f"{crowd.answers} steps of {len(crowd.sessions)} sessions with 16 targets and 15,000 large plates at one place"


def cheap_then_dear(daemon):
    """A short step runs on the thread of the event loop, and the last one says whether the next will be short. So every other step of these sessions is
    for no target, and the ones between for sixteen above the plates of `long_steps`."""
    from sightline.v1.scene_pb2 import Target, TargetList
    from sightline.v1.session_pb2 import DEGRADATION_POLICY_NEVER
    none, all_targets = TargetList(), TargetList(targets=[Target(id=n + 1) for n in range(16)])
    steps, tcp = [], daemon.ready.read_text().split()[0]

    def play():
        with open_session(tcp, targets=16, instances=stacked_plates(15_000), degradation_policy=DEGRADATION_POLICY_NEVER) as session:
            steps.append(2 * until_end(ATTACK_S, lambda: (session.tick(targets=none), session.tick(targets=all_targets)))[1])
    players = [threading.Thread(target=play) for _ in range(6)]
    for player in players:
        player.start()
    for player in players:
        player.join()
    return f"{sum(steps)} steps of {len(steps)} sessions, of which every other one is for 16 targets above 15,000 large plates"


def nothing(daemon):
    time.sleep(ATTACK_S)
    return ""


@contextlib.contextmanager
def unread_pipe():
    reader, writer = os.pipe()
    try:
        with open(writer, "wb") as end:
            yield {"stderr": end}
    finally:
        os.close(reader)


@contextlib.contextmanager
def unix_socket_too():
    with tempfile.TemporaryDirectory() as folder:
        yield {"more": ("--listen-unix", folder + "/socket")}


@contextlib.contextmanager
def recording_folder():
    with folder_with_stuck_file() as folder:
        if folder is None:
            yield {"skip": "this file system cannot make a file immutable"}
        else:
            yield {"more": ("--record-dir", folder, "--record-total-mib", "1", "--record-reserve-mib", "1"), "recordings": folder}


ATTACKS = [
    Attack(0, "no attack", "", nothing),
    Attack(1, "1,074 idle connections with 1,024 file descriptors, all closed again", "deaf until a restart; nothing logged",
           idle_connections, limits={"nofile": 1024}),
    Attack(2, "HTTP/2 rapid reset", "27 MB -> 2.9 GB and kept; others fail until 15 s after; 41 MB of log", rapid_resets),
    Attack(3, "gzip bombs", "512 MiB from 0.5 MB; all sessions frozen for 3.6 s", compressed_bombs),
    Attack(4, "a log that nobody reads", "opens hang, then every session and Health", unread_log, flags=("--log-level", "debug"),
           options=unread_pipe),
    Attack(5, "the largest legal settings", "a step of 1.1 s; others' p50 470 ms", largest_settings),
    Attack(6, "64 silent reflection streams", "GetServerInfo, uploads and lists refused for as long", silent_reflection),
    Attack(7, "a scene of 560 bytes with 999,000 instances", "359 MB for each session", many_of_one_triangle),
    Attack(8, "CONTINUATION flood", "1.7 GB and kept; others' p50 584 ms", endless_headers),
    Attack(9, "4 MiB messages of empty parts", "others' p50 579 ms, at most 2.5 s; memory kept", heavy_messages),
    Attack(10, "one client opens all sessions and is idle", "nobody else gets in, for ever", all_sessions, options=unix_socket_too),
    Attack(11, "uploads that drip; many small uploads", "all places held; another client's scene evicted", dripping_uploads, options=unix_socket_too),
    Attack(12, "a recording that cannot be deleted", "all recording stops", stuck_recording, options=recording_folder),
    Attack(13, "socket file deleted, second daemon started, first stopped", "the first removes the second's socket", second_daemon),
    Attack(14, "SIGHUP, SIGUSR1, SIGQUIT", "end it without drain", signals),
    Attack(15, "`[x`, `nan` and unknown keys in the configuration", "valid, or refused without a line", wrong_configurations),
    Attack(16, "allocation failure", "UNKNOWN, or an abort without a word", no_memory, flags=("--max-upload-mib", "1024")),
    Attack(17, "control characters in labels; an unusable record folder", "bare in the log; a file is promised", labels),
    Attack(18, "one client plays all sessions that it may open", "others' p99 474 to 2,700 ms in three runs",
           crowd_of_one_client, options=unix_socket_too, beside_is_another_client=True),
    Attack(19, "steps of 20 to 130 ms, by a scene of overlapping instances", "others' p99 316 to 698 ms in three runs",
           long_steps, options=unix_socket_too, beside_is_another_client=True),
    Attack(36, "steps of no target and then of sixteen, on the thread of the event loop", "others' p99 310 ms; the health service held for 316 ms",
           cheap_then_dear, options=unix_socket_too, beside_is_another_client=True),
]
