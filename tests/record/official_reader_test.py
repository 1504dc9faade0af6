"""The format's own reader and writer (PyPI: mcap) hold our files to the letter, and ours reads theirs.

usage: official_reader_test.py MCAP_SAMPLE
"""
import binascii
import importlib
import io
import os
import random
import struct
import subprocess
import sys
import tempfile
import unittest

import mcap.exceptions
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from mcap.reader import NonSeekingReader, SeekingReader
from mcap.writer import CompressionType, IndexType, Writer
from mcap_protobuf.decoder import DecoderFactory

SAMPLE = sys.argv.pop(1)
SECOND = 1_000_000_000


def sample(*words, fails=False):
    done = subprocess.run([SAMPLE, *words], capture_output=True, text=True, timeout=120)
    assert fails or done.returncode == 0, done.stdout + done.stderr
    return done.stdout.splitlines()


def as_line(channel, message):
    return (f"{channel.topic} {message.sequence} {message.log_time} {message.publish_time} "
            f"{message.data.hex()}")


class CountedFile(io.BytesIO):
    """Counts what is read of a file."""

    def __init__(self, path):
        with open(path, "rb") as stream:
            super().__init__(stream.read())
        self.count = 0

    def read(self, size=-1):
        data = super().read(size)
        self.count += len(data)
        return data


