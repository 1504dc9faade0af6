#include "server/record/mcap_format.h"

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cassert>
#include <cstring>
#include <limits>

namespace sightline::mcap {
namespace {

static_assert(std::endian::native == std::endian::little, "integers are copied as they stand in memory");

// Appends fields to a record and writes the record's length when it is done.
class Packer {
 public:
  Packer(std::string& out, Opcode opcode) : out_(out) {
    put(static_cast<uint8_t>(opcode));
    put(uint64_t{0});
    start_ = out_.size();
  }
  ~Packer() {
    const uint64_t length = out_.size() - start_;
    std::memcpy(out_.data() + start_ - sizeof length, &length, sizeof length);
  }
  Packer(const Packer&) = delete;
  Packer& operator=(const Packer&) = delete;

  template <typename T>
  void put(T value) {
    static_assert(std::is_unsigned_v<T>);
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    out_.append(bytes, sizeof value);
  }
  void put_text(std::string_view text) {
    assert(text.size() <= std::numeric_limits<uint32_t>::max());
    put(static_cast<uint32_t>(text.size()));
    out_.append(text);
  }
  void put_bytes(std::string_view bytes) { out_.append(bytes); }

  // What `put_elements` appends, led by its length in bytes.
  template <typename PutElements>
  void put_sized(PutElements put_elements) {
    const size_t length_at = out_.size();
    put(uint32_t{0});
    put_elements();
    const size_t length = out_.size() - length_at - sizeof(uint32_t);
    assert(length <= std::numeric_limits<uint32_t>::max());
    const uint32_t wire = static_cast<uint32_t>(length);
    std::memcpy(out_.data() + length_at, &wire, sizeof wire);
  }
  void put_map(const std::map<std::string, std::string>& values) {
    put_sized([&] {
      for (const auto& [key, value] : values) put_text(key), put_text(value);
    });
  }
  void put_map(const std::map<uint16_t, uint64_t>& values) {
    put_sized([&] {
      for (const auto& [key, value] : values) put(key), put(value);
    });
  }
  std::string_view content() const { return std::string_view(out_).substr(start_); }

 private:
  std::string& out_;
  size_t start_ = 0;
};

// Takes fields off a record. After the first that does not fit, every further one fails too.
class Unpacker {
 public:
  explicit Unpacker(std::string_view bytes) : bytes_(bytes) {}

  bool ok() const { return ok_; }
  bool empty() const { return bytes_.empty(); }
  size_t left() const { return bytes_.size(); }
  std::string_view rest() const { return bytes_; }

  template <typename T>
  T take() {
    T value{};
    const std::string_view bytes = take_bytes(sizeof value);
    if (ok_) std::memcpy(&value, bytes.data(), sizeof value);
    return value;
  }
  template <typename T>
  void take(T& out) {
    out = take<T>();
  }
  std::string_view take_bytes(uint64_t count) {
    if (!ok_ || count > bytes_.size()) {
      ok_ = false;
      return {};
    }
    const std::string_view taken = bytes_.substr(0, count);
    bytes_.remove_prefix(count);
    return taken;
  }
  std::string_view take_text() { return take_bytes(take<uint32_t>()); }
  void take_map(std::map<std::string, std::string>& out) {
    Unpacker elements(take_text());
    while (ok_ && elements.ok() && !elements.empty()) {
      const std::string_view key = elements.take_text();
      const std::string_view value = elements.take_text();
      if (elements.ok()) out.emplace(key, value);
    }
    ok_ = ok_ && elements.ok();
  }
  void take_map(std::map<uint16_t, uint64_t>& out) {
    Unpacker elements(take_text());
    while (ok_ && elements.ok() && !elements.empty()) {
      const uint16_t key = elements.take<uint16_t>();
      const uint64_t value = elements.take<uint64_t>();
      if (elements.ok()) out.emplace(key, value);
    }
    ok_ = ok_ && elements.ok();
  }

 private:
  std::string_view bytes_;
  bool ok_ = true;
};

}  // namespace

uint32_t crc32_of(std::string_view bytes, uint32_t before) {
  return static_cast<uint32_t>(
      crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));  // NOLINT: zlib's type
}

void append_record(std::string& out, const Header& record) {
  Packer pack(out, Opcode::kHeader);
  pack.put_text(record.profile);
  pack.put_text(record.library);
}

void append_record(std::string& out, const Footer& record) {
  Packer pack(out, Opcode::kFooter);
  pack.put(record.summary_start);
  pack.put(record.summary_offset_start);
  pack.put(record.summary_crc);
}

void append_record(std::string& out, const Schema& record) {
  Packer pack(out, Opcode::kSchema);
  pack.put(record.id);
  pack.put_text(record.name);
  pack.put_text(record.encoding);
  pack.put_text(record.data);
}

