"""What the format's own library makes of a recording, `sightline` still reads: sorted, filtered, packed in other ways, without indexes.

usage: other_tools_test.py MAKE_RECORDING SIGHTLINE
"""
import json
import os
import subprocess
import sys
import tempfile
import unittest

from mcap.reader import NonSeekingReader, SeekingReader
from mcap.records import Channel, DataEnd, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer

MAKE_RECORDING, SIGHTLINE = sys.argv[1:3]
del sys.argv[1:]


def run(*words, status=0):
    done = subprocess.run([SIGHTLINE, *words], capture_output=True, text=True, timeout=120)
    assert done.returncode == status, (words, done.returncode, done.stdout[-2000:], done.stderr[-2000:])
    return done


def messages_of(path, by_time=False):
    with open(path, "rb") as stream:
        reader = SeekingReader(stream, validate_crcs=True) if by_time else NonSeekingReader(stream, validate_crcs=True)
        return list(reader.iter_messages(log_time_order=by_time))


def rewrite(messages, path, **options):
    """A file of other settings with these (schema, channel, message), as a tool would copy them."""
    with open(path, "wb") as stream:
        writer = Writer(stream, **options)
        writer.start()
        schemas, channels = {}, {}
        for schema, channel, message in messages:
            key = (schema.name, channel.topic)
            if schema.name not in schemas:
                schemas[schema.name] = writer.register_schema(schema.name, schema.encoding, schema.data)
            if key not in channels:
                channels[key] = writer.register_channel(channel.topic, channel.message_encoding, schemas[schema.name])
            writer.add_message(channels[key], message.log_time, message.data, message.publish_time, message.sequence)
        writer.finish()


class OtherTools(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.path = os.path.join(cls.folder.name, "yard.mcap")
        subprocess.run([MAKE_RECORDING, cls.folder.name], check=True, timeout=120)

    def copy(self, messages, **options):
        path = os.path.join(self.folder.name, f"{self.id()}.mcap")
        rewrite(messages, path, **options)
        return path

    def replays_equal(self, path):
        self.assertRegex(run("replay", path).stdout, r"\nresult +equal\n")

    def test_the_recording_itself_replays_equal(self):
        self.replays_equal(self.path)

    def test_log_times_never_go_back_and_the_info_is_in_front(self):
        messages = messages_of(self.path)
        times = [message.log_time for _, _, message in messages]
        self.assertEqual(times, sorted(times))
        self.assertEqual(messages[0][1].topic, "/sightline/info")
        self.assertEqual(messages[0][2].log_time, messages[1][2].log_time)

    def test_a_schema_or_channel_stands_once_in_the_data(self):
        # `mcap doctor` warns of duplicates.
        names = []
        with open(self.path, "rb") as stream:
            for record in StreamReader(stream).records:
                if isinstance(record, DataEnd):
                    break
                if isinstance(record, (Schema, Channel)):
                    names.append((type(record).__name__, record.id))
        self.assertEqual(sorted(names), sorted(set(names)))
        told = json.loads(run("info", "--json", self.path).stdout)
        self.assertEqual([name for name, _ in names].count("Channel"), len(told["topics"]))

    def test_sorted(self):
        self.replays_equal(self.copy(messages_of(self.path, by_time=True)))

    def test_the_info_is_found_wherever_it_is(self):
        messages = messages_of(self.path)
        self.replays_equal(self.copy(messages[1:] + messages[:1], chunk_size=2000))

    def test_filtered(self):
        kept = [m for m in messages_of(self.path) if m[1].topic.startswith("/sightline/")]
        self.assertLess(len(kept), len(messages_of(self.path)))
        self.replays_equal(self.copy(kept))

    def test_packed_in_every_way(self):
        for compression in CompressionType:
            with self.subTest(compression.name):
                path = self.copy(messages_of(self.path), compression=compression)
                self.replays_equal(path)
                run("verify", path)
                again = os.path.join(self.folder.name, f"again-{compression.name}.mcap")
                run("recover", path, "--out", again)
                self.replays_equal(again)

    def test_without_optional_parts(self):
        for options in ({"use_statistics": False}, {"index_types": IndexType.NONE}, {"use_chunking": False},
                        {"use_summary_offsets": False, "repeat_channels": False, "repeat_schemas": False}):
            with self.subTest(str(options)):
                path = self.copy(messages_of(self.path), **options)
                self.replays_equal(path)
                told = json.loads(run("verify", "--json", path).stdout)
                self.assertTrue(told["sound"], told)
                info = json.loads(run("info", "--json", path).stdout)
                whole = json.loads(run("info", "--json", self.path).stdout)
                self.assertEqual(info["session"]["replies"], whole["session"]["replies"])
                self.assertEqual(info["game_time"], whole["game_time"])
                if "use_statistics" in options:
                    self.assertIn("statistics", info["absent"])

    def test_two_sessions_in_one_file_are_named(self):
        messages = messages_of(self.path)
        renamed = []
        for schema, channel, message in messages:
            if channel.topic == "/sightline/info":
                message.data = message.data.replace(b"recorded-yard", b"another--yard")
            renamed.append((schema, channel, message))
        path = self.copy(messages_of(self.path) + renamed)
        error = run("replay", path, status=1).stderr
        self.assertIn("another--yard", error)
        self.assertIn("recorded-yard", error)
        self.assertIn("2 sessions", run("info", path).stdout)

    def test_a_recording_without_a_reply_is_not_called_equal(self):
        path = self.copy([m for m in messages_of(self.path) if m[1].topic != "/sightline/reply"])
        self.assertIn("nothing to compare", run("replay", path, status=1).stdout)


if __name__ == "__main__":
    unittest.main()
