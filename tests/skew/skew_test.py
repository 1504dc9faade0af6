"""Clients and daemons of two versions: skew_test.py SIGHTLINED STUBS [FORMER_SIGHTLINED [--keep]].

`former` holds the Python client and the contract of version 0.1, and answers of its server: those of its golden recording. With the
program of a former daemon that one answers instead; --keep writes its answers to `former` (tests/skew.sh builds it from the history).
"""
import concurrent.futures
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
import unittest.mock

HERE = pathlib.Path(__file__).parent
sys.path.insert(0, str(HERE.parent / "attack"))
import daemon as attack  # noqa: E402

attack.Daemon.path, STUBS = sys.argv[1:3]
FORMER_DAEMON = sys.argv[3] if len(sys.argv) > 3 else None
KEEP = "--keep" in sys.argv
sys.path.insert(0, STUBS)

import grpc  # noqa: E402
from google.protobuf import descriptor_pb2, descriptor_pool, json_format, message_factory  # noqa: E402
from sightline.v1 import camera_control_pb2, errors_pb2, session_pb2  # noqa: E402

KINDS = {"opened": "SessionOpened", "camera": "CameraReply", "refused": "TickError"}
PRESENT = {"opened": session_pb2.SessionOpened, "camera": session_pb2.CameraReply, "refused": errors_pb2.TickError}
ANSWERS, CONTRACT = HERE / "former" / "answers", HERE / "former" / "contract.binpb"


def former_types():
    """The messages of version 0.1, from its own descriptor."""
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(CONTRACT.read_bytes()).file:
        pool.Add(file)
    factory = message_factory.MessageFactory(pool)
    return {kind: factory.GetPrototype(pool.FindMessageTypeByName(f"sightline.v1.{name}")) for kind, name in KINDS.items()}


FORMER = former_types()


def former_modules(folder):
    """Puts the former client and its generated messages into a folder."""
    files = [f.name for f in descriptor_pb2.FileDescriptorSet.FromString(CONTRACT.read_bytes()).file if not f.name.startswith("google/protobuf/")]
    subprocess.run(["protoc", f"--descriptor_set_in={CONTRACT}", f"--python_out={folder}", f"--grpc_python_out={folder}",
                    f"--plugin=protoc-gen-grpc_python={shutil.which('grpc_python_plugin')}", *files], check=True)
    shutil.copy(HERE / "former" / "sightline_client.py", folder)


def play(modules, address):
    """The answers that a client gets: (kind, bytes)."""
    result = subprocess.run([sys.executable, str(HERE / "session.py"), address], capture_output=True, text=True, timeout=120,
                            env={**os.environ, "PYTHONPATH": str(modules)})
    if result.returncode != 0:
        raise AssertionError(result.stderr)
    return [(kind, bytes.fromhex(rest[0]) if rest else b"") for kind, *rest in map(str.split, result.stdout.splitlines())]


def told(kind, data, types):
    """What the bytes say, without what differs from run to run."""
    message = types[kind].FromString(data)
    for field in ("stage_times", "session_id", "recording_file"):
        if field in message.DESCRIPTOR.fields_by_name:
            message.ClearField(field)
    return json_format.MessageToDict(message)


def inside(part, whole, path=""):
    """The first place where `whole` does not say what `part` says; None if there is none."""
    if isinstance(part, dict):
        return next((found for name, value in part.items() if (found := inside(value, (whole or {}).get(name), f"{path}.{name}"))), None)
    if isinstance(part, list):
        if not isinstance(whole, list) or len(whole) != len(part):
            return path
        return next((found for i, value in enumerate(part) if (found := inside(value, whole[i], f"{path}[{i}]"))), None)
    return None if part == whole else f"{path}: {part} and {whole}"


class FormerDaemon:
    """Answers each message of a session with the bytes that are kept."""

    def __init__(self, answers):
        self.answers = answers
        self.server = grpc.server(concurrent.futures.ThreadPoolExecutor(4))
        handler = grpc.stream_stream_rpc_method_handler(self.control)
        self.server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler("sightline.v1.CameraControlService", {"Control": handler}),))
        self.port = self.server.add_insecure_port("127.0.0.1:0")
        self.server.start()

    def control(self, requests, _context):
        for _, answer in zip(requests, self.answers):
            yield answer
        for _ in requests:  # until the client closes its side
            pass

    def __enter__(self):
        return f"127.0.0.1:{self.port}"

    def __exit__(self, *_):
        self.server.stop(None)


def wrapped(answers):
    """As messages of the stream, in the former contract."""
    number = {"opened": 1, "camera": 2, "refused": 3}
    out = []
    for kind, data in answers:
        length, size = b"", len(data)
        while size > 127:
            length, size = length + bytes([size & 127 | 128]), size >> 7
        out.append(bytes([number[kind] << 3 | 2]) + length + bytes([size]) + data)
    return out


def read_answers():
    """The kept answers, numbered as the ticks of session.py are."""
    data, out = ANSWERS.read_bytes(), []
    while data:
        kind, length = struct.unpack_from("<BI", data)
        name = list(KINDS)[kind]
        message = FORMER[name].FromString(data[5:5 + length])
        if name != "opened":
            message.sequence = len(out)
        out.append((name, message.SerializeToString()))
        data = data[5 + length:]
    return out


def write_answers(answers):
    ANSWERS.write_bytes(b"".join(struct.pack("<BI", list(KINDS).index(kind), len(data)) + data for kind, data in answers))


class Skew(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        former_modules(cls.folder.name)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def assert_whole(self, answers):
        self.assertEqual([kind for kind, _ in answers], ["opened"] + 70 * ["camera"] + ["refused"] + 19 * ["camera"])

    def test_the_former_client_gets_what_the_present_one_gets(self):
        with attack.Daemon() as daemon:
            former, present = play(self.folder.name, daemon.address), play(STUBS, daemon.address)
        self.assert_whole(former)
        self.assert_whole(present)
        for (kind, old), (_, new) in zip(former, present):
            # Only the present client asks for a session that outlives its stream.
            asked = {name: value for name, value in told(kind, new, PRESENT).items() if name not in ("resumeToken", "resumeGraceS")}
            self.assertEqual(told(kind, old, PRESENT), asked)

    def test_the_present_client_understands_the_former_daemon(self):
        if FORMER_DAEMON:
            with unittest.mock.patch.object(attack.Daemon, "path", FORMER_DAEMON), attack.Daemon() as daemon:
                answers, present = play(self.folder.name, daemon.address), play(STUBS, daemon.address)
            if KEEP:
                write_answers(answers)
        else:
            answers = read_answers()
            with FormerDaemon(wrapped(answers)) as address:
                present = play(STUBS, address)
        self.assertEqual([kind for kind, _ in present], [kind for kind, _ in answers])
        self.assertEqual(len(present), 91)
        for (kind, old), (_, new) in zip(answers, present):
            former = told(kind, old, FORMER)
            self.assertTrue(former)
            # Everything that the former contract reads in the bytes, the present client reads as well.
            self.assertIsNone(inside(former, told(kind, new, PRESENT)))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
