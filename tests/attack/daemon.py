"""A daemon under attack, a healthy client beside it, and an attacker that writes HTTP/2 frames by hand."""
import json
import os
import pathlib
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import threading
import time

from memory_cgroup import MemoryCgroup

DATA, HEADERS, PRIORITY, RST_STREAM, SETTINGS, PUSH, PING, GOAWAY, WINDOW_UPDATE, CONTINUATION = range(10)
END_STREAM, END_HEADERS = 1, 4
SERVICE = "/sightline.v1.CameraControlService/"
CONTROL = SERVICE + "Control"
HEALTH = "/grpc.health.v1.Health/"


class Daemon:
    """sightlined as a child process. `limits` are flags of prlimit: {"nofile": 1024}; `environment` are further variables. Use it in a `with`
    statement."""

    path = None  # of the program; the test's main sets it
    # Each daemon gets a control group with so much memory, as a container has; None: none does. A test's main sets it by `in_containers`.
    memory_limit_mib = None

    def __init__(self, *arguments, limits=None, listen=("--listen", "127.0.0.1:0"), stderr=None, wait=True, environment=None):
        self.group = MemoryCgroup(self.memory_limit_mib) if self.memory_limit_mib else None
        self.folder = tempfile.TemporaryDirectory(prefix="sightline-attack-")
        self.ready = pathlib.Path(self.folder.name, "ready")
        self.log_path = pathlib.Path(self.folder.name, "log")
        self.stderr = stderr if stderr is not None else open(self.log_path, "wb")

        sampler = () if "--sampler" in arguments else ("--sampler", "embree")
        command = [self.path, *listen, "--ready-file", str(self.ready), *sampler, *arguments]
        # Programs set the limits, not a preexec_fn: that would fork, and gRPC's threads can make a fork of Python hang or crash.
        if limits:
            command = ["prlimit", *(f"--{name}={value}" for name, value in limits.items()), *command]
        self.process = subprocess.Popen(self.group.inside(command) if self.group else command, stdout=subprocess.DEVNULL, stderr=self.stderr,
                                        env={**os.environ, **(environment or {})})
        if wait:
            self.wait_until_ready()

    def wait_until_ready(self):
        deadline = time.monotonic() + 60
        while not self.ready.exists():
            if self.process.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError("the daemon did not start: " + self.log())
            time.sleep(0.01)

    @property
    def address(self):
        return self.ready.read_text().split()[0]

    @property
    def pid(self):
        return self.process.pid

    def log(self):
        return self.log_path.read_text(errors="replace") if self.log_path.exists() else ""

    def wait_for_log(self, text, seconds=10):
        """Waits until the log says `text`: a thread of the daemon's own writes it, some time after the event."""
        deadline = time.monotonic() + seconds
        while text not in self.log():
            if time.monotonic() > deadline:
                raise AssertionError(f"the log never says {text!r}: {self.log()}")
            time.sleep(0.02)

    def log_bytes(self):
        return self.log_path.stat().st_size

    def _status_mib(self, key):
        for line in pathlib.Path(f"/proc/{self.pid}/status").read_text().splitlines():
            if line.startswith(key + ":"):
                return int(line.split()[1]) / 1024
        raise KeyError(key)

    def memory_mib(self):
        return self._status_mib("VmRSS")

    def most_memory_mib(self):
        return self._status_mib("VmHWM")

    def descriptors(self):
        return len(os.listdir(f"/proc/{self.pid}/fd"))

    def stop(self, timeout=20):
        """Ends it with SIGTERM; returns the exit status."""
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(timeout)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        if hasattr(self.stderr, "close"):
            self.stderr.close()
        if self.group:
            self.group.close()
        self.folder.cleanup()


def in_containers(mib=512):
    """From now on each daemon has no more memory than this. Prints the reason where that cannot be."""
    try:
        MemoryCgroup(mib).close()
        Daemon.memory_limit_mib = mib
    except OSError as trouble:
        print(f"The daemons run without a limit of memory: no control group can be made here: {trouble}", file=sys.stderr)


