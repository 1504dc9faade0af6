"""The format's own reader and writer (PyPI: mcap) beside the command: what `info`, `dump`, `cut` and `recover` say and make.

usage: official_recordings_test.py MCAP_SAMPLE SIGHTLINE
"""
import json
import os
import random
import subprocess
import sys
import tempfile
import unittest

from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf import descriptor_pb2, descriptor_pool, json_format, message_factory
from mcap.reader import NonSeekingReader, SeekingReader
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory
from mcap_protobuf.schema import register_schema
from mcap_protobuf.writer import Writer as ProtobufWriter

SAMPLE, SIGHTLINE = sys.argv[1:3]
del sys.argv[1:]
SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND


def run(*words, status=0):
    done = subprocess.run([SIGHTLINE, *words], capture_output=True, text=True, timeout=120)
    assert done.returncode == status, (words, done.returncode, done.stdout[-2000:], done.stderr[-2000:])
    return done


def number(text):
    """-0 is a number of its own, and no int."""
    return -0.0 if text == "-0" else int(text)


def plain(path, **options):
    with open(path, "rb") as stream:
        return [(c.topic, m.sequence, m.log_time, m.publish_time, m.data)
                for _, c, m in SeekingReader(stream, validate_crcs=True).iter_messages(log_time_order=False, **options)]


def straight(path):
    with open(path, "rb") as stream:
        return [(c.topic, m.sequence, m.log_time, m.publish_time, m.data)
                for _, c, m in NonSeekingReader(stream, validate_crcs=True).iter_messages(log_time_order=False)]


def decoded(path):
    """Every message of the file with its own class."""
    with open(path, "rb") as stream:
        reader = NonSeekingReader(stream, decoder_factories=[DecoderFactory()])
        return [(m.channel.topic, m.message.sequence, m.message.log_time, m.message.publish_time, m.decoded_message)
                for m in reader.iter_decoded_messages(log_time_order=False)]


def odd_message():
    """A type that is in no program here: proto2, with what is seldom used."""
    file = descriptor_pb2.FileDescriptorProto(name="odd.proto", package="odd", syntax="proto2")
    file.dependency.append("google/protobuf/timestamp.proto")
    kind = file.enum_type.add(name="Kind")
    kind.value.add(name="NONE", number=0)
    kind.value.add(name="BIG", number=7)
    odd = file.message_type.add(name="Odd")
    F = descriptor_pb2.FieldDescriptorProto
    odd.field.add(name="must", number=1, type=F.TYPE_INT64, label=F.LABEL_REQUIRED)
    odd.field.add(name="raw", number=2, type=F.TYPE_BYTES, label=F.LABEL_OPTIONAL)
    odd.field.add(name="kind", number=3, type=F.TYPE_ENUM, type_name=".odd.Kind", label=F.LABEL_OPTIONAL)
    odd.field.add(name="inner", number=4, type=F.TYPE_MESSAGE, type_name=".odd.Odd", label=F.LABEL_REPEATED)
    odd.field.add(name="when", number=5, type=F.TYPE_MESSAGE, type_name=".google.protobuf.Timestamp",
                  label=F.LABEL_OPTIONAL)
    odd.field.add(name="snake_case", number=6, type=F.TYPE_DOUBLE, label=F.LABEL_REPEATED)
    pool = descriptor_pool.DescriptorPool()
    from google.protobuf import timestamp_pb2
    pool.AddSerializedFile(timestamp_pb2.DESCRIPTOR.serialized_pb)
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("odd.Odd"))


