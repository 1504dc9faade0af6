#include "server/record/mcap_scanner.h"

#include <algorithm>
#include <cstring>

namespace sightline {
namespace {

using mcap::Opcode;

constexpr uint64_t kWindowBytes = uint64_t{1} << 20;
constexpr uint64_t kChunkHeadBytes = 32;  // times, size, CRC, length of the compression's name

uint64_t read_u64(const char* bytes) {
  uint64_t value = 0;
  std::memcpy(&value, bytes, sizeof value);
  return value;
}

Error broken(const char* what) {
  return Error{ErrorCode::kDataLoss, "record", what};
}

// Known kinds, and those that applications may add.
bool known_opcode(uint8_t opcode) {
  return (opcode >= 0x01 && opcode <= 0x0F) || opcode >= 0x80;
}

}  // namespace

McapScanner::McapScanner(const ByteSource& source, McapLimits limits, bool with_attachments)
    : source_(source),
      limits_(limits),
      with_attachments_(with_attachments),
      unpacker_(limits.max_chunk_bytes, limits.unpacked_within(source.size())),
      search_budget_(4 * source.size() + kWindowBytes) {
  std::string magic;
  if (read(0, mcap::kMagic.size(), magic) && magic == mcap::kMagic) {
    position_ = mcap::kMagic.size();
  } else {
    loss_.note(0, broken("the file does not begin as MCAP does"));
    pass_damage(0);
  }
}

Status McapScanner::read(uint64_t offset, uint64_t count, std::string& out) {
  if (offset > source_.size() || count > source_.size() - offset)
    return fail(ErrorCode::kDataLoss, "", "the file ends before what is to be read");
  out.resize(count);
  return source_.read_at(offset, out.data(), count);
}

bool McapScanner::next(ScannedRecord& out) {
  while (!ended_ && !exhausted()) {
    const uint64_t offset = position_;
    const Found found = look_at(offset, out);
    if (found == Found::kBroken) {
      if (exhausted()) return false;
      pass_damage(offset);
      continue;
    }
    position_ = offset + out.length;
    if (found == Found::kRecord) return true;
    if (found == Found::kEnd) ended_ = true;
  }
  return false;
}

McapScanner::Found McapScanner::look_at(uint64_t offset, ScannedRecord& out) {
  out = {};
  out.offset = offset;
  if (offset == source_.size()) {
    loss_.note(offset, broken("the file ends without the end of its data: it was not finished"));
    return Found::kEnd;
  }
  if (!plausible_head(offset)) {
    loss_.note(offset, broken(cut_off_at(offset) ? "the file ends within this record: it was not finished"
                                                 : "no record begins here"));
    return Found::kBroken;
  }
  char head[mcap::kRecordHeadBytes];
  if (Status ok = source_.read_at(offset, head, sizeof head); !ok) {
    loss_.note(offset, ok.error());
    return Found::kBroken;
  }
  out.opcode = static_cast<Opcode>(head[0]);
  out.length = mcap::kRecordHeadBytes + read_u64(head + 1);
  const Found found = load(out);
  if (out.opcode != Opcode::kMessageIndex) lost_chunk_ = found == Found::kBroken && out.opcode == Opcode::kChunk;
  return found;
}

bool McapScanner::plausible_head(uint64_t offset) const {
  char head[mcap::kRecordHeadBytes];
  if (!source_.read_at(offset, head, sizeof head)) return false;
  return known_opcode(static_cast<uint8_t>(head[0])) &&
         read_u64(head + 1) <= source_.size() - offset - mcap::kRecordHeadBytes;
}

// The head of a record is there, or a part of it, and the file ends before the record does. A record of a plausible
// size, that is.
bool McapScanner::cut_off_at(uint64_t offset) const {
  char head[mcap::kRecordHeadBytes] = {};
  const uint64_t there = source_.size() - offset;
  if (!source_.read_at(offset, head, std::min<uint64_t>(there, sizeof head)) ||
      !known_opcode(static_cast<uint8_t>(head[0])))
    return false;
  const uint64_t most = std::max(limits_.max_record_bytes, limits_.max_attachment_bytes);
  return there < sizeof head || (read_u64(head + 1) <= most && read_u64(head + 1) > there - sizeof head);
}

McapScanner::Found McapScanner::load(ScannedRecord& out) {
  switch (out.opcode) {
    case Opcode::kDataEnd:
    case Opcode::kFooter:
      finished_ = true;
      data_end_ = out.offset;
      return Found::kEnd;
    case Opcode::kAttachment:
      return load_attachment(out);
    case Opcode::kHeader:
    case Opcode::kSchema:
    case Opcode::kChannel:
    case Opcode::kMessage:
    case Opcode::kChunk:
    case Opcode::kMetadata:
      break;
    case Opcode::kMessageIndex:
      if (lost_chunk_) count_lost_messages(out);
      return Found::kPassOver;
    default:
      return Found::kPassOver;
  }
  const uint64_t size = out.length - mcap::kRecordHeadBytes;
  if (size > limits_.max_record_bytes) {
    loss_.note(out.offset, Error{ErrorCode::kResourceExhausted, "record", "is larger than the limit"});
    return Found::kBroken;
  }
  if (Status ok = read(out.offset + mcap::kRecordHeadBytes, size, content_); !ok) {
    loss_.note(out.offset, ok.error());
    return Found::kBroken;
  }
  out.content = content_;
  return out.opcode == Opcode::kChunk ? load_chunk(out) : Found::kRecord;
}

McapScanner::Found McapScanner::load_chunk(ScannedRecord& out) {
  if (!mcap::decode(out.content, out.chunk)) {
    loss_.note(out.offset, broken("the chunk's fields do not fit into it"));
    return Found::kBroken;
  }
  const Result<std::string_view> records = unpacker_.unpack(out.chunk);
  if (!records) {
    loss_.note(out.offset, records.error());
    return Found::kBroken;
  }
  out.records = *records;
  return Found::kRecord;
}

McapScanner::Found McapScanner::load_attachment(ScannedRecord& out) {
  if (!with_attachments_) return Found::kRecord;
  const uint64_t size = out.length - mcap::kRecordHeadBytes;
  mcap::Attachment attachment;
  if (size > limits_.max_attachment_bytes) {
    loss_.note(out.offset, Error{ErrorCode::kResourceExhausted, "attachment", "is larger than the limit"});
    return Found::kBroken;
  }
  if (!read(out.offset + mcap::kRecordHeadBytes, size, content_) || !mcap::decode(content_, attachment)) {
    loss_.note(out.offset, broken("the attachment's fields do not fit into it"));
    return Found::kBroken;
  }
  const size_t checked = static_cast<size_t>(attachment.data.data() + attachment.data.size() - content_.data());
  if (attachment.crc != 0 && mcap::crc32_of(std::string_view(content_).substr(0, checked)) != attachment.crc) {
    loss_.note(out.offset, broken("the attachment's CRC is wrong"));
    return Found::kBroken;
  }
  out.content = content_;
  return Found::kRecord;
}

void McapScanner::count_lost_messages(const ScannedRecord& index) {
  const uint64_t size = index.length - mcap::kRecordHeadBytes;
  constexpr uint64_t kFieldBytes = 6, kEntryBytes = 16;
  if (size >= kFieldBytes) loss_.messages += (size - kFieldBytes) / kEntryBytes;
}

// `from`: the beginning of a record that is not consistent. If its length is right, the next record begins behind it.
// Otherwise the search continues up to the next chunk or attachment whose data is consistent.
void McapScanner::pass_damage(uint64_t from) {
  char head[mcap::kRecordHeadBytes];
  if (from > 0 && plausible_head(from) && source_.read_at(from, head, sizeof head)) {
    const uint64_t behind = from + mcap::kRecordHeadBytes + read_u64(head + 1);
    if (static_cast<Opcode>(head[0]) == Opcode::kChunk) ++loss_.chunks;
    if (behind == source_.size() || plausible_head(behind)) {
      loss_.bytes += behind - from;
      position_ = behind;
      return;
    }
  }
  lost_chunk_ = false;
  const std::optional<uint64_t> next = find_next(from + 1);
  position_ = next.value_or(source_.size());
  loss_.bytes += position_ - from;
  if (!next) ended_ = true;
}

std::optional<uint64_t> McapScanner::find_next(uint64_t from) {
  while (from + mcap::kRecordHeadBytes <= source_.size() && search_budget_ > 0) {
    const uint64_t count = std::min(kWindowBytes, source_.size() - from);
    search_budget_ -= std::min(search_budget_, count);
    if (!read(from, count, window_)) return std::nullopt;
    for (uint64_t i = 0; i + mcap::kRecordHeadBytes <= count; ++i) {
      const Opcode opcode = static_cast<Opcode>(window_[i]);
      if (opcode != Opcode::kChunk && opcode != Opcode::kAttachment) continue;
      const uint64_t length = read_u64(window_.data() + i + 1);
      if (length > source_.size() - from - i - mcap::kRecordHeadBytes) continue;
      if (sound_at(from + i, opcode, length)) return from + i;
    }
    if (from + count == source_.size()) return std::nullopt;
    from += count - mcap::kRecordHeadBytes + 1;  // a head may lie across two windows
  }
  return std::nullopt;
}

bool McapScanner::sound_at(uint64_t offset, Opcode opcode, uint64_t content_length) {
  if (opcode == Opcode::kChunk && !chunk_head_fits(offset, content_length)) return false;
  const uint64_t limit = opcode == Opcode::kChunk ? limits_.max_record_bytes : limits_.max_attachment_bytes;
  // No attachment is shorter; this also keeps most chance hits from being loaded.
  constexpr uint64_t kLeastBytes = 36;
  if (content_length < kLeastBytes || content_length > limit || content_length > search_budget_) return false;
  if (!read(offset + mcap::kRecordHeadBytes, content_length, content_)) return false;
  search_budget_ -= content_length;
  if (opcode == Opcode::kChunk) {
    mcap::Chunk chunk;
    if (!mcap::decode(content_, chunk) || chunk.uncompressed_crc == 0) return false;
    search_budget_ -= std::min(search_budget_, chunk.uncompressed_size);
    return unpacker_.unpack(chunk).has_value();
  }
  mcap::Attachment attachment;
  if (!mcap::decode(content_, attachment) || attachment.crc == 0) return false;
  const size_t checked = static_cast<size_t>(attachment.data.data() + attachment.data.size() - content_.data());
  return mcap::crc32_of(std::string_view(content_).substr(0, checked)) == attachment.crc;
}

// Looks only at the head, so that chance hits cost nothing.
bool McapScanner::chunk_head_fits(uint64_t offset, uint64_t content_length) const {
  char head[kChunkHeadBytes + 4 + 8];
  if (content_length < kChunkHeadBytes + 8 || !source_.read_at(offset + mcap::kRecordHeadBytes, head, sizeof head))
    return false;
  const std::string_view name(head + 28, 8);
  const bool zstd = name == std::string_view("\4\0\0\0zstd", 8);
  const bool lz4 = name.substr(0, 7) == std::string_view("\3\0\0\0lz4", 7);
  const bool plain = name.substr(0, 4) == std::string_view("\0\0\0\0", 4);
  const uint64_t name_bytes = zstd ? 4 : lz4 ? 3 : 0;
  return (zstd || lz4 || plain) && read_u64(head) <= read_u64(head + 8) &&
         read_u64(head + 16) <= limits_.max_chunk_bytes &&
         read_u64(head + kChunkHeadBytes + name_bytes) == content_length - kChunkHeadBytes - name_bytes - 8;
}

}  // namespace sightline