class OurFiles(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)

    def path(self, name):
        return os.path.join(self.folder.name, name)

    def read(self, path, reader=SeekingReader, **options):
        with open(path, "rb") as stream:
            return [as_line(c, m) for _, c, m in reader(stream, validate_crcs=True).iter_messages(**options)]

    def test_both_readers_give_every_message_with_all_crcs_checked(self):
        expected = sample("small", self.path("a.mcap"))
        self.assertEqual(len(expected), 40)
        self.assertEqual(self.read(self.path("a.mcap")), expected)
        self.assertEqual(self.read(self.path("a.mcap"), NonSeekingReader, log_time_order=False), expected)

    def test_a_wrong_crc_would_have_been_noticed(self):
        sample("small", self.path("a.mcap"))
        with open(self.path("a.mcap"), "r+b") as stream:
            stream.seek(-200, os.SEEK_END)
            byte = stream.read(1)
            stream.seek(-200, os.SEEK_END)
            stream.write(bytes([byte[0] ^ 1]))
        with open(self.path("a.mcap"), "rb") as stream:
            data = stream.read()
        footer = len(data) - 8 - 20
        summary_start, _, crc = struct.unpack("<QQI", data[footer:footer + 20])
        self.assertNotEqual(binascii.crc32(data[summary_start:footer + 16]), crc)

    def test_the_summary_crc_is_that_of_the_specification(self):
        sample("small", self.path("a.mcap"))
        with open(self.path("a.mcap"), "rb") as stream:
            data = stream.read()
        footer = len(data) - 8 - 20
        summary_start, _, crc = struct.unpack("<QQI", data[footer:footer + 20])
        self.assertEqual(binascii.crc32(data[summary_start:footer + 16]), crc)

    def test_summary_attachment_and_metadata(self):
        sample("small", self.path("a.mcap"))
        with open(self.path("a.mcap"), "rb") as stream:
            reader = SeekingReader(stream, validate_crcs=True)
            summary = reader.get_summary()
            self.assertEqual(summary.statistics.message_count, 40)
            self.assertEqual(summary.statistics.channel_message_counts, {1: 20, 2: 20})
            self.assertEqual(summary.statistics.chunk_count, len(summary.chunk_indexes))
            self.assertEqual(summary.statistics.message_start_time, 100 * SECOND)
            self.assertEqual({c.topic for c in summary.channels.values()}, {"/tick", "/reply"})
            for index in summary.chunk_indexes:
                self.assertEqual(index.compression, "zstd")
                self.assertLess(index.message_end_time - index.message_start_time, SECOND / 2)
            attachments = list(reader.iter_attachments())
            self.assertEqual([(a.name, len(a.data)) for a in attachments], [("scene.glb", 700)])
            self.assertEqual([(m.name, m.metadata) for m in reader.iter_metadata()],
                             [("about", {"seed": "7", "build": "test"})])

    def test_the_index_serves_ranges_of_time(self):
        expected = sample("small", self.path("a.mcap"))
        start, end = 101 * SECOND, 102 * SECOND + SECOND // 2
        wanted = [line for line in expected if start <= int(line.split()[2]) < end]
        self.assertEqual(self.read(self.path("a.mcap"), start_time=start, end_time=end), wanted)
        self.assertEqual(self.read(self.path("a.mcap"), start_time=start, end_time=end, topics=["/tick"]),
                         [line for line in wanted if line.startswith("/tick ")])

    def test_an_unfinished_file_can_be_read_without_repair(self):
        expected = sample("unfinished", self.path("a.mcap"))
        got = []
        with open(self.path("a.mcap"), "rb") as stream:
            try:
                for _, channel, message in NonSeekingReader(stream, validate_crcs=True).iter_messages(
                        log_time_order=False):
                    got.append(as_line(channel, message))
            except (mcap.exceptions.EndOfFile, mcap.exceptions.McapError):
                pass
        self.assertEqual(got, expected)

    def test_what_recover_makes_is_a_whole_file(self):
        expected = sample("small", self.path("a.mcap"))
        with open(self.path("a.mcap"), "rb") as stream:
            whole = stream.read()
        dice = random.Random(5)
        for turn in range(20):
            damaged = bytearray(whole[:dice.randrange(len(whole) // 2, len(whole))])
            damaged[dice.randrange(600, len(damaged))] ^= 0x55
            with open(self.path(f"d{turn}.mcap"), "wb") as stream:
                stream.write(damaged)
            sample("recover", self.path(f"d{turn}.mcap"), self.path(f"r{turn}.mcap"))
            got = self.read(self.path(f"r{turn}.mcap"))
            self.assertEqual(got, self.read(self.path(f"r{turn}.mcap"), NonSeekingReader))
            self.assertTrue(set(got) <= set(expected))


class ASession(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.warnings = sample("session", cls.folder.name)
        [name] = os.listdir(cls.folder.name)
        cls.path = os.path.join(cls.folder.name, name)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def decoded(self, *topics, **options):
        with open(self.path, "rb") as stream:
            reader = SeekingReader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            return [m.decoded_message for m in reader.iter_decoded_messages(topics=topics, **options)]

    def test_ticks_and_replies_are_the_wire_messages(self):
        self.assertEqual(self.warnings, [])
        self.assertEqual([t.sequence for t in self.decoded("/sightline/tick")], list(range(1, 601)))
        replies = self.decoded("/sightline/reply")
        self.assertEqual([r.pose.position.x for r in replies], list(range(1, 601)))
        [info] = self.decoded("/sightline/info")
        self.assertEqual((info.session_id, info.seed, info.part), ("sample", 7, 1))
        [opened] = self.decoded("/sightline/open")
        self.assertEqual(opened.instances[0].shape.box.half_extent.z, 30)

    def test_seeking_reads_only_what_it_needs(self):
        start = 1_700_000_005 * SECOND
        stream = CountedFile(self.path)
        reader = SeekingReader(stream, validate_crcs=True)
        first = next(reader.iter_messages(topics=["/sightline/reply"], start_time=start, end_time=start + SECOND))
        self.assertGreaterEqual(first[2].log_time, start)
        self.assertLess(stream.count, os.path.getsize(self.path) / 2)

    def test_viewers_see_the_camera_where_it_is(self):
        # Unreal (x, y, z) cm is glTF (x, z, y), and the viewer's world (z, x, y) of glTF's: (y, x, z), metres.
        frames = self.decoded("/tf")
        self.assertEqual(len(frames), 600)
        [camera] = [t for t in frames[99].transforms if t.child_frame_id == "camera"]
        self.assertEqual(camera.parent_frame_id, "world")
        self.assertAlmostEqual(camera.translation.x, 0.0)
        self.assertAlmostEqual(camera.translation.y, 1.0)
        self.assertAlmostEqual(camera.translation.z, 2.0)
        # Looking along Unreal's +X: the viewer's +Y, a quarter turn about +Z from its camera's own +X.
        self.assertAlmostEqual(abs(camera.rotation.z), 0.5 ** 0.5)
        self.assertAlmostEqual(camera.rotation.z, camera.rotation.w)
        self.assertEqual({t.child_frame_id for t in frames[99].transforms}, {"camera", "instance/9"})

    def test_shapes_have_their_size_and_place(self):
        [shapes] = self.decoded("/scene/shapes")
        box = next(e for e in shapes.entities if e.id == "instance/5")
        size = box.cubes[0].size
        for got, expected in zip((size.x, size.y, size.z), (0.4, 0.2, 0.6)):
            self.assertAlmostEqual(got, expected)
        [still] = self.decoded("/tf_static")
        place = next(t for t in still.transforms if t.child_frame_id == "instance/5").translation
        for got, expected in zip((place.x, place.y, place.z), (2.0, 1.0, 3.0)):
            self.assertAlmostEqual(got, expected)
        capsule = next(e for e in shapes.entities if e.id == "instance/9")
        self.assertAlmostEqual(capsule.cylinders[0].size.z, 1.2)
        self.assertAlmostEqual(capsule.cylinders[0].size.x, 0.6)
        self.assertEqual(len(capsule.spheres), 2)

    def test_the_lens_is_the_replys(self):
        calibration = self.decoded("/camera/calibration")[0]
        # Unreal's field of view is horizontal: 90 degrees over 1280 pixels.
        self.assertAlmostEqual(calibration.K[0], 640.0, places=6)
        self.assertAlmostEqual(calibration.K[4], 640.0, places=6)
        self.assertEqual((calibration.width, calibration.height), (1280, 720))

    def test_sight_lines_and_log_tell_who_is_seen(self):
        sights = self.decoded("/scene/sight")
        def text_of(sight):
            return next(e for e in sight.entities if e.id == "sight").texts[0].text
        self.assertEqual((text_of(sights[0]), text_of(sights[-1])), ("target 9: 100 %", "target 9: 50 %"))
        self.assertEqual([m.message.split(":")[0] for m in self.decoded("/log")], ["TRACKING", "PARTIAL_VIEW"])
        visible = self.decoded("/sightline/visibility")
        self.assertEqual([v.targets[0].filtered_share for v in visible[298:300]], [1.0, 0.5])

    def test_viewer_schemas_are_the_published_ones(self):
        """Every message of the package foxglove: the same fields, numbers and types as in the viewers' own definitions."""
        with open(self.path, "rb") as stream:
            schemas = SeekingReader(stream).get_summary().schemas.values()
        compared = set()
        for schema in schemas:
            self.assertEqual(schema.encoding, "protobuf")
            files = FileDescriptorSet.FromString(schema.data)
            for message in (m for f in files.file if f.package == "foxglove" for m in f.message_type):
                module = importlib.import_module(f"foxglove_schemas_protobuf.{message.name}_pb2")
                official = module.DESCRIPTOR.message_types_by_name[message.name]
                self.assertEqual({(f.name, f.number, f.type, f.type_name.lstrip(".")) for f in message.field},
                                 {(f.name, f.number, f.type,
                                   (f.message_type or f.enum_type).full_name if f.message_type or f.enum_type else "")
                                  for f in official.fields}, message.name)
                for enum in message.enum_type:
                    self.assertEqual({(v.name, v.number) for v in enum.value},
                                     {(v.name, v.number) for v in official.enum_types_by_name[enum.name].values})
                compared.add(message.name)
        self.assertTrue({"FrameTransforms", "SceneUpdate", "SceneEntity", "PoseInFrame", "CameraCalibration", "Log"}
                        <= compared)


class TheirFiles(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = os.path.join(self.folder.name, "theirs.mcap")

    def write(self, finish=True, **options):
        lines = []
        writer = Writer(self.path, **options)
        writer.start(profile="x-test")
        schema = writer.register_schema("A", "jsonschema", b"{}")
        channels = [writer.register_channel(t, "json", schema) for t in ("/a", "/b")]
        for i in range(300):
            data = b'{"i": %d}' % i
            writer.add_message(channels[i % 2], log_time=i * SECOND, publish_time=i, sequence=i, data=data)
            lines.append(f"{'/a' if i % 2 == 0 else '/b'} {i} {i * SECOND} {i} {data.hex()}")
        writer.add_attachment(1, 2, "n", "text/plain", b"hello")
        writer.add_metadata("m", {"k": "v"})
        writer.finish()
        return lines

    def test_every_way_of_writing_is_read(self):
        for options in ({}, {"compression": CompressionType.NONE}, {"use_chunking": False},
                        {"index_types": IndexType.NONE}, {"use_statistics": False}, {"use_summary_offsets": False},
                        {"repeat_channels": False, "repeat_schemas": False}, {"enable_crcs": False},
                        {"enable_data_crcs": True}):
            lines = self.write(chunk_size=1000, **options)
            got = sample("read", self.path)
            self.assertEqual([line for line in got if line.startswith("/")], lines, options)
            self.assertFalse([line for line in got if line.startswith("trouble")
                              and "summary" not in line], (options, got[-3:]))

    def test_a_range_reads_the_chunks_of_the_range(self):
        lines = self.write(chunk_size=1000)
        got = sample("read", self.path, str(100 * SECOND), str(110 * SECOND))
        self.assertEqual([line for line in got if line.startswith("/")], lines[100:110])
        [chunks] = [line for line in got if line.startswith("chunks read")]
        self.assertLessEqual(int(chunks.split()[-1]), 2)

    def test_lz4_is_read(self):
        lines = self.write(compression=CompressionType.LZ4)
        got = sample("read", self.path)
        self.assertEqual([line for line in got if line.startswith("/")], lines)
        self.assertFalse([line for line in got if line.startswith("trouble")], got)


if __name__ == "__main__":
    unittest.main()
