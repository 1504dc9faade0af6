// A file reads back as it was written, with and without its index. official_reader_test.py checks with the format's own
// reader that the bytes are MCAP.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "server/record/mcap_recover.h"
#include "server/record/mcap_scanner.h"
#include "server/record/mcap_verify.h"
#include "tests/record/small_file.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using test::CountedSource;
using test::kSecondNs;
using test::PlainMessage;

// Accepts this many bytes and then no more.
class FullSink final : public ByteSink {
 public:
  explicit FullSink(size_t room) : room_(room) {}
  Status write(std::string_view bytes) override {
    if (bytes.size() > room_) return fail(ErrorCode::kResourceExhausted, "disk", "is full");
    room_ -= bytes.size();
    ++writes_;
    return {};
  }
  size_t writes() const { return writes_; }

 private:
  size_t room_;
  size_t writes_ = 0;
};

std::vector<PlainMessage> between(const std::vector<PlainMessage>& all, uint64_t start_ns, uint64_t end_ns) {
  std::vector<PlainMessage> some;
  for (const PlainMessage& m : all)
    if (m.log_time_ns >= start_ns && m.log_time_ns < end_ns) some.push_back(m);
  return some;
}

TEST(Mcap, GivesBackEveryMessageInOrder) {
  for (const int level : {0, 1, 9}) {
    const test::SmallFile file = test::make_small_file({.chunk_time = std::chrono::seconds(1), .zstd_level = level});
    const MemorySource source(file.bytes);
    const McapReader reader = McapReader::open(source, {}).value();
    EXPECT_TRUE(reader.info().from_summary);
    EXPECT_TRUE(reader.info().loss.none());
    EXPECT_EQ(test::read_all(reader), file.messages) << "zstd level " << level;
  }
}

TEST(Mcap, TellsWhatIsInside) {
  const test::SmallFile file = test::make_small_file();
  const MemorySource source(file.bytes);
  const McapReader reader = McapReader::open(source, {}).value();
  const McapInfo& info = reader.info();
  EXPECT_EQ(info.header.library, "sightline");
  ASSERT_EQ(info.channels.size(), 2u);
  EXPECT_EQ(info.channels.at(1).topic, "/tick");
  EXPECT_EQ(info.channels.at(1).metadata.at("frame"), "client");
  EXPECT_EQ(info.schemas.at(1).data, "not looked into");
  EXPECT_EQ(info.statistics.message_count, 40u);
  EXPECT_EQ(info.statistics.channel_message_counts, (std::map<uint16_t, uint64_t>{{1, 20}, {2, 20}}));
  EXPECT_EQ(info.statistics.start_time_ns, 100 * kSecondNs);
  EXPECT_EQ(info.statistics.end_time_ns, 100 * kSecondNs + 39 * kSecondNs / 10);
  EXPECT_EQ(info.statistics.chunk_count, info.chunks.size());
  ASSERT_EQ(info.attachments.size(), 1u);
  EXPECT_EQ(reader.attachment(info.attachments[0]).value(), file.attachment);
  ASSERT_EQ(info.metadata.size(), 1u);
  EXPECT_EQ(reader.metadata(info.metadata[0]).value().values.at("seed"), "7");
}

TEST(Mcap, AFileWithoutItsSummaryReadsTheSame) {
  const test::SmallFile file = test::make_small_file({.chunk_time = std::chrono::seconds(1)}, false);
  const MemorySource source(file.bytes);
  const McapReader reader = McapReader::open(source, {}).value();
  EXPECT_FALSE(reader.info().from_summary);
  EXPECT_FALSE(reader.info().finished);
  EXPECT_EQ(test::read_all(reader), file.messages);
  EXPECT_EQ(reader.info().statistics.channel_message_counts, (std::map<uint16_t, uint64_t>{{1, 20}, {2, 20}}));
  ASSERT_EQ(reader.info().attachments.size(), 1u);
  EXPECT_EQ(reader.info().attachments[0].name, "scene.glb");
  EXPECT_EQ(reader.info().attachments[0].data_size, file.attachment.size());
  EXPECT_EQ(reader.attachment(reader.info().attachments[0]).value(), file.attachment);
  EXPECT_EQ(reader.metadata(reader.info().metadata.at(0)).value().name, "about");
}

