// Scans the data section of an MCAP file from front to back without its summary: for files that were not finished, or
// were damaged. Damage is noted and skipped: the scanner looks for the next chunk or attachment whose CRC is right, and
// continues there.
//
//   McapScanner scanner(source, {});
//   ScannedRecord record;
//   while (scanner.next(record)) ...
//   scanner.loss(), scanner.finished()
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "server/record/byte_io.h"
#include "server/record/chunk_codec.h"
#include "server/record/mcap_format.h"
#include "server/record/mcap_loss.h"

namespace sightline {

// One sound record outside chunks. Views last until the next call of next().
struct ScannedRecord {
  mcap::Opcode opcode = mcap::Opcode::kHeader;
  uint64_t offset = 0;       // from the start of the file
  uint64_t length = 0;       // of the whole record
  std::string_view content;  // of an attachment only when they are wanted
  mcap::Chunk chunk;         // of a chunk,
  std::string_view records;  // and its records, unpacked; the CRC was right
};

// Not thread-safe. Holds one record and one unpacked chunk at a time, within the limits. Time is bounded too: looking
// for the next sound record after damage costs at most a few readings of the file in all, however the damage was
// made.
class McapScanner {
 public:
  // `source` must outlive the scanner. Attachments are read and their CRC checked only when `with_attachments`.
  McapScanner(const ByteSource& source, McapLimits limits, bool with_attachments);

  // The next sound record, in the order of the file; false at the end. Indexes are skipped, and so are records of kinds
  // that this version of the format does not know.
  bool next(ScannedRecord& out);

  const McapLoss& loss() const { return loss_; }
  // The end of the data section was reached, so that nothing is missing behind what was read.
  bool finished() const { return finished_; }
  // It ended because the chunks unpack to more than the limits allow.
  bool exhausted() const { return unpacker_.exhausted(); }
  // Where the record stands that ends the data; 0 before it was reached.
  uint64_t data_end() const { return data_end_; }

 private:
  enum class Found { kRecord, kPassOver, kBroken, kEnd };

  Found look_at(uint64_t offset, ScannedRecord& out);
  Found load(ScannedRecord& out);
  Found load_chunk(ScannedRecord& out);
  Found load_attachment(ScannedRecord& out);
  void count_lost_messages(const ScannedRecord& index);
  bool plausible_head(uint64_t offset) const;
  bool cut_off_at(uint64_t offset) const;
  std::optional<uint64_t> find_next(uint64_t from);
  bool sound_at(uint64_t offset, mcap::Opcode opcode, uint64_t content_length);
  bool chunk_head_fits(uint64_t offset, uint64_t content_length) const;
  void pass_damage(uint64_t from);
  Status read(uint64_t offset, uint64_t count, std::string& out);

  const ByteSource& source_;
  const McapLimits limits_;
  const bool with_attachments_;
  ChunkUnpacker unpacker_;
  std::string content_;
  std::string window_;  // of find_next
  McapLoss loss_;
  uint64_t position_ = 0;
  uint64_t search_budget_ = 0;  // bytes that find_next may still load
  bool lost_chunk_ = false;     // the record before was a chunk that could not be read
  bool ended_ = false;
  bool finished_ = false;
  uint64_t data_end_ = 0;
};

}  // namespace sightline