class Files(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        subprocess.run([SAMPLE, "session", cls.folder.name], check=True, timeout=120)
        [name] = os.listdir(cls.folder.name)
        cls.session = os.path.join(cls.folder.name, name)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def path(self, name):
        path = os.path.join(self.folder.name, name)
        if os.path.exists(path):
            os.remove(path)
        return path

    def check_dump(self, path):
        lines = [json.loads(line, parse_int=number) for line in run("dump", path).stdout.splitlines()]
        expected = decoded(path)
        self.assertEqual(len(lines), len(expected))
        for line, (topic, sequence, log_time, publish_time, message) in zip(lines, expected):
            self.assertEqual((line["topic"], line["sequence"], line["log_time_ns"], line["publish_time_ns"]),
                             (topic, sequence, log_time, publish_time))
            self.assertEqual(json_format.ParseDict(line["message"], type(message)()), message)
        return len(lines)

    def test_dump_is_what_the_official_reader_decodes(self):
        self.assertGreater(self.check_dump(self.session), 600 * 6)

    def test_info_counts_what_the_official_reader_counts(self):
        told = json.loads(run("info", "--json", self.session).stdout)
        with open(self.session, "rb") as stream:
            summary = SeekingReader(stream).get_summary()
        counts = {summary.channels[c].topic: n for c, n in summary.statistics.channel_message_counts.items()}
        self.assertEqual({t["topic"]: t["messages"] for t in told["topics"]}, counts)
        self.assertEqual({t["topic"]: t["type"] for t in told["topics"]},
                         {c.topic: summary.schemas[c.schema_id].name for c in summary.channels.values()})
        self.assertEqual(told["chunks"]["count"], summary.statistics.chunk_count)
        self.assertEqual(told["chunks"]["unpacked_bytes"], sum(c.uncompressed_size for c in summary.chunk_indexes))
        self.assertEqual((told["first_time_ns"], told["last_time_ns"]),
                         (summary.statistics.message_start_time, summary.statistics.message_end_time))
        self.assertEqual([a["name"] for a in told["attachments"]], [a.name for a in summary.attachment_indexes])
        self.assertEqual((told["session"]["id"], told["session"]["seed"], told["session"]["ticks"]), ("sample", 7, 600))

    def test_a_prefix_is_the_beginning(self):
        out = self.path("prefix.mcap")
        run("cut", self.session, "--out", out, "--end", "4")
        whole = straight(self.session)
        got = plain(out)
        self.assertEqual(got, whole[:len(got)])
        self.assertEqual(got, straight(out))
        self.assertLess(got[-1][2], START + 4 * SECOND)
        self.assertGreaterEqual(whole[len(got)][2], START + 4 * SECOND)

    def test_a_cut_from_within_has_a_lead_and_the_same_messages(self):
        # 4000: between a tick and its reply.
        for start_ms in (4010, 4000):
            with self.subTest(start_ms=start_ms):
                self.check_cut(start_ms)

    def check_cut(self, start_ms):
        out = self.path("part.mcap")
        run("cut", self.session, "--out", out, "--start", str(start_ms / 1000), "--end", "6")
        self.assertEqual(json.loads(run("verify", "--json", out).stdout)["sound"], True)
        inside = [m for m in straight(self.session) if START + start_ms * 1_000_000 <= m[2] < START + 6 * SECOND]
        got = plain(out)
        self.assertEqual(got[-len(inside):], inside)
        head = got[:-len(inside)]
        # So near the beginning the session's own messages lead in, without those for viewers, whose still frames come last.
        before = [m for m in straight(self.session) if m[2] < START + start_ms * 1_000_000]
        self.assertEqual(head[:-2], [m for m in before if m[0].startswith("/sightline/") and m[0] != "/sightline/visibility"])
        self.assertEqual([m[0] for m in head[-2:]], ["/tf_static", "/scene/shapes"])
        self.assertEqual(self.check_dump(out), len(got))
        self.assertEqual(decoded(out)[0][4].snapshot_ticks, 0)
        with open(out, "rb") as stream:
            reader = SeekingReader(stream, validate_crcs=True)
            self.assertEqual([(a.name, len(a.data)) for a in reader.iter_attachments()], [("scene.glb", 5000)])
            self.assertEqual({m.name for m in reader.iter_metadata()}, {"sightline", "sightline.cut"})

    def test_what_recover_makes_is_whole_and_from_the_file(self):
        with open(self.session, "rb") as stream:
            whole = stream.read()
        expected = set(straight(self.session))
        dice = random.Random(6)
        for _ in range(6):
            damaged = bytearray(whole[:dice.randrange(len(whole) // 2, len(whole))])
            damaged[dice.randrange(len(whole) // 10, len(damaged))] ^= 0x55
            broken, out = self.path("broken.mcap"), self.path("copy.mcap")
            with open(broken, "wb") as stream:
                stream.write(damaged)
            self.assertEqual(run("verify", broken, status=1).stderr, "")
            told = subprocess.run([SIGHTLINE, "recover", broken, "--out", out], capture_output=True, text=True, timeout=120)
            self.assertEqual(told.returncode, 0 if "\nlost        nothing\n" in told.stdout else 1, told.stdout)
            run("verify", out)
            got = plain(out)
            self.assertEqual(got, straight(out))
            self.assertTrue(set(got) <= expected)
            self.assertGreater(len(got), len(expected) // 3)

    def test_foreign_protobuf_is_dumped_by_its_own_schema(self):
        path = self.path("foreign.mcap")
        odd = odd_message()
        with open(path, "wb") as stream, ProtobufWriter(stream) as writer:
            for i in range(50):
                update = SceneUpdate()
                update.deletions.add(id=f"\u00fc{i}").timestamp.seconds = i
                entity = update.entities.add(id="a \"quoted\" name")
                entity.lifetime.seconds, entity.lifetime.nanos = i, 500_000_000
                entity.lines.add().points.add(x=0.1 * i, y=float("inf"))
                writer.write_message("/scene", update, log_time=i * SECOND, publish_time=i)
                message = odd(must=-i - 2**60, raw=bytes(range(i)), kind=7, snake_case=[i / 3, float("-inf")])
                message.inner.add(must=1).inner.add(must=2)
                message.when.seconds = i
                writer.write_message("/odd", message, log_time=i * SECOND, publish_time=i)
        self.assertEqual(self.check_dump(path), 100)
        self.assertEqual(len(run("dump", path, "--topic", "/odd", "--start", "10", "--end", "20").stdout.splitlines()), 10)
        run("verify", path)
        self.assertIsNone(json.loads(run("info", "--json", path).stdout)["session"])
        run("cut", path, "--out", self.path("none.mcap"), status=1)

    def test_messages_too_deep_to_print_are_told_and_not_printed(self):
        path = self.path("deep.mcap")
        writer = Writer(path)
        writer.start()
        channel = writer.register_channel("/odd", "protobuf", register_schema(writer, odd_message()))
        for depth in (20, 90, 3000):
            data = b"\x08\x01"
            for _ in range(depth):  # must = 1, and inner, a length and itself
                size, length = len(data), b""
                while size > 127:
                    length, size = length + bytes([size % 128 + 128]), size // 128
                data = b"\x08\x01\x22" + length + bytes([size]) + data
            writer.add_message(channel, log_time=depth, publish_time=0, sequence=depth, data=data)
        writer.finish()
        lines = [json.loads(line) for line in run("dump", path, status=1).stdout.splitlines()]
        self.assertIn("message", lines[0])
        self.assertIn("error", lines[2])

    def test_foreign_json_is_dumped_as_it_is(self):
        path = self.path("json.mcap")
        writer = Writer(path)
        writer.start()
        schema = writer.register_schema("A", "jsonschema", b"{}")
        good = writer.register_channel("/good", "json", schema)
        strange = writer.register_channel("/strange", "x-own", schema)
        for i in range(20):
            writer.add_message(good, log_time=i, publish_time=i, sequence=i, data=json.dumps({"i": [i, None]}).encode())
        writer.finish()
        lines = [json.loads(line) for line in run("dump", path).stdout.splitlines()]
        self.assertEqual([line["message"] for line in lines], [{"i": [i, None]} for i in range(20)])

        writer = Writer(path)
        writer.start()
        schema = writer.register_schema("A", "jsonschema", b"{}")
        for topic, encoding in (("/strange", "x-own"), ("/broken", "json"), ("/lie", "protobuf")):
            channel = writer.register_channel(topic, encoding, schema)
            writer.add_message(channel, log_time=1, publish_time=1, sequence=1, data=b"\xff\x00{")
        writer.finish()
        done = run("dump", path, status=1)
        lines = [json.loads(line) for line in done.stdout.splitlines()]
        self.assertEqual([line["topic"] for line in lines], ["/strange", "/broken", "/lie"])
        self.assertTrue(all(line["error"] for line in lines))
        self.assertIn("3 messages cannot be decoded", done.stderr)

    def test_a_reader_that_has_enough_ends_a_dump_quietly(self):
        with subprocess.Popen([SIGHTLINE, "dump", self.session], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as dump:
            json.loads(dump.stdout.readline())
            dump.stdout.close()
            self.assertEqual(dump.wait(timeout=60), 0)
            self.assertEqual(dump.stderr.read(), b"")

    def test_every_verb_has_a_manual_and_refuses_wrong_flags(self):
        for verb in ("info", "verify", "recover", "dump", "cut"):
            self.assertIn(verb, run("--help").stdout)
            self.assertGreater(len(run(verb, "--help").stdout.splitlines()), 3)
            for words in ((), ("a.mcap", "--warp")):
                done = subprocess.run([SIGHTLINE, verb, *words], capture_output=True, text=True, timeout=60)
                self.assertGreater(done.returncode, 1)
                self.assertTrue(done.stderr)
        run("cut", self.session, "--out", self.path("x.mcap"), "--start", "2", "--end", "1", status=2)


if __name__ == "__main__":
    unittest.main()