TEST(Mcap, ChunksAreBoundedByTimeAndBySize) {
  const test::SmallFile by_time = test::make_small_file({.chunk_time = std::chrono::milliseconds(500)});
  const MemorySource source(by_time.bytes);
  const McapReader reader = McapReader::open(source, {}).value();
  EXPECT_GE(reader.info().chunks.size(), 8u);
  for (const mcap::ChunkIndex& chunk : reader.info().chunks)
    EXPECT_LT(chunk.end_time_ns - chunk.start_time_ns, kSecondNs / 2);

  const test::SmallFile by_size = test::make_small_file({.chunk_bytes = 200, .chunk_time = std::chrono::hours(1)});
  const MemorySource other(by_size.bytes);
  const McapReader small = McapReader::open(other, {}).value();
  for (const mcap::ChunkIndex& chunk : small.info().chunks)
    EXPECT_LT(chunk.uncompressed_size, 200u + 9 + 22 + 50 + 200)
        << "no more than one message over, and a chunk's own definitions";
}

TEST(Mcap, ARangeOfTimeIsWhatAPlainFilterGives) {
  const test::SmallFile file = test::make_small_file();
  const MemorySource source(file.bytes);
  const McapReader reader = McapReader::open(source, {}).value();
  for (uint64_t start = 99; start < 106; ++start)
    for (uint64_t tenths = 0; tenths < 30; tenths += 3) {
      const uint64_t start_ns = start * kSecondNs, end_ns = start_ns + tenths * kSecondNs / 10;
      EXPECT_EQ(test::read_all(reader, {start_ns, end_ns, {}}), between(file.messages, start_ns, end_ns));
    }
}

