// Reads MCAP files that may come from anywhere: https://mcap.dev/spec.
//
//   const auto file = open_file_source(path);
//   const auto reader = McapReader::open(**file, {});
//   reader->info()                                    what is in it: topics, schemas, counts, times
//   reader->read({.start_ns = t}, [](const McapMessage& m) { ...; return true; });
//
// With a complete summary, only the tail of the file is read at first, and then the chunks that a query needs. Without
// one, with one that lacks an optional part, or with one that does not fit the file, the whole file is scanned once to
// make the same index. Damage costs the chunks that it lies in, and losses are counted. Everything that a file declares
// is checked against the file's size and the limits (mcap_loss.h).
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/base/error.h"
#include "server/record/byte_io.h"
#include "server/record/mcap_format.h"
#include "server/record/mcap_loss.h"

namespace sightline {

struct McapInfo {
  mcap::Header header;
  std::map<uint16_t, mcap::Schema> schemas;    // by id
  std::map<uint16_t, mcap::Channel> channels;  // by id
  std::vector<mcap::ChunkIndex> chunks;        // in the order of the file
  std::vector<mcap::AttachmentIndex> attachments;
  std::vector<mcap::MetadataIndex> metadata;
  mcap::Statistics statistics;  // from the summary, or counted
  bool has_statistics = false;  // false: the summary has none
  // What the format lets a writer leave out and the summary lacks: "statistics", "schemas", "channels", "chunk index",
  // "attachment index", "metadata index". That is no damage; the file was scanned instead.
  std::vector<std::string> absent;
  bool from_summary = false;    // false: the file was scanned
  bool finished = false;        // its data have an end
  bool loose_messages = false;  // the file was scanned and has messages outside chunks
  McapLoss loss;                // found on opening
};

struct McapQuery {
  // By log time: start <= t < end.
  uint64_t start_ns = 0;
  uint64_t end_ns = std::numeric_limits<uint64_t>::max();
  std::vector<std::string> topics = {};  // empty: all
};

// Valid during the call that it is handed to.
struct McapMessage {
  const mcap::Channel& channel;
  const mcap::Schema* schema = nullptr;  // null: none
  mcap::Message message;
};

struct McapReadReport {
  uint64_t messages = 0;  // handed over
  uint64_t chunks_read = 0;
  McapLoss loss;  // of this call; McapInfo::loss has the losses on opening
};

// Reading does not change it: it may be used from several threads when the source may.
class McapReader {
 public:
  // `source` must outlive the reader. Fails with kDataLoss when the bytes do not begin as MCAP does, and when reading
  // fails; with kResourceExhausted when the chunks unpack to more than the limits allow.
  static Result<McapReader> open(const ByteSource& source, McapLimits limits);

  const McapInfo& info() const { return info_; }
  // The summary as the file has it, even when it lacks parts; null: there is none that fits the file.
  const McapInfo* summary() const { return summary_ ? &*summary_ : nullptr; }

  // Calls `visit` with every message of the query, in the order of the file, until it returns false. In our recordings
  // that is the order of events. Messages outside chunks are found only in a file without a summary.
  McapReadReport read(const McapQuery& query, const std::function<bool(const McapMessage&)>& visit) const;

  // The bytes of an attachment of info(). kDataLoss on a wrong CRC or offset, kResourceExhausted over the limit.
  Result<std::string> attachment(const mcap::AttachmentIndex& index) const;
  Result<mcap::Metadata> metadata(const mcap::MetadataIndex& index) const;

 private:
  McapReader(const ByteSource& source, McapLimits limits) : source_(&source), limits_(limits) {}

  // The last record of a finished file.
  struct Tail {
    uint64_t start = 0;
    mcap::Footer footer;
    std::string bytes;  // with the magic
  };

  Result<bool> take_summary();
  Result<Tail> read_tail() const;
  Result<bool> read_summary(McapInfo& out) const;
  Status check_summary(const McapInfo& summary) const;
  Status read_header(McapInfo& out) const;
  Status go_through();
  void learn_from_summary(uint64_t start, uint64_t& room);
  void read_chunks(const McapQuery& query, const std::function<bool(const McapMessage&)>& visit,
                   McapReadReport& report) const;
  void read_through(const McapQuery& query, const std::function<bool(const McapMessage&)>& visit,
                    McapReadReport& report) const;
  bool wanted(const mcap::ChunkIndex& chunk, const McapQuery& query) const;
  uint64_t messages_by_index(const mcap::ChunkIndex& chunk) const;

  const ByteSource* source_;  // never null
  McapLimits limits_;
  McapInfo info_;
  std::optional<McapInfo> summary_;
};

}  // namespace sightline
