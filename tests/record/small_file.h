// A file of a few kilobytes with everything that a recording contains, and readers' answers as plain values.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "server/record/mcap_reader.h"
#include "server/record/mcap_writer.h"

namespace sightline::test {

struct PlainMessage {
  std::string topic;
  uint32_t sequence = 0;
  uint64_t log_time_ns = 0;
  uint64_t publish_time_ns = 0;
  std::string data;
  bool operator==(const PlainMessage&) const = default;
};

inline constexpr uint64_t kSecondNs = 1'000'000'000;

// Two topics, 40 messages a tenth of a second apart from 100 s on, chunks of a second, one attachment, one metadata.
struct SmallFile {
  std::string bytes;
  std::vector<PlainMessage> messages;
  std::string attachment;
};
SmallFile make_small_file(McapWriterOptions options = {.chunk_time = std::chrono::seconds(1)}, bool finish = true);

// Counts the bytes that are read from it, repeated ones too.
class CountedSource final : public ByteSource {
 public:
  explicit CountedSource(std::string_view bytes) : bytes_(bytes) {}
  uint64_t size() const override { return bytes_.size(); }
  Status read_at(uint64_t offset, char* out, size_t count) const override {
    read_ += count;
    return bytes_.read_at(offset, out, count);
  }
  uint64_t take_count() const { return std::exchange(read_, 0); }

 private:
  MemorySource bytes_;
  mutable uint64_t read_ = 0;
};

// All messages that the query selects; `report`, when not null, is filled.
std::vector<PlainMessage> read_all(const McapReader& reader, const McapQuery& query = {},
                                   McapReadReport* report = nullptr);

}  // namespace sightline::test