void append_record(std::string& out, const Channel& record) {
  Packer pack(out, Opcode::kChannel);
  pack.put(record.id);
  pack.put(record.schema_id);
  pack.put_text(record.topic);
  pack.put_text(record.message_encoding);
  pack.put_map(record.metadata);
}

void append_record(std::string& out, const Message& record) {
  Packer pack(out, Opcode::kMessage);
  pack.put(record.channel_id);
  pack.put(record.sequence);
  pack.put(record.log_time_ns);
  pack.put(record.publish_time_ns);
  pack.put_bytes(record.data);
}

void append_record(std::string& out, const Chunk& record) {
  Packer pack(out, Opcode::kChunk);
  pack.put(record.start_time_ns);
  pack.put(record.end_time_ns);
  pack.put(record.uncompressed_size);
  pack.put(record.uncompressed_crc);
  pack.put_text(record.compression);
  pack.put(static_cast<uint64_t>(record.records.size()));
  pack.put_bytes(record.records);
}

void append_record(std::string& out, const MessageIndex& record) {
  Packer pack(out, Opcode::kMessageIndex);
  pack.put(record.channel_id);
  pack.put_sized([&] {
    for (const auto& [time_ns, offset] : record.records) pack.put(time_ns), pack.put(offset);
  });
}

void append_record(std::string& out, const ChunkIndex& record) {
  Packer pack(out, Opcode::kChunkIndex);
  pack.put(record.start_time_ns);
  pack.put(record.end_time_ns);
  pack.put(record.chunk_start);
  pack.put(record.chunk_length);
  pack.put_map(record.message_index_offsets);
  pack.put(record.message_index_length);
  pack.put_text(record.compression);
  pack.put(record.compressed_size);
  pack.put(record.uncompressed_size);
}

void append_record(std::string& out, const Attachment& record) {
  Packer pack(out, Opcode::kAttachment);
  pack.put(record.log_time_ns);
  pack.put(record.create_time_ns);
  pack.put_text(record.name);
  pack.put_text(record.content_type);
  pack.put(static_cast<uint64_t>(record.data.size()));
  pack.put_bytes(record.data);
  pack.put(crc32_of(pack.content()));
}

void append_record(std::string& out, const AttachmentIndex& record) {
  Packer pack(out, Opcode::kAttachmentIndex);
  pack.put(record.offset);
  pack.put(record.length);
  pack.put(record.log_time_ns);
  pack.put(record.create_time_ns);
  pack.put(record.data_size);
  pack.put_text(record.name);
  pack.put_text(record.content_type);
}

void append_record(std::string& out, const Statistics& record) {
  Packer pack(out, Opcode::kStatistics);
  pack.put(record.message_count);
  pack.put(record.schema_count);
  pack.put(record.channel_count);
  pack.put(record.attachment_count);
  pack.put(record.metadata_count);
  pack.put(record.chunk_count);
  pack.put(record.start_time_ns);
  pack.put(record.end_time_ns);
  pack.put_map(record.channel_message_counts);
}

void append_record(std::string& out, const Metadata& record) {
  Packer pack(out, Opcode::kMetadata);
  pack.put_text(record.name);
  pack.put_map(record.values);
}

void append_record(std::string& out, const MetadataIndex& record) {
  Packer pack(out, Opcode::kMetadataIndex);
  pack.put(record.offset);
  pack.put(record.length);
  pack.put_text(record.name);
}

void append_record(std::string& out, const SummaryOffset& record) {
  Packer pack(out, Opcode::kSummaryOffset);
  pack.put(static_cast<uint8_t>(record.group_opcode));
  pack.put(record.group_start);
  pack.put(record.group_length);
}

void append_record(std::string& out, const DataEnd& record) {
  Packer pack(out, Opcode::kDataEnd);
  pack.put(record.data_crc);
}

bool decode(std::string_view content, Header& out) {
  Unpacker unpack(content);
  out.profile = unpack.take_text();
  out.library = unpack.take_text();
  return unpack.ok();
}

bool decode(std::string_view content, Footer& out) {
  Unpacker unpack(content);
  unpack.take(out.summary_start);
  unpack.take(out.summary_offset_start);
  unpack.take(out.summary_crc);
  return unpack.ok();
}

bool decode(std::string_view content, Schema& out) {
  Unpacker unpack(content);
  unpack.take(out.id);
  out.name = unpack.take_text();
  out.encoding = unpack.take_text();
  out.data = unpack.take_text();
  return unpack.ok();
}

bool decode(std::string_view content, Channel& out) {
  Unpacker unpack(content);
  unpack.take(out.id);
  unpack.take(out.schema_id);
  out.topic = unpack.take_text();
  out.message_encoding = unpack.take_text();
  out.metadata.clear();
  unpack.take_map(out.metadata);
  return unpack.ok();
}