def connect(address, timeout=10, source=None):
    """`source` is the client's own address, such as 127.0.0.2."""
    if address.startswith("unix:"):
        connection = socket.socket(socket.AF_UNIX)
        connection.settimeout(timeout)
        connection.connect(address[len("unix:"):])
        return connection
    host, port = address.rsplit(":", 1)
    return socket.create_connection((host, int(port)), timeout, source_address=(source, 0) if source else None)


def frame(kind, flags, stream, payload=b""):
    return struct.pack(">I", len(payload))[1:] + struct.pack(">BBI", kind, flags, stream) + payload


def request_headers(path, extra=()):
    """A header block in HPACK, without its dynamic table."""
    def text(value):
        value = value.encode()
        assert len(value) < 127
        return bytes([len(value)]) + value
    block = b"\x83\x86" + b"\x04" + text(path) + b"\x01" + text("localhost") + b"\x0f\x10" + text("application/grpc")
    for name, value in (("te", "trailers"), *extra):
        block += b"\x00" + text(name) + text(value)
    return block


def message(payload, compressed=False):
    return bytes([compressed]) + struct.pack(">I", len(payload)) + payload


class RawConnection:
    """A client that sends what it likes, encrypted with the context `tls`. With a `window` of 0 it takes no message of any call."""

    def __init__(self, address, greet=True, window=None, source=None, tls=None):
        self.socket = connect(address, source=source)
        if tls:
            self.socket = tls.wrap_socket(self.socket, server_hostname="localhost")
        self.next_stream = 1
        if greet:
            settings = b"" if window is None else struct.pack(">HI", 4, window)
            self.send(b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + frame(SETTINGS, 0, 0, settings))
            # What comes back must be read, or the daemon stops writing. Nobody needs it.
            threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        try:
            while self.socket.recv(65536):
                pass
        except OSError:
            pass

    def send(self, data):
        self.socket.sendall(data)

    def call(self, path, payload=b"", flags=END_HEADERS, extra=()):
        """The frames of a new call."""
        stream, self.next_stream = self.next_stream, self.next_stream + 2
        return stream, frame(HEADERS, flags, stream, request_headers(path, extra)) + payload

    def close(self):
        self.socket.close()


class FlowingConnection(RawConnection):
    """Sends long messages, as far as the daemon's windows let it."""

    def __init__(self, address, **more):
        self.room, self.initial, self.rooms = 65535, 65535, {}
        self.changed, self.ended = threading.Condition(), False
        super().__init__(address, **more)

    def _read(self):
        data = b""
        try:
            while part := self.socket.recv(65536):
                data += part
                while len(data) >= 9 and len(data) >= 9 + (size := int.from_bytes(data[:3], "big")):
                    self._take(data[3], data[4], struct.unpack(">I", data[5:9])[0], data[9:9 + size])
                    data = data[9 + size:]
        except OSError:
            pass
        with self.changed:
            self.ended = True
            self.changed.notify_all()

    def _take(self, kind, flags, stream, payload):
        with self.changed:
            if kind == SETTINGS and not flags & 1:
                for at in range(0, len(payload), 6):
                    key, value = struct.unpack(">HI", payload[at:at + 6])
                    if key == 4:
                        self.rooms = {of: room + value - self.initial for of, room in self.rooms.items()}
                        self.initial = value
            elif kind == WINDOW_UPDATE:
                more = struct.unpack(">I", payload)[0]
                if stream == 0:
                    self.room += more
                elif stream in self.rooms:
                    self.rooms[stream] += more
            elif kind == RST_STREAM or (kind == HEADERS and flags & 1):
                self.rooms.pop(stream, None)
            self.changed.notify_all()

    def start_call(self, path):
        stream, call = self.call(path)
        with self.changed:
            self.rooms[stream] = self.initial
        self.send(call)
        return stream

    def send_all(self, data_of, seconds):
        """Sends all that `data_of` has for each stream, a frame of each in turn. Returns the bytes sent within the time."""
        left = {stream: memoryview(data) for stream, data in data_of.items()}
        sent, end = 0, time.monotonic() + seconds
        while left and time.monotonic() < end and not self.ended:
            moved = 0
            for stream, data in list(left.items()):
                with self.changed:
                    size = min(len(data), self.rooms.get(stream, 0), self.room, 16384)
                    if size <= 0:
                        continue
                    self.room -= size
                    self.rooms[stream] -= size
                try:
                    self.send(frame(DATA, 0, stream, data[:size]))
                except OSError:
                    return sent
                moved += size
                if size == len(data):
                    del left[stream]
                else:
                    left[stream] = data[size:]
            sent += moved
            with self.changed:
                if not moved:
                    self.changed.wait(0.1)
        return sent


