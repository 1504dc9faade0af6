#include "server/record/mcap_format.h"

#include <zlib.h>

#include <bit>
#include <cassert>
#include <cstring>
#include <limits>
#include <type_traits>

namespace sightline::mcap {
namespace {

static_assert(std::endian::native == std::endian::little, "integers are copied as they stand in memory");

// Bytes after their 8-byte length; strings have a 4-byte length.
template <typename Bytes>
struct Long {
  Bytes& bytes;
};
template <typename Bytes>
Long(Bytes&) -> Long<Bytes>;  // clang 14 does not find it by itself
// Bytes that fill the record up to its end.
template <typename Bytes>
struct Rest {
  Bytes& bytes;
};
template <typename Bytes>
Rest(Bytes&) -> Rest<Bytes>;

// Appends fields to a record, and writes the record's length when it is destroyed.
class Packer {
 public:
  Packer(std::string& out, Opcode opcode) : out_(out) {
    put(opcode);
    put(uint64_t{0});
    start_ = out_.size();
  }
  ~Packer() {
    const uint64_t length = out_.size() - start_;
    std::memcpy(out_.data() + start_ - sizeof length, &length, sizeof length);
  }
  Packer(const Packer&) = delete;
  Packer& operator=(const Packer&) = delete;

  void operator()(const auto&... fields) { (put(fields), ...); }
  std::string_view content() const { return std::string_view(out_).substr(start_); }

 private:
  template <typename T>
  requires std::is_unsigned_v<T> || std::is_enum_v<T>
  void put(T value) {
    char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    out_.append(bytes, sizeof value);
  }
  void put(std::string_view text) {
    assert(text.size() <= std::numeric_limits<uint32_t>::max());
    put(static_cast<uint32_t>(text.size()));
    out_.append(text);
  }
  void put(const Long<const std::string_view>& field) {
    put(static_cast<uint64_t>(field.bytes.size()));
    out_.append(field.bytes);
  }
  void put(const Rest<const std::string_view>& field) { out_.append(field.bytes); }
  // A map, or a list of pairs: its length in bytes, then its elements.
  template <typename Pairs>
  requires requires { typename Pairs::value_type::second_type; }
  void put(const Pairs& pairs) {
    const size_t length_at = out_.size();
    put(uint32_t{0});
    for (const auto& [key, value] : pairs) put(key), put(value);
    const size_t length = out_.size() - length_at - sizeof(uint32_t);
    assert(length <= std::numeric_limits<uint32_t>::max());
    const uint32_t wire = static_cast<uint32_t>(length);
    std::memcpy(out_.data() + length_at, &wire, sizeof wire);
  }

  std::string& out_;
  size_t start_ = 0;
};

// Takes fields off a record. After the first field that does not fit, every further one fails too.
class Unpacker {
 public:
  explicit Unpacker(std::string_view bytes) : bytes_(bytes) {}
  bool ok() const { return ok_; }
  std::string_view rest() const { return bytes_; }

  void operator()(auto&&... fields) { (take(fields), ...); }
  std::string_view take_bytes(uint64_t count) {
    if (!ok_ || count > bytes_.size()) {
      ok_ = false;
      return {};
    }
    const std::string_view taken = bytes_.substr(0, count);
    bytes_.remove_prefix(count);
    return taken;
  }

 private:
  template <typename T>
  requires std::is_unsigned_v<T> || std::is_enum_v<T>
  void take(T& out) {
    const std::string_view bytes = take_bytes(sizeof out);
    if (ok_) std::memcpy(&out, bytes.data(), sizeof out);
  }
  void take(std::string_view& out) {
    uint32_t length = 0;
    take(length);
    out = take_bytes(length);
  }
  void take(std::string& out) {
    std::string_view text;
    take(text);
    out = text;
  }
  void take(const Long<std::string_view>& field) {
    uint64_t length = 0;
    take(length);
    field.bytes = take_bytes(length);
  }
  void take(const Rest<std::string_view>& field) { field.bytes = take_bytes(bytes_.size()); }
  template <typename Pairs>
  requires requires { typename Pairs::value_type::second_type; }
  void take(Pairs& out) {
    out.clear();
    std::string_view bytes;
    take(bytes);
    Unpacker elements(bytes);
    while (ok_ && elements.ok() && !elements.bytes_.empty()) {
      std::remove_const_t<typename Pairs::value_type::first_type> key{};
      typename Pairs::value_type::second_type value{};
      elements(key, value);
      if (elements.ok()) out.insert(out.end(), {std::move(key), std::move(value)});
    }
    ok_ = ok_ && elements.ok();
  }