bool decode(std::string_view content, Message& out) {
  Unpacker unpack(content);
  unpack.take(out.channel_id);
  unpack.take(out.sequence);
  unpack.take(out.log_time_ns);
  unpack.take(out.publish_time_ns);
  out.data = unpack.rest();
  return unpack.ok();
}

bool decode(std::string_view content, Chunk& out) {
  Unpacker unpack(content);
  unpack.take(out.start_time_ns);
  unpack.take(out.end_time_ns);
  unpack.take(out.uncompressed_size);
  unpack.take(out.uncompressed_crc);
  out.compression = unpack.take_text();
  out.records = unpack.take_bytes(unpack.take<uint64_t>());
  return unpack.ok();
}

bool decode(std::string_view content, MessageIndex& out) {
  Unpacker unpack(content);
  unpack.take(out.channel_id);
  Unpacker elements(unpack.take_text());
  constexpr size_t kElementBytes = 16;
  if (!unpack.ok() || elements.left() % kElementBytes != 0) return false;
  out.records.clear();
  out.records.reserve(elements.left() / kElementBytes);
  while (!elements.empty()) {
    const uint64_t time_ns = elements.take<uint64_t>();
    out.records.emplace_back(time_ns, elements.take<uint64_t>());
  }
  return true;
}

bool decode(std::string_view content, ChunkIndex& out) {
  Unpacker unpack(content);
  unpack.take(out.start_time_ns);
  unpack.take(out.end_time_ns);
  unpack.take(out.chunk_start);
  unpack.take(out.chunk_length);
  out.message_index_offsets.clear();
  unpack.take_map(out.message_index_offsets);
  unpack.take(out.message_index_length);
  out.compression = unpack.take_text();
  unpack.take(out.compressed_size);
  unpack.take(out.uncompressed_size);
  return unpack.ok();
}

bool decode(std::string_view content, Attachment& out) {
  Unpacker unpack(content);
  unpack.take(out.log_time_ns);
  unpack.take(out.create_time_ns);
  out.name = unpack.take_text();
  out.content_type = unpack.take_text();
  out.data = unpack.take_bytes(unpack.take<uint64_t>());
  unpack.take(out.crc);
  return unpack.ok();
}

bool decode(std::string_view content, AttachmentIndex& out) {
  Unpacker unpack(content);
  unpack.take(out.offset);
  unpack.take(out.length);
  unpack.take(out.log_time_ns);
  unpack.take(out.create_time_ns);
  unpack.take(out.data_size);
  out.name = unpack.take_text();
  out.content_type = unpack.take_text();
  return unpack.ok();
}

bool decode(std::string_view content, Statistics& out) {
  Unpacker unpack(content);
  unpack.take(out.message_count);
  unpack.take(out.schema_count);
  unpack.take(out.channel_count);
  unpack.take(out.attachment_count);
  unpack.take(out.metadata_count);
  unpack.take(out.chunk_count);
  unpack.take(out.start_time_ns);
  unpack.take(out.end_time_ns);
  out.channel_message_counts.clear();
  unpack.take_map(out.channel_message_counts);
  return unpack.ok();
}

bool decode(std::string_view content, Metadata& out) {
  Unpacker unpack(content);
  out.name = unpack.take_text();
  out.values.clear();
  unpack.take_map(out.values);
  return unpack.ok();
}

bool decode(std::string_view content, MetadataIndex& out) {
  Unpacker unpack(content);
  unpack.take(out.offset);
  unpack.take(out.length);
  out.name = unpack.take_text();
  return unpack.ok();
}

bool decode(std::string_view content, SummaryOffset& out) {
  Unpacker unpack(content);
  out.group_opcode = static_cast<Opcode>(unpack.take<uint8_t>());
  unpack.take(out.group_start);
  unpack.take(out.group_length);
  return unpack.ok();
}

bool decode(std::string_view content, DataEnd& out) {
  Unpacker unpack(content);
  unpack.take(out.data_crc);
  return unpack.ok();
}

bool decode_head(std::string_view content_start, AttachmentIndex& out) {
  Unpacker unpack(content_start);
  unpack.take(out.log_time_ns);
  unpack.take(out.create_time_ns);
  out.name = unpack.take_text();
  out.content_type = unpack.take_text();
  unpack.take(out.data_size);
  return unpack.ok();
}

bool take_record(std::string_view& bytes, RecordView& out) {
  Unpacker unpack(bytes);
  out.opcode = static_cast<Opcode>(unpack.take<uint8_t>());
  out.content = unpack.take_bytes(unpack.take<uint64_t>());
  if (!unpack.ok()) return false;
  bytes = unpack.rest();
  return true;
}

}  // namespace sightline::mcap
