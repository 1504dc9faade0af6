"""Attacks by files, signals and disks, and what measure.py shows of them. files_test.py asserts what must happen."""
import contextlib
import json
import os
import pathlib
import resource
import signal
import struct
import subprocess
import tempfile
import time

import daemon as attack
from attacks import Attack
from daemon import Daemon
from sessions import open_session

# A file with one of these stopped the start, and --check-config called it valid.
WRONG_ACCESS_FILES = [
    "", "# nobody\n", "token a control\n", "token a control short\n", "token a root 0123456789abcdef\n", "password a control 0123456789abcdef\n",
    "token a control 0123456789abcdef\ntoken a control 1123456789abcdef\n", "token a control 0123456789abcdef more\n", "token a control sha256:12\n",
    "user nobody-of-this-name control\n", "user 1 control\nuser 1 observe\n", "certificate a control secret\n",
    "token a control 0123456789abcdef\ntoken b admin 0123456789abcdef\n",
]
# Signals that must not end a daemon.
HARMLESS = [signal.SIGALRM, signal.SIGVTALRM, signal.SIGPROF, signal.SIGIO, signal.SIGSTKFLT, signal.SIGPIPE, signal.SIGXFSZ, signal.SIGUSR1,
            signal.SIGUSR2, signal.SIGURG, signal.SIGWINCH, signal.SIGCHLD, signal.SIGCONT, *range(signal.SIGRTMIN, signal.SIGRTMAX + 1)]
# Code points that terminals, editors and readers of lines obey.
UNRULY = [*range(0x20), 0x7F, *range(0x80, 0xA0), 0x200E, 0x200F, *range(0x202A, 0x202F), *range(0x2066, 0x206A), 0x2028, 0x2029, 0xFEFF]


def sightline(*arguments, timeout=120):
    """The command beside the daemon."""
    program = pathlib.Path(Daemon.path).with_name("sightline")
    return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, timeout=timeout)


def rewrite_in_place(path, text, process, pieces=4, pause=0.01):
    """As `cp` and many editors do. The daemon is asked to read the file in each of its states."""
    with open(path, "w") as file:
        process.send_signal(signal.SIGHUP)
        time.sleep(pause)
        lines = text.splitlines(keepends=True)
        for n in range(pieces):
            file.writelines(lines[n * len(lines) // pieces:(n + 1) * len(lines) // pieces])
            file.flush()
            process.send_signal(signal.SIGHUP)
            time.sleep(pause)


def zstd_of_zeros(mib):
    """A frame of blocks that repeat a byte (RFC 8878), 128 KiB each."""
    block = 128 << 10
    count = (mib << 20) // block
    frame = struct.pack("<IBBI", 0xFD2FB528, 0x80, 0x38, mib << 20)  # a size of four bytes, a window of 128 KiB
    for n in range(count):
        frame += struct.pack("<I", (n == count - 1) | 1 << 1 | block << 3)[:3] + b"\0"
    return frame


def record(opcode, content):
    return struct.pack("<BQ", opcode, len(content)) + content


def bomb(chunks, mib=64, finished=True):
    """A recording of chunks that unpack to zeros."""
    packed = zstd_of_zeros(mib)
    chunk = record(6, struct.pack("<QQQI", 0, 0, mib << 20, 0) + struct.pack("<I4s", 4, b"zstd") + struct.pack("<Q", len(packed)) + packed)
    magic = b"\x89MCAP0\r\n"
    end = record(15, bytes(4)) + record(2, bytes(20)) + magic
    return magic + record(1, bytes(8)) + chunks * chunk + (end if finished else b"")


@contextlib.contextmanager
def small_disk(mib):
    """A file system of this size; None where none can be mounted."""
    with tempfile.TemporaryDirectory() as folder:
        mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={mib}m", "sightline-test", folder], capture_output=True).returncode == 0
        try:
            yield folder if mounted else None
        finally:
            if mounted:
                subprocess.run(["umount", "-l", folder], check=True)


def fill(folder):
    """Uses up the disk."""
    with contextlib.suppress(OSError), open(os.path.join(folder, "fill"), "wb", buffering=0) as file:
        while True:
            file.write(bytes(4096))


def leaves_after_kill(after_s):
    """What a session of this age leaves when the daemon is killed: the text of `sightline info`, or nothing."""
    with tempfile.TemporaryDirectory() as folder, Daemon("--record-dir", folder, "--record-reserve-mib", "1") as daemon:
        session = open_session(daemon.address, label="short")
        time.sleep(after_s)
        daemon.process.kill()
        daemon.process.wait()
        session.close()
        files = sorted(pathlib.Path(folder).iterdir())
        return [sightline("info", "--json", file) for file in files]


# --- for measure.py

@contextlib.contextmanager
def user_file():
    """An access file that lets this user in, at the unix socket alone."""
    with tempfile.TemporaryDirectory() as folder:
        access = pathlib.Path(folder, "access")
        access.write_text(f"token game control {'0123456789abcdef'}\nuser {os.getuid()} admin\n")
        access.chmod(0o600)
        yield {"more": ("--access-file", str(access)), "listen": ("--listen", "none", "--listen-unix", folder + "/socket")}


def rewrites(daemon):
    path = daemon.process.args[daemon.process.args.index("--access-file") + 1]
    text = pathlib.Path(path).read_text()
    before = daemon.log().count("sessions ended")
    for n in range(60):
        rewrite_in_place(path, text + f"# {n}\n", daemon.process)
    time.sleep(2)
    return f"60 rewrites in place, each read in five states: sessions ended {daemon.log().count('sessions ended') - before} times; " \
           f"taken over {daemon.log().count('credentials taken over')} times, refused {daemon.log().count('credentials refused')} times"


@contextlib.contextmanager
def recordings():
    with tempfile.TemporaryDirectory() as folder:
        yield {"more": ("--record-dir", folder, "--record-reserve-mib", "1")}


def file_size_limit(daemon):
    resource.prlimit(daemon.pid, resource.RLIMIT_FSIZE, (40_000, 40_000))
    with open_session(daemon.address) as session:
        end, degraded = time.monotonic() + 6, False
        while time.monotonic() < end and not degraded:
            degraded = session.tick().flags.recording_degraded
            time.sleep(1 / 60)
    return f"a limit of 40,000 bytes a file: the recording says that it lost something: {degraded}"


def signal_storm(daemon):
    for _ in range(20):
        for number in HARMLESS:
            daemon.process.send_signal(number)
            time.sleep(0.002)
    return f"20 of each of {len(HARMLESS)} signals"


def checks(daemon):
    agreed = 0
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder, "access")
        for text in WRONG_ACCESS_FILES:
            path.write_text(text)
            flags = ["--listen", "none", "--listen-unix", folder + "/socket", "--access-file", str(path)]
            checked = subprocess.run([Daemon.path, *flags, "--check-config"], capture_output=True, text=True)
            with Daemon("--access-file", str(path), listen=flags[:4], wait=False) as other:
                while not other.ready.exists() and (started := other.process.poll()) is None:
                    time.sleep(0.01)
            agreed += (checked.returncode, started) == (2, 1)
        try:
            zero = subprocess.run([Daemon.path, "--config", "/dev/zero", "--check-config"], capture_output=True, text=True, timeout=5).returncode
        except subprocess.TimeoutExpired:
            zero = "it runs on"
    return f"--check-config refuses {agreed} of the {len(WRONG_ACCESS_FILES)} access files that the start refuses; --config /dev/zero: {zero}"


def unruly_labels(daemon):
    for point in UNRULY:
        open_session(daemon.address, label=f"a{chr(point)}b").close()
    time.sleep(0.5)
    text = daemon.log()
    bare = [f"U+{point:04X}" for point in UNRULY if chr(point) in text and chr(point) != "\n"]
    told = {json.loads(line).get("label") for line in text.split("\n") if line}
    return f"{len(UNRULY)} labels; bare in the JSON log: {', '.join(bare) or 'none'}; read back: {sum(f'a{chr(point)}b' in told for point in UNRULY)}"


def bombs(daemon):
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder, "bomb.mcap")
        path.write_bytes(bomb(400))
        told = []
        for verb in ("info", "verify", "recover", "dump", "cut"):
            begin = time.monotonic()
            result = sightline(verb, path, *(["--out", folder + "/" + verb] if verb in ("recover", "cut") else []), timeout=600)
            told.append(f"{verb} {time.monotonic() - begin:.2f} s ({result.returncode})")
    return f"a file of {len(bomb(400)) / 1e6:.1f} MB that unpacks to 26.8 GB: " + ", ".join(told)