def is_cut(connection, timeout=5):
    """Whether the daemon closes the connection."""
    deadline = time.monotonic() + timeout
    try:
        while time.monotonic() < deadline:
            connection.send(frame(WINDOW_UPDATE, 0, 0, struct.pack(">I", 1)))
            time.sleep(0.02)
    except OSError:
        return True
    return False


def flood(connection, make, seconds):
    """Sends what `make()` gives for some seconds. Returns the bytes that were sent; stops early when the connection is cut."""
    sent, end = 0, time.monotonic() + seconds
    try:
        while time.monotonic() < end:
            data = make()
            connection.send(data)
            sent += len(data)
    except OSError:
        pass
    return sent


class Beside:
    """A program of this folder in a process of its own, so that an attacker in this one does not slow it down. It prints a word when it has begun,
    and a JSON object at its end."""

    def __init__(self, program, begun, *arguments, stdin=subprocess.DEVNULL):
        self.process = subprocess.Popen([sys.executable, str(pathlib.Path(__file__).with_name(program)), *map(str, arguments)], stdin=stdin,
                                        stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)})
        assert self.process.stdout.readline().strip() == begun

    def result(self):
        out, _ = self.process.communicate(timeout=120)
        return json.loads(out)


class Prober(Beside):
    """Asks a daemon whether it lives. `result` has for "health" and "livez": {"asked", "well", "p50_ms", "max_ms", "trouble"}"""

    def __init__(self, address, operators, seconds):
        super().__init__("prober.py", "asked", address, operators, seconds)


class Healthy(Beside):
    """A session that ticks at 60 Hz. `result` is {"ticks", "answered", "replies", "p50_ms", "p99_ms", "max_ms", "error"}"""

    def __init__(self, address, seconds):
        super().__init__("healthy_client.py", "opened", address, seconds)


class HealthyAllAlong(Beside):
    """One session that ticks until `result` is called, through all that happens meanwhile. The result is that of Healthy."""

    def __init__(self, address):
        super().__init__("healthy_client.py", "opened", address, stdin=subprocess.PIPE)
        self.start, self.told, self.last, self.changed = float(self.process.stdout.readline()), {}, None, threading.Condition()
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self):
        for line in self.process.stdout:
            with self.changed:
                if line.startswith("{"):
                    self.last = json.loads(line)
                else:
                    sequence, wait_ms = line.split()
                    self.told[int(sequence)] = float(wait_ms)
                self.changed.notify_all()

    def waits_ms(self, begin, end, patience_s=20):
        """The round trips of the ticks that were due between two times of the monotonic clock; infinity for a tick that is not answered in time."""
        due = [sequence for sequence in range(max(1, int((begin - self.start) * 60) - 1), int((end - self.start) * 60) + 3)
               if begin <= self.start + (sequence - 1) / 60 < end]
        with self.changed:
            self.changed.wait_for(lambda: self.last or all(sequence in self.told for sequence in due), patience_s)
            return [self.told.get(sequence, float("inf")) for sequence in due]

    def result(self):
        self.process.stdin.close()
        self.reader.join(120)
        self.process.wait(10)
        return self.last