  std::string_view bytes_;
  bool ok_ = true;
};

// ---- the fields of each record, in the order of the file; one list for both directions ----

template <typename T, typename Record>
concept Is = std::is_same_v<std::remove_const_t<T>, Record>;

void fields(auto& list, Is<Header> auto& r) {
  list(r.profile, r.library);
}
void fields(auto& list, Is<Footer> auto& r) {
  list(r.summary_start, r.summary_offset_start, r.summary_crc);
}
void fields(auto& list, Is<Schema> auto& r) {
  list(r.id, r.name, r.encoding, r.data);
}
void fields(auto& list, Is<Channel> auto& r) {
  list(r.id, r.schema_id, r.topic, r.message_encoding, r.metadata);
}
void fields(auto& list, Is<Message> auto& r) {
  list(r.channel_id, r.sequence, r.log_time_ns, r.publish_time_ns, Rest{r.data});
}
void fields(auto& list, Is<Chunk> auto& r) {
  list(r.start_time_ns, r.end_time_ns, r.uncompressed_size, r.uncompressed_crc, r.compression, Long{r.records});
}
void fields(auto& list, Is<MessageIndex> auto& r) {
  list(r.channel_id, r.records);
}
void fields(auto& list, Is<ChunkIndex> auto& r) {
  list(r.start_time_ns, r.end_time_ns, r.chunk_start, r.chunk_length, r.message_index_offsets, r.message_index_length,
       r.compression, r.compressed_size, r.uncompressed_size);
}
// Without the CRC of what is listed here.
void fields(auto& list, Is<Attachment> auto& r) {
  list(r.log_time_ns, r.create_time_ns, r.name, r.content_type, Long{r.data});
}
void fields(auto& list, Is<AttachmentIndex> auto& r) {
  list(r.offset, r.length, r.log_time_ns, r.create_time_ns, r.data_size, r.name, r.content_type);
}
void fields(auto& list, Is<Statistics> auto& r) {
  list(r.message_count, r.schema_count, r.channel_count, r.attachment_count, r.metadata_count, r.chunk_count,
       r.start_time_ns, r.end_time_ns, r.channel_message_counts);
}
void fields(auto& list, Is<Metadata> auto& r) {
  list(r.name, r.values);
}
void fields(auto& list, Is<MetadataIndex> auto& r) {
  list(r.offset, r.length, r.name);
}
void fields(auto& list, Is<SummaryOffset> auto& r) {
  list(r.group_opcode, r.group_start, r.group_length);
}
void fields(auto& list, Is<DataEnd> auto& r) {
  list(r.data_crc);
}

}  // namespace

uint32_t crc32_of(std::string_view bytes, uint32_t before) {
  return static_cast<uint32_t>(
      crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));  // NOLINT: zlib's type
}

template <typename Record>
void append_record(std::string& out, const Record& record) {
  Packer pack(out, Record::kOpcode);
  fields(pack, record);
  if constexpr (std::is_same_v<Record, Attachment>) pack(crc32_of(pack.content()));
}

template <typename Record>
bool decode(std::string_view content, Record& out) {
  Unpacker unpack(content);
  fields(unpack, out);
  if constexpr (std::is_same_v<Record, Attachment>) unpack(out.crc);
  return unpack.ok();
}

template void append_record(std::string&, const Header&);
template bool decode(std::string_view, Header&);
template void append_record(std::string&, const Footer&);
template bool decode(std::string_view, Footer&);
template void append_record(std::string&, const Schema&);
template bool decode(std::string_view, Schema&);
template void append_record(std::string&, const Channel&);
template bool decode(std::string_view, Channel&);
template void append_record(std::string&, const Message&);
template bool decode(std::string_view, Message&);
template void append_record(std::string&, const Chunk&);
template bool decode(std::string_view, Chunk&);
template void append_record(std::string&, const MessageIndex&);
template bool decode(std::string_view, MessageIndex&);
template void append_record(std::string&, const ChunkIndex&);
template bool decode(std::string_view, ChunkIndex&);
template void append_record(std::string&, const Attachment&);
template bool decode(std::string_view, Attachment&);
template void append_record(std::string&, const AttachmentIndex&);
template bool decode(std::string_view, AttachmentIndex&);
template void append_record(std::string&, const Statistics&);
template bool decode(std::string_view, Statistics&);
template void append_record(std::string&, const Metadata&);
template bool decode(std::string_view, Metadata&);
template void append_record(std::string&, const MetadataIndex&);
template bool decode(std::string_view, MetadataIndex&);
template void append_record(std::string&, const SummaryOffset&);
template bool decode(std::string_view, SummaryOffset&);
template void append_record(std::string&, const DataEnd&);
template bool decode(std::string_view, DataEnd&);

bool decode_head(std::string_view content_start, AttachmentIndex& out) {
  Unpacker unpack(content_start);
  unpack(out.log_time_ns, out.create_time_ns, out.name, out.content_type, out.data_size);
  return unpack.ok();
}

bool take_record(std::string_view& bytes, RecordView& out) {
  Unpacker unpack(bytes);
  unpack(out.opcode, Long{out.content});
  if (!unpack.ok()) return false;
  bytes = unpack.rest();
  return true;
}

}  // namespace sightline::mcap