def short_sessions(daemon):
    found = [sum('"label":"short"' in shown.stdout for shown in leaves_after_kill(age)) for age in (0.02, 0.05, 0.1, 0.2, 0.3)]
    return f"of sessions killed with the daemon after 20, 50, 100, 200 and 300 ms, recordings that can be read: {sum(found)} of {len(found)}"


def full_disk(daemon):
    with small_disk(2) as folder:
        if folder is None:
            return "no file system can be mounted here"
        with Daemon("--record-dir", folder + "/recorded", "--record-reserve-mib", "0") as other, open_session(other.address) as session:
            for n in range(180):
                if n == 60:
                    fill(folder)
                degraded = session.tick().flags.recording_degraded
                time.sleep(1 / 60)
            told = [line for line in other.log().splitlines() if "recording degraded" in line]
    return f"{len(told)} warning, of no space: {all('No space left' in line for line in told)}; degraded: {degraded}"


def exposed(daemon):
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder, "access")
        path.write_text("token a control 0123456789abcdef\n")
        path.chmod(0o644)
        with Daemon("--access-file", str(path), listen=("--listen", "none", "--listen-unix", folder + "/socket")) as other:
            time.sleep(0.3)
            return f"a warning for an access file that everyone can read: {'credentials exposed' in other.log()}"


ATTACKS = [
    Attack(30, "access file rewritten in place, 60 times", "an empty or half-written file ends all sessions, 22 of 60 times", rewrites, options=user_file),
    Attack("31a", "a limit on the size of files, while recording", "SIGXFSZ ends the daemon without a word", file_size_limit, options=recordings),
    Attack("31b", "signals that nobody expects", "SIGALRM and others end the daemon without a word", signal_storm),
    Attack(33, "--check-config of what cannot start; --config /dev/zero", "valid; runs on", checks),
    Attack(34, "unruly characters in the JSON log", "U+009B, U+202E and U+2028 unescaped", unruly_labels, flags=("--log-format", "json")),
    Attack("35a", "a recording that unpacks to 27 GB", "each verb busy for 30 s", bombs),
    Attack("35b", "kill -9 in the first 300 ms of a session", "nothing is left", short_sessions),
    Attack("35c", "a full disk under the recordings", "a second, wrong reason", full_disk),
    Attack("35d", "an access file that everyone can read", "no warning", exposed),
]
