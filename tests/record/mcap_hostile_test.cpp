// Files that were cut, damaged or made to do harm. The answer is an error, or a part with a count of what is missing;
// never a crash, and never memory without bound.
#include <gtest/gtest.h>
#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>

#include "server/base/random.h"
#include "server/record/mcap_recover.h"
#include "server/record/mcap_verify.h"
#include "tests/record/small_file.h"

namespace sightline {
namespace {

using test::PlainMessage;

// `part` holds messages of `whole`, unchanged and in the same order.
bool is_part_of(const std::vector<PlainMessage>& part, const std::vector<PlainMessage>& whole) {
  size_t at = 0;
  for (const PlainMessage& m : part) {
    while (at < whole.size() && !(whole[at] == m)) ++at;
    if (at++ == whole.size()) return false;
  }
  return true;
}

struct Readings {
  bool opened = false;
  std::vector<PlainMessage> messages;
  uint64_t troubles = 0;
  uint64_t lost_messages = 0;
};

// Every operation on a file.
Readings read_every_way(const std::string& bytes, McapLimits limits = {}) {
  const MemorySource source(bytes);
  Readings readings;
  (void)verify_mcap(source, limits);
  const Result<McapReader> reader = McapReader::open(source, limits);
  if (!reader) return readings;
  readings.opened = true;
  McapReadReport report;
  readings.messages = test::read_all(*reader, {}, &report);
  readings.troubles = report.loss.troubles + reader->info().loss.troubles;
  readings.lost_messages = report.loss.messages + reader->info().loss.messages;
  for (const mcap::AttachmentIndex& index : reader->info().attachments) (void)reader->attachment(index);
  for (const mcap::MetadataIndex& index : reader->info().metadata) (void)reader->metadata(index);
  return readings;
}

// recover makes a sound file from any input.
std::vector<PlainMessage> recovered(const std::string& bytes, McapRecovery* done = nullptr) {
  const MemorySource source(bytes);
  MemorySink sink;
  const Result<McapRecovery> recovery = recover_mcap(source, sink, {}, {});
  if (!recovery) return {};
  if (done != nullptr) *done = *recovery;
  const MemorySource copy(sink.bytes());
  EXPECT_TRUE(verify_mcap(copy, {}).value().sound());
  const auto messages = test::read_all(McapReader::open(copy, {}).value());
  EXPECT_EQ(messages.size(), recovery->messages);
  return messages;
}

TEST(McapHostile, EveryTruncationGivesTheWholeChunksBeforeIt) {
  const test::SmallFile file = test::make_small_file({.chunk_time = std::chrono::milliseconds(500)});
  const MemorySource whole(file.bytes);
  const std::vector<mcap::ChunkIndex> chunks = McapReader::open(whole, {}).value().info().chunks;
  for (size_t size = 0; size < file.bytes.size(); ++size) {
    const std::string cut = file.bytes.substr(0, size);
    const Readings readings = read_every_way(cut);
    size_t expected = 0;
    for (const mcap::ChunkIndex& chunk : chunks)
      if (chunk.chunk_start + chunk.chunk_length <= size)
        expected += static_cast<size_t>(std::count_if(file.messages.begin(), file.messages.end(), [&](const auto& m) {
          return m.log_time_ns >= chunk.start_time_ns && m.log_time_ns <= chunk.end_time_ns;
        }));
    const std::vector<PlainMessage> first(file.messages.begin(), file.messages.begin() + static_cast<long>(expected));
    EXPECT_EQ(readings.opened, size >= mcap::kMagic.size()) << size;
    EXPECT_EQ(readings.messages, first) << size;
    EXPECT_EQ(readings.troubles > 0, readings.opened) << size;
    EXPECT_EQ(recovered(cut), first) << size;
  }
}

TEST(McapHostile, TenThousandDamagesGiveAPartOfTheTruth) {
  const test::SmallFile file = test::make_small_file({.chunk_time = std::chrono::milliseconds(500)});
  CounterRandom random(2024, 0, RandomPurpose::kTest);
  size_t recovered_messages = 0, silent = 0;
  for (int i = 0; i < 10'000; ++i) {
    std::string damaged = file.bytes;
    const uint32_t kind = random.next_below(4);
    const uint32_t at = random.next_below(static_cast<uint32_t>(damaged.size()));
    const uint32_t length = 1 + random.next_below(kind == 0 ? 1 : 40);
    if (kind <= 1)  // other bytes
      for (uint32_t b = at; b < std::min<size_t>(at + length, damaged.size()); ++b)
        damaged[b] = static_cast<char>(random.next_u32());
    if (kind == 2) damaged.erase(at, length);
    if (kind == 3) damaged.insert(at, std::string(length, static_cast<char>(random.next_u32())));

    const Readings readings = read_every_way(damaged);
    EXPECT_TRUE(is_part_of(readings.messages, file.messages)) << "damage " << i;
    if (readings.opened && readings.messages.size() < file.messages.size() && readings.troubles == 0) ++silent;
    const auto kept = recovered(damaged);
    EXPECT_TRUE(is_part_of(kept, file.messages)) << "damage " << i;
    recovered_messages += kept.size();
  }
  EXPECT_EQ(silent, 0u) << "what is missing is always told";
  // One damage of at most 40 bytes hits at most two of nine chunks: 16 bytes in 17 of the messages must be there.
  EXPECT_GT(recovered_messages, 10'000 * file.messages.size() * 8 / 10);
}

uint64_t messages_of(const test::SmallFile& file, const mcap::ChunkIndex& chunk) {
  return static_cast<uint64_t>(std::count_if(file.messages.begin(), file.messages.end(), [&](const PlainMessage& m) {
    return m.log_time_ns >= chunk.start_time_ns && m.log_time_ns <= chunk.end_time_ns;
  }));
}

TEST(McapHostile, DamageInOneChunkCostsThatChunkAndSaysHowMuch) {
  const test::SmallFile file = test::make_small_file();
  const MemorySource whole(file.bytes);
  const mcap::ChunkIndex second = McapReader::open(whole, {}).value().info().chunks.at(1);
  std::string damaged = file.bytes;
  damaged[second.chunk_start + second.chunk_length - 3] ^= 0x10;
  const uint64_t in_second = messages_of(file, second);
  const Readings readings = read_every_way(damaged);
  EXPECT_EQ(readings.messages.size(), file.messages.size() - in_second);
  EXPECT_EQ(readings.lost_messages, in_second);
  McapRecovery done;
  EXPECT_EQ(recovered(damaged, &done).size(), file.messages.size() - in_second);
  EXPECT_EQ(done.loss.messages, in_second);
  EXPECT_EQ(done.loss.chunks, 1u);
  EXPECT_EQ(done.attachments, 1u);
  const MemorySource source(damaged);
  EXPECT_FALSE(verify_mcap(source, {}).value().sound());
}

// The first chunk holds the only schemas and channels of the data. `damage` gets the file and the middle of that chunk.
void first_chunk_is_lost_alone(void (*damage)(std::string& bytes, size_t middle)) {
  const test::SmallFile file = test::make_small_file();
  const MemorySource whole(file.bytes);
  const mcap::ChunkIndex first = McapReader::open(whole, {}).value().info().chunks.at(0);
  const std::vector<PlainMessage> later(file.messages.begin() + static_cast<long>(messages_of(file, first)),
                                        file.messages.end());
  std::string damaged = file.bytes;
  damage(damaged, first.chunk_start + first.chunk_length / 2);
  EXPECT_EQ(read_every_way(damaged).messages, later);
  EXPECT_EQ(recovered(damaged), later);
}

TEST(McapHostile, TheSummaryHasTheTopicsOfALostChunk) {
  first_chunk_is_lost_alone([](std::string& bytes, size_t middle) { bytes[middle] ^= 0x10; });
}

TEST(McapHostile, TheSummaryHasTheTopicsOfALostChunkThoughItsOffsetsAreWrong) {
  first_chunk_is_lost_alone([](std::string& bytes, size_t middle) { bytes.insert(middle, "five!"); });
  first_chunk_is_lost_alone([](std::string& bytes, size_t middle) { bytes.erase(middle, 7); });
}

TEST(McapHostile, TopicsOfALostChunkThatAreOverTheLimitAreTold) {
  const test::SmallFile file = test::make_small_file();
  const MemorySource whole(file.bytes);
  const mcap::ChunkIndex first = McapReader::open(whole, {}).value().info().chunks.at(0);
  std::string damaged = file.bytes;
  damaged.insert(first.chunk_start + first.chunk_length / 2, "five!");
  const auto told = [&](McapLimits limits) {
    const MemorySource source(damaged);
    const McapLoss& loss = McapReader::open(source, limits).value().info().loss;
    return std::count_if(loss.first_troubles.begin(), loss.first_troubles.end(), [](const McapTrouble& trouble) {
      return trouble.error.message.find("schemas and channels are over the limit") != std::string::npos;
    });
  };
  EXPECT_EQ(told({}), 0);
  EXPECT_EQ(told({.max_definition_bytes = 10}), 3) << "a schema and two channels";
}

TEST(McapHostile, ADamagedSummaryNamesNoTopics) {
  const test::SmallFile file = test::make_small_file();
  const MemorySource whole(file.bytes);
  const mcap::ChunkIndex first = McapReader::open(whole, {}).value().info().chunks.at(0);
  std::string damaged = file.bytes;
  damaged[first.chunk_start + first.chunk_length / 2] ^= 0x10;
  damaged[damaged.rfind("/tick") + 1] = 'x';  // in the summary
  const Readings readings = read_every_way(damaged);
  EXPECT_TRUE(readings.messages.empty());
  EXPECT_EQ(readings.lost_messages, file.messages.size());
  McapRecovery done;
  EXPECT_TRUE(recovered(damaged, &done).empty());
  EXPECT_EQ(done.loss.messages, file.messages.size());
}

TEST(McapHostile, ADamagedAttachmentIsNotGivenOut) {
  const test::SmallFile file = test::make_small_file();
  const size_t at = file.bytes.find(file.attachment);
  ASSERT_NE(at, std::string::npos) << "attachments are not compressed";
  for (const size_t flipped : {at, at + file.attachment.size() - 1}) {
    std::string bytes = file.bytes;
    bytes[flipped] = static_cast<char>(bytes[flipped] ^ 1);
    const MemorySource source(bytes);
    const McapReader reader = McapReader::open(source, {}).value();
    const auto read = reader.attachment(reader.info().attachments.at(0));
    ASSERT_FALSE(read);
    EXPECT_EQ(read.error().field, "attachment.crc");
  }
}

// An index that names the same half of the file again and again would have a short file read without end.
TEST(McapHostile, AnIndexOfOverlappingChunksIsNotUsed) {
  const test::SmallFile file = test::make_small_file();
  std::string bytes = file.bytes;
  const auto number = [&](size_t at) {
    uint64_t value = 0;
    std::copy_n(bytes.data() + at, 8, reinterpret_cast<char*>(&value));
    return value;
  };
  const auto put = [&](size_t at, uint64_t value) {
    std::copy_n(reinterpret_cast<const char*>(&value), 8, bytes.data() + at);
  };
  // As the specification lays a file out: the footer's 20 bytes and the magic are its end, a record is an opcode, a
  // length and its content, and a chunk index (8) begins with two times, the place and the length of its chunk.
  const size_t footer = bytes.size() - 8 - 20;
  size_t changed = 0;
  for (size_t at = number(footer); at < footer - 9; at += 9 + number(at + 1)) {
    if (bytes[at] != 8) continue;
    put(at + 9 + 16, 8);
    put(at + 9 + 24, bytes.size() / 2);
    ++changed;
  }
  ASSERT_GE(changed, 3u);
  std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(footer) + 16, 4, '\0');  // no CRC of the summary
  const MemorySource source(bytes);
  const McapReader reader = McapReader::open(source, {}).value();
  EXPECT_FALSE(reader.info().from_summary);
  EXPECT_EQ(test::read_all(reader), file.messages);
}

TEST(McapHostile, AfterAWrongLengthTheNextChunkIsFound) {
  const test::SmallFile file = test::make_small_file();
  const MemorySource whole(file.bytes);
  const mcap::ChunkIndex second = McapReader::open(whole, {}).value().info().chunks.at(1);
  std::string damaged = file.bytes;
  for (int b = 1; b <= 8; ++b) damaged[second.chunk_start + static_cast<size_t>(b)] = '\x7f';
  McapRecovery done;
  const auto kept = recovered(damaged, &done);
  EXPECT_TRUE(is_part_of(kept, file.messages));
  EXPECT_EQ(kept.size(), file.messages.size() - messages_of(file, second));
  EXPECT_GT(done.loss.bytes, 0u);
}

TEST(McapHostile, EveryByteThatIsFlippedIsNoticedByVerify) {
  const test::SmallFile file = test::make_small_file();
  for (size_t i = 0; i < file.bytes.size(); ++i) {
    std::string damaged = file.bytes;
    damaged[i] ^= 0x04;
    const MemorySource source(damaged);
    const Result<McapVerdict> verdict = verify_mcap(source, {});
    EXPECT_TRUE(!verdict || !verdict->sound()) << "byte " << i;
  }
}

// A finished file around one chunk with arbitrary contents.
std::string file_of_chunk(const mcap::Chunk& chunk) {
  std::string bytes(mcap::kMagic);
  mcap::append_record(bytes, mcap::Header{});
  mcap::append_record(bytes, chunk);
  mcap::append_record(bytes, mcap::DataEnd{});
  mcap::append_record(bytes, mcap::Footer{});
  bytes.append(mcap::kMagic);
  return bytes;
}

std::string zstd_of(const std::string& raw) {
  std::string packed(ZSTD_compressBound(raw.size()), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), raw.data(), raw.size(), 3));
  return packed;
}