TEST(Mcap, OnlyTheChunksOfTheRangeAreRead) {
  MemorySink sink;
  McapWriter writer(sink, {.zstd_level = 0});
  const uint16_t channel = writer.add_channel("/big", 0, "x-plain", {}).value();
  const std::string payload(20'000, 'x');
  for (uint64_t i = 0; i < 600; ++i) ASSERT_TRUE(writer.write(channel, i * kSecondNs, i * kSecondNs, payload));
  ASSERT_TRUE(writer.finish());
  const CountedSource source(sink.bytes());
  const McapReader reader = McapReader::open(source, {}).value();
  EXPECT_LT(source.take_count(), sink.bytes().size() / 50);
  McapReadReport report;
  EXPECT_EQ(test::read_all(reader, {300 * kSecondNs, 303 * kSecondNs, {}}, &report).size(), 3u);
  EXPECT_EQ(report.chunks_read, 3u);
  EXPECT_LT(source.take_count(), 4 * payload.size());
}

TEST(Mcap, TopicsAreChosenByName) {
  const test::SmallFile file = test::make_small_file();
  const MemorySource source(file.bytes);
  const McapReader reader = McapReader::open(source, {}).value();
  for (const PlainMessage& m : test::read_all(reader, {.topics = {"/reply"}})) EXPECT_EQ(m.topic, "/reply");
  EXPECT_EQ(test::read_all(reader, {.topics = {"/reply"}}).size(), 20u);
  EXPECT_TRUE(test::read_all(reader, {.topics = {"/none"}}).empty());
}

TEST(Mcap, AVisitorCanStop) {
  const test::SmallFile file = test::make_small_file();
  const MemorySource source(file.bytes);
  int seen = 0;
  McapReader::open(source, {}).value().read({}, [&](const McapMessage&) { return ++seen < 5; });
  EXPECT_EQ(seen, 5);
}

TEST(Mcap, LogTimesMayGoBack) {
  MemorySink sink;
  McapWriter writer(sink, {});
  const uint16_t channel = writer.add_channel("/t", 0, "", {}).value();
  for (const uint64_t time_ns : {500u, 300u, 400u}) ASSERT_TRUE(writer.write(channel, time_ns, 0, "m"));
  ASSERT_TRUE(writer.finish());
  const MemorySource source(sink.bytes());
  const McapReader reader = McapReader::open(source, {}).value();
  EXPECT_EQ(reader.info().statistics.start_time_ns, 300u);
  EXPECT_EQ(reader.info().statistics.end_time_ns, 500u);
  ASSERT_EQ(reader.info().chunks.size(), 1u);
  EXPECT_EQ(reader.info().chunks[0].start_time_ns, 300u);
  EXPECT_TRUE(verify_mcap(source, {}).value().sound());
}

TEST(Mcap, WhatIsRefusedLeavesTheFileSound) {
  MemorySink sink;
  McapWriter writer(sink, {});
  EXPECT_EQ(writer.add_channel("/t", 3, "", {}).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(writer.write(1, 0, 0, "m").error().code, ErrorCode::kNotFound);
  const uint16_t channel = writer.add_channel("/t", 0, "", {}).value();
  for (const int unknown : {0, channel + 1})
    EXPECT_EQ(writer.write(static_cast<uint16_t>(unknown), 0, 0, "m").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(writer.write(channel, 0, 0, std::string(kMaxMessageBytes + 1, 'x')).error().code,
            ErrorCode::kResourceExhausted);
  ASSERT_TRUE(writer.write(channel, 1, 1, "m"));
  ASSERT_TRUE(writer.finish());
  const MemorySource source(sink.bytes());
  EXPECT_TRUE(verify_mcap(source, {}).value().sound());
}

TEST(Mcap, TheLargestMessagesCanBeReadBack) {
  MemorySink sink;
  McapWriter writer(sink, {});
  const uint16_t channel = writer.add_channel("/t", 0, "", {}).value();
  for (uint64_t i = 0; i < 3; ++i) {
    ASSERT_TRUE(writer.write(channel, i, i, "small"));
    ASSERT_TRUE(writer.write(channel, i, i, std::string(kMaxMessageBytes, static_cast<char>('a' + i))));
  }
  ASSERT_TRUE(writer.finish());
  const MemorySource source(sink.bytes());
  McapReadReport report;
  const auto messages = test::read_all(McapReader::open(source, {}).value(), {}, &report);
  EXPECT_EQ(messages.size(), 6u);
  EXPECT_TRUE(report.loss.none());
}

TEST(Mcap, AFullDiskSticksAndWritesNothingMore) {
  for (size_t room = 0; room < 3000; room += 97) {
    FullSink sink(room);
    McapWriter writer(sink, {.chunk_bytes = 300, .zstd_level = 0});
    const Result<uint16_t> channel = writer.add_channel("/t", 0, "", {});
    Status last;
    for (uint64_t i = 0; i < 100 && last; ++i) last = writer.write(channel.value_or(1), i, i, std::string(100, 'x'));
    ASSERT_FALSE(last) << room;
    EXPECT_EQ(last.error().code, ErrorCode::kResourceExhausted);
    const size_t writes = sink.writes();
    EXPECT_FALSE(writer.end_chunk());
    EXPECT_FALSE(writer.finish());
    EXPECT_FALSE(writer.attach({}));
    EXPECT_EQ(sink.writes(), writes);
    EXPECT_LE(writer.bytes_written(), room);
  }
}

TEST(Mcap, VerifyFindsNothingInASoundFileAndCountsItsTopics) {
  const test::SmallFile file = test::make_small_file();
  const MemorySource source(file.bytes);
  const McapVerdict verdict = verify_mcap(source, {}).value();
  EXPECT_TRUE(verdict.sound());
  EXPECT_TRUE(verdict.summary_used);
  EXPECT_EQ(verdict.chunks_without_crc, 0u);
  EXPECT_EQ(verdict.topics.at("/tick").messages, 20u);
  EXPECT_EQ(verdict.topics.at("/tick").missing, 0u);
  EXPECT_EQ(verdict.topics.at("/tick").longest_silence_ns, kSecondNs / 5);
}

// Other programs count from the beginning of a run, and may end a chunk before its first message.
TEST(Mcap, VerifyTakesTimesFromZeroAndChunksWithoutMessages) {
  MemorySink sink;
  McapWriter writer(sink, {});
  const uint16_t channel = writer.add_channel("/t", 0, "", {}).value();
  ASSERT_TRUE(writer.write(channel, 0, 0, "m"));
  ASSERT_TRUE(writer.finish());
  const MemorySource at_zero(sink.bytes());
  EXPECT_TRUE(verify_mcap(at_zero, {}).value().sound());

  std::string bytes(mcap::kMagic);
  mcap::append_record(bytes, mcap::Header{});
  mcap::append_record(bytes, mcap::Chunk{});
  mcap::append_record(bytes, mcap::DataEnd{});
  mcap::append_record(bytes, mcap::Footer{});
  bytes.append(mcap::kMagic);
  const MemorySource empty_chunk(bytes);
  const McapVerdict verdict = verify_mcap(empty_chunk, {}).value();
  EXPECT_TRUE(verdict.sound());
  EXPECT_EQ(verdict.chunks, 1u);
}

TEST(Mcap, VerifyCountsChunksWithoutACrc) {
  test::SmallFile file = test::make_small_file();
  auto& bytes = file.bytes;
  size_t chunks = 0;
  for (size_t at = 8; at + 9 <= bytes.size() - 8;) {  // records, each of an opcode, a length and its content
    uint64_t length = 0;
    for (size_t k = 8; k >= 1; --k) length = length << 8 | static_cast<uint8_t>(bytes[at + k]);
    if (static_cast<uint8_t>(bytes[at]) == 6) {
      ++chunks;
      for (size_t k = 0; k < 4; ++k) bytes[at + 9 + 24 + k] = {};  // behind two times and the size
    }
    at += 9 + length;
  }
  ASSERT_GT(chunks, 0u);
  const MemorySource source(bytes);
  EXPECT_EQ(verify_mcap(source, {}).value().chunks_without_crc, chunks);
}

TEST(Mcap, VerifyCountsMissingNumbersAndSilences) {
  MemorySink sink;
  McapWriter writer(sink, {});
  const uint16_t channel = writer.add_channel("/t", 0, "", {}).value();
  for (const uint32_t sequence : {1u, 2u, 5u, 6u, 4u})
    ASSERT_TRUE(writer.write({channel, sequence, sequence * 100, 0, "m"}));
  ASSERT_TRUE(writer.finish());
  const MemorySource source(sink.bytes());
  const TopicVerdict topic = verify_mcap(source, {}).value().topics.at("/t");
  EXPECT_EQ(topic.missing, 2u);
  EXPECT_EQ(topic.out_of_order, 1u);
  EXPECT_EQ(topic.longest_silence_ns, 300u);
}

TEST(Mcap, RecoverCopiesASoundFileWhole) {
  const test::SmallFile file = test::make_small_file();
  const MemorySource source(file.bytes);
  MemorySink sink;
  const McapRecovery done = recover_mcap(source, sink, {}, {}).value();
  EXPECT_TRUE(done.was_finished);
  EXPECT_TRUE(done.loss.none());
  EXPECT_EQ(done.messages, 40u);
  const MemorySource copy(sink.bytes());
  const McapReader reader = McapReader::open(copy, {}).value();
  EXPECT_EQ(test::read_all(reader), file.messages);
  EXPECT_EQ(reader.attachment(reader.info().attachments.at(0)).value(), file.attachment);
  EXPECT_TRUE(verify_mcap(copy, {}).value().sound());
}

TEST(Mcap, TheWorkedExampleOfTheFormatPageIsExact) {
  MemorySink sink;
  McapWriter writer(sink, {.library = "x", .zstd_level = 0});
  const uint16_t schema = writer.add_schema("S", "protobuf", "").value();
  const uint16_t channel = writer.add_channel("/t", schema, "protobuf", {}).value();
  ASSERT_TRUE(writer.write(channel, kSecondNs, kSecondNs, "hi"));
  ASSERT_TRUE(writer.finish());

  // Lines "    <offset>  <up to 16 bytes>  <what they are>" after the last heading.
  std::ifstream page(SIGHTLINE_SOURCE_DIR "/server/record/FORMAT.md");
  std::string line, bytes;
  while (std::getline(page, line)) {
    if (!line.starts_with("    ") || line.size() < 12) continue;
    EXPECT_EQ(std::stoul(line.substr(4, 4), nullptr, 16), bytes.size()) << line;
    std::istringstream digits(line.substr(10, 47));
    for (std::string pair; digits >> pair;) bytes.push_back(static_cast<char>(std::stoi(pair, nullptr, 16)));
  }
  EXPECT_EQ(bytes, sink.bytes());
}

// Schemas and channels in the data section, in the order of the file: those outside chunks, then those in chunks.
struct Definitions {
  std::vector<std::string> outside, inside;
};

Definitions definitions_in(const std::string& bytes) {
  const auto name_of = [](const mcap::RecordView& record) {
    mcap::Schema schema;
    mcap::Channel channel;
    if (record.opcode == mcap::Opcode::kSchema && mcap::decode(record.content, schema)) return "schema " + schema.name;
    if (record.opcode == mcap::Opcode::kChannel && mcap::decode(record.content, channel))
      return "channel " + channel.topic;
    return std::string();
  };
  Definitions found;
  const MemorySource source(bytes);
  McapScanner scanner(source, {}, false);
  ScannedRecord record;
  mcap::RecordView part;
  while (scanner.next(record)) {
    if (const auto name = name_of({record.opcode, record.content}); !name.empty()) found.outside.push_back(name);
    while (record.opcode == mcap::Opcode::kChunk && mcap::take_record(record.records, part))
      if (const auto name = name_of(part); !name.empty()) found.inside.push_back(name);
  }
  return found;
}

TEST(Mcap, ADefinitionStandsOnceInTheDataAndOnlyWhenAMessageUsesIt) {
  MemorySink sink;
  McapWriter writer(sink, {.chunk_bytes = 1});  // a chunk for each message
  const uint16_t shared = writer.add_schema("shared", "e", "d").value();
  const uint16_t unused = writer.add_schema("unused", "e", "d").value();
  const uint16_t a = writer.add_channel("/a", shared, "", {}).value();
  ASSERT_TRUE(writer.add_channel("/unused", unused, "", {}));
  const uint16_t b = writer.add_channel("/b", shared, "", {}).value();
  for (const uint16_t channel : {a, b, a, b}) ASSERT_TRUE(writer.write(channel, 1, 1, "m"));
  ASSERT_TRUE(writer.finish());

  const Definitions found = definitions_in(sink.bytes());
  EXPECT_TRUE(found.outside.empty());
  EXPECT_EQ(found.inside, (std::vector<std::string>{"schema shared", "channel /a", "channel /b"}));
  const MemorySource source(sink.bytes());
  const McapReader reader = McapReader::open(source, {}).value();
  EXPECT_EQ(reader.info().schemas.size(), 1u);
  EXPECT_EQ(reader.info().channels.size(), 2u);
  EXPECT_EQ(reader.info().statistics.schema_count, 1u);
  EXPECT_EQ(reader.info().statistics.channel_count, 2u);
  EXPECT_TRUE(verify_mcap(source, {}).value().sound());
}

// Earlier versions wrote definitions outside chunks, and again in the chunk that first used them.
TEST(Mcap, DefinitionsMayAlsoStandBeforeTheirChunk) {
  const test::SmallFile file = test::make_small_file({.chunk_time = std::chrono::seconds(1)}, false);
  const MemorySource plain(file.bytes);
  const McapReader told = McapReader::open(plain, {}).value();
  const uint64_t first_chunk = told.info().chunks.at(0).chunk_start;
  std::string repeated;
  for (const auto& [id, schema] : told.info().schemas) mcap::append_record(repeated, schema);
  for (const auto& [id, channel] : told.info().channels) mcap::append_record(repeated, channel);
  std::string bytes = file.bytes;
  bytes.insert(first_chunk, repeated);

  EXPECT_EQ(definitions_in(bytes).outside, definitions_in(bytes).inside);
  const MemorySource source(bytes);
  EXPECT_EQ(test::read_all(McapReader::open(source, {}).value()), file.messages);
  MemorySink sink;
  EXPECT_EQ(recover_mcap(source, sink, {}, {}).value().messages, file.messages.size());
  EXPECT_TRUE(definitions_in(sink.bytes()).outside.empty());
}

TEST(Mcap, FilesOnDiskAreNewOnes) {
  const test::TemporaryFolder folder;
  const std::string path = folder / "mcap_test.mcap";
  {
    const auto sink = create_file_sink(path).value();
    ASSERT_TRUE(sink->write(test::make_small_file().bytes));
    EXPECT_EQ(create_file_sink(path).error().code, ErrorCode::kAlreadyExists);
  }
  const auto source = open_file_source(path).value();
  EXPECT_EQ(test::read_all(McapReader::open(*source, {}).value()).size(), 40u);
  std::string read(10, '\0');
  EXPECT_TRUE(source->read_at(source->size() - 10, read.data(), 10));
  EXPECT_EQ(read, test::make_small_file().bytes.substr(source->size() - 10));
  for (const auto& [offset, count] :
       {std::pair(source->size() - 9, 10), {source->size() + 1, 0}, {source->size() + 1, 10}}) {
    const Status beyond = source->read_at(offset, read.data(), static_cast<size_t>(count));
    ASSERT_FALSE(beyond) << offset << ' ' << count;
    EXPECT_EQ(beyond.error().message, "the file ends before what is to be read");
  }
  std::filesystem::remove(path);
  EXPECT_EQ(open_file_source(path).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(open_file_source("/").error().code, ErrorCode::kInvalidArgument);
}

}  // namespace
}  // namespace sightline