TEST(McapHostile, BombsAreRefusedByWhatTheyDeclareAndByWhatTheyAre) {
  const McapLimits limits{.max_chunk_bytes = 1 << 20};
  const std::string bomb = zstd_of(std::string(100 << 20, '\0'));
  ASSERT_LT(bomb.size(), 20'000u);
  for (const uint64_t declared : {uint64_t{100} << 20, uint64_t{1000}, ~uint64_t{0}, uint64_t{0}}) {
    ChunkUnpacker unpacker(limits.max_chunk_bytes, ~uint64_t{0});
    const Result<std::string_view> raw = unpacker.unpack({0, 0, declared, 0, "zstd", bomb});
    ASSERT_FALSE(raw) << declared;
    EXPECT_EQ(raw.error().code,
              declared > limits.max_chunk_bytes ? ErrorCode::kResourceExhausted : ErrorCode::kDataLoss);
    const Readings readings = read_every_way(file_of_chunk({0, 0, declared, 0, "zstd", bomb}), limits);
    EXPECT_TRUE(readings.opened);
    EXPECT_TRUE(readings.messages.empty());
    EXPECT_GT(readings.troubles, 0u);
  }
}

// A file of `count` chunks that unpack to `each` bytes of nothing, finished when asked for.
std::string bombs(int count, size_t each, bool finish) {
  MemorySink sink;
  McapWriter writer(sink, {.chunk_bytes = 1});
  const uint16_t channel = writer.add_channel("/zeros", 0, "", {}).value();
  const std::string zeros(each, '\0');
  for (int i = 0; i < count; ++i) EXPECT_TRUE(writer.write(channel, i, i, zeros));
  EXPECT_TRUE(!finish || writer.finish());
  return sink.bytes();
}

TEST(McapHostile, ManyBombsTogetherAreRefusedWholeByEveryReader) {
  for (const bool finish : {false, true}) {
    const std::string bytes = bombs(60, 16 << 20, finish);
    ASSERT_LT(bytes.size(), 1'000'000u);
    const MemorySource source(bytes);
    MemorySink copy;
    for (const Error& error : {McapReader::open(source, {}).error(), verify_mcap(source, {}).error(),
                               recover_mcap(source, copy, {}, {}).error()}) {
      EXPECT_EQ(error.code, ErrorCode::kResourceExhausted);
      EXPECT_NE(error.message.find("unpack to more than"), std::string::npos) << error.message;
    }
    // Whoever allows it reads all of it.
    const McapLimits enough{.max_unpacked_bytes = uint64_t{2} << 30};
    EXPECT_TRUE(verify_mcap(source, enough)->loss.chunks == 0);
    EXPECT_EQ(McapReader::open(source, enough)->read({}, [](const McapMessage&) { return true; }).messages, 60u);
  }
}

TEST(McapHostile, AChunkThatIsLargerThanItsIndexSaysStillCounts) {
  constexpr size_t kEach = 16 << 20;
  std::string bytes = bombs(3, kEach, true);
  const size_t footer = bytes.size() - mcap::kTailBytes;
  mcap::Footer told;
  ASSERT_TRUE(mcap::decode(std::string_view(bytes).substr(footer + mcap::kRecordHeadBytes), told));
  // The indexes claim one byte for each chunk, and no CRC covers them.
  const MemorySource honest(bytes);
  const uint64_t size = McapReader::open(honest, {})->info().chunks.at(1).uncompressed_size, claimed = 1;
  const std::string stated(reinterpret_cast<const char*>(&size), sizeof size);
  size_t found = 0;
  for (size_t at = bytes.find(stated, told.summary_start); at < footer; at = bytes.find(stated, at + 1), ++found)
    bytes.replace(at, sizeof claimed, reinterpret_cast<const char*>(&claimed), sizeof claimed);
  ASSERT_GE(found, 2u);
  bytes.replace(footer + mcap::kRecordHeadBytes + 16, 4, 4, '\0');
  const MemorySource source(bytes);
  const McapReader reader = McapReader::open(source, {.max_unpacked_bytes = 2 * kEach}).value();
  ASSERT_TRUE(reader.info().from_summary);
  // The budget is that of one reading: it begins anew with each.
  for (int reading = 0; reading < 2; ++reading) {
    const McapReadReport report = reader.read({}, [](const McapMessage&) { return true; });
    EXPECT_EQ(report.messages, 1u);
    EXPECT_EQ(report.loss.chunks, 1u) << "it stops there";
    EXPECT_EQ(report.loss.first_troubles.at(0).error.code, ErrorCode::kResourceExhausted);
  }
}

TEST(McapHostile, OtherCompressionsAreNamedInTheError) {
  ChunkUnpacker unpacker(1000, 1000);
  const Error error = unpacker.unpack({0, 0, 3, 0, "brotli", "abc"}).error();
  EXPECT_EQ(error.code, ErrorCode::kUnsupported);
  EXPECT_NE(error.message.find("brotli"), std::string::npos);
  EXPECT_GT(read_every_way(file_of_chunk({0, 0, 3, 0, "brotli", "abc"})).troubles, 0u);
}

std::string lz4_of(const std::string& raw) {
  std::string packed(LZ4F_compressFrameBound(raw.size(), nullptr), '\0');
  packed.resize(LZ4F_compressFrame(packed.data(), packed.size(), raw.data(), raw.size(), nullptr));
  return packed;
}

TEST(McapHostile, Lz4GivesWhatTheChunkDeclaresAndNoMore) {
  const std::string raw(100'000, 'x'), packed = lz4_of(raw);
  ChunkUnpacker unpacker(raw.size(), 100 * raw.size());
  EXPECT_EQ(unpacker.unpack({0, 0, raw.size(), mcap::crc32_of(raw), "lz4", packed}).value(), raw);
  // Two frames, one behind the other.
  EXPECT_EQ(unpacker.unpack({0, 0, 6, 0, "lz4", lz4_of("abc") + lz4_of("def")}).value(), "abcdef");
  for (const auto& [records, declared] :
       std::vector<std::pair<std::string, uint64_t>>{{packed, raw.size() - 1},
                                                     {packed, 10},
                                                     {packed, 0},
                                                     {packed.substr(0, packed.size() / 2), raw.size()},
                                                     {packed + "garbage", raw.size()},
                                                     {"abc", 3},
                                                     {"", 3}}) {
    const auto unpacked = unpacker.unpack({0, 0, declared, 0, "lz4", records});
    ASSERT_FALSE(unpacked) << records.size() << ' ' << declared;
    EXPECT_EQ(unpacked.error().code, ErrorCode::kDataLoss);
  }
}

TEST(McapHostile, LengthsAndOffsetsBeyondTheFileAreNoPlaces) {
  // Every integer of every record in the summary and the footer is set to the most harmful values; the CRC is
  // corrected.
  const test::SmallFile file = test::make_small_file({.chunk_time = std::chrono::seconds(2)});
  const size_t footer = file.bytes.size() - mcap::kTailBytes;
  mcap::Footer told;
  ASSERT_TRUE(mcap::decode(std::string_view(file.bytes).substr(footer + mcap::kRecordHeadBytes), told));
  for (size_t at = told.summary_start; at + 8 <= footer + mcap::kRecordHeadBytes + 16; ++at)
    for (const uint64_t value :
         {~uint64_t{0}, uint64_t{1} << 63, uint64_t{0}, uint64_t{file.bytes.size()}, uint64_t{1}}) {
      std::string hostile = file.bytes;
      hostile.replace(at, 8, reinterpret_cast<const char*>(&value), 8);
      const uint32_t crc = mcap::crc32_of(std::string_view(hostile).substr(
          told.summary_start, footer + mcap::kRecordHeadBytes + 16 - told.summary_start));
      hostile.replace(footer + mcap::kRecordHeadBytes + 16, 4, reinterpret_cast<const char*>(&crc), 4);
      const Readings readings = read_every_way(hostile);
      EXPECT_TRUE(readings.opened);
      EXPECT_LE(readings.messages.size(), file.messages.size());
    }
}

TEST(McapHostile, MemoryStaysBoundedWhenTheSameSchemaBombComesAgainAndAgain) {
  // 50 chunks, each with 20 schemas of 1 MB that pack to nothing: over 1 GB unpacked.
  std::string bytes(mcap::kMagic);
  uint16_t id = 1;
  for (int c = 0; c < 50; ++c) {
    std::string raw;
    for (int s = 0; s < 20; ++s) mcap::append_record(raw, mcap::Schema{id++, "s", "e", std::string(1 << 20, '\0')});
    const std::string packed = zstd_of(raw);
    mcap::append_record(bytes, mcap::Chunk{0, 0, raw.size(), mcap::crc32_of(raw), "zstd", packed});
  }
  const MemorySource source(bytes);
  const McapReader reader = McapReader::open(source, {.max_unpacked_bytes = uint64_t{2} << 30}).value();
  uint64_t kept = 0;
  for (const auto& [_, schema] : reader.info().schemas) kept += schema.data.size();
  EXPECT_LE(kept, McapLimits{}.max_definition_bytes);
  EXPECT_GT(reader.info().loss.troubles, 0u);
}

TEST(McapHostile, LookingForTheNextChunkReadsTheFileAFewTimesAtMost) {
  // Chunk headers one after another, each claiming all bytes that follow. A reader that tries every one does n^2 work.
  std::string bytes(mcap::kMagic);
  bytes.push_back('\0');
  const size_t total = 4 << 20;
  while (bytes.size() + 64 < total) {
    const uint64_t head_at = bytes.size();
    const uint64_t left = total - head_at - mcap::kRecordHeadBytes;
    mcap::append_record(bytes, mcap::Chunk{1, 2, left - 40, 77, "", ""});
    bytes.replace(head_at + 1, 8, reinterpret_cast<const char*>(&left), 8);
    const uint64_t records = left - 40;
    bytes.replace(head_at + 9 + 32, 8, reinterpret_cast<const char*>(&records), 8);
  }
  bytes.resize(total);
  const test::CountedSource source(bytes);
  MemorySink sink;
  (void)recover_mcap(source, sink, {}, {});
  // Trying them all would load 100 GB.
  EXPECT_LT(source.take_count(), 20 * total);
}

// A stray byte behind every chunk: each search loads all of the file that is left, or the size of its window.
TEST(McapHostile, ManyDamagesReadTheFileAFewTimesAtMost) {
  std::string raw;
  mcap::append_record(raw, mcap::Channel{1, 0, "/t", "x-plain", {}});
  for (uint32_t i = 0; i < 100; ++i) mcap::append_record(raw, mcap::Message{1, i, 1, 1, "a message of some bytes"});
  std::string bytes(mcap::kMagic);
  mcap::append_record(bytes, mcap::Header{});
  while (bytes.size() < 1 << 20) {
    mcap::append_record(bytes, mcap::Chunk{1, 1, raw.size(), mcap::crc32_of(raw), "", raw});
    bytes.push_back('\0');
  }
  const test::CountedSource source(bytes);
  MemorySink sink;
  const McapRecovery done = recover_mcap(source, sink, {}, {}).value();
  EXPECT_GE(done.chunks, 3u) << "the search goes on while it may";
  EXPECT_LT(source.take_count(), 20 * bytes.size());
}

TEST(McapHostile, NoiseIsRefusedOrEmpty) {
  CounterRandom random(7, 0, RandomPurpose::kTest);
  for (int i = 0; i < 300; ++i) {
    std::string noise(random.next_below(3000), '\0');
    for (char& byte : noise) byte = static_cast<char>(random.next_u32());
    EXPECT_FALSE(read_every_way(noise).opened);
    std::string led(mcap::kMagic);
    led.append(noise);
    EXPECT_TRUE(read_every_way(led).messages.empty());
  }
}

}  // namespace
}  // namespace sightline
