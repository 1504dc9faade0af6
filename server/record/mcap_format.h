// The records of MCAP, the container of recordings, and their bytes: https://mcap.dev/spec (major version 0). Every
// record is <opcode, 1 byte> <length of the body, 8 bytes> <body>. Integers are little-endian. A string is its length
// in 4 bytes, then its bytes. Arrays and maps are their length in bytes, in 4 bytes, then the elements. Times are
// nanoseconds, in our recordings since 1970 (UTC). CRCs are CRC-32 as in zlib; 0 means that there is none.
//
// This file only translates records. mcap_writer.h, mcap_scanner.h and mcap_reader.h know their order in a file.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace sightline::mcap {

inline constexpr std::string_view kMagic{"\x89MCAP0\r\n", 8};
inline constexpr uint64_t kRecordHeadBytes = 9;                                 // opcode and length
inline constexpr uint64_t kDataEndBytes = kRecordHeadBytes + sizeof(uint32_t);  // a whole DataEnd record
inline constexpr uint64_t kFooterContentBytes = 20;
// A whole Footer record and the magic after it, the end of a finished file.
inline constexpr uint64_t kTailBytes = kRecordHeadBytes + kFooterContentBytes + kMagic.size();

enum class Opcode : uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kAttachment = 0x09,
  kAttachmentIndex = 0x0A,
  kStatistics = 0x0B,
  kMetadata = 0x0C,
  kMetadataIndex = 0x0D,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

struct Header {
  static constexpr Opcode kOpcode = Opcode::kHeader;
  std::string profile;  // empty: none
  std::string library;  // the program that wrote the file, as text
};

struct Footer {
  static constexpr Opcode kOpcode = Opcode::kFooter;
  uint64_t summary_start = 0;         // from the start of the file; 0: no summary
  uint64_t summary_offset_start = 0;  // the same; 0: no summary offsets
  uint32_t summary_crc = 0;           // from summary_start up to this field
};

struct Schema {
  static constexpr Opcode kOpcode = Opcode::kSchema;
  uint16_t id = 0;  // not 0
  std::string name;
  std::string encoding;  // "protobuf": data is a serialised google.protobuf.FileDescriptorSet
  std::string data;
  bool operator==(const Schema&) const = default;
};

struct Channel {
  static constexpr Opcode kOpcode = Opcode::kChannel;
  uint16_t id = 0;
  uint16_t schema_id = 0;  // 0: no schema
  std::string topic;
  std::string message_encoding;
  std::map<std::string, std::string> metadata;
  bool operator==(const Channel&) const = default;
};

// `data` is a view of the bytes that the message was decoded from or will be encoded from.
struct Message {
  static constexpr Opcode kOpcode = Opcode::kMessage;
  uint16_t channel_id = 0;
  uint32_t sequence = 0;
  uint64_t log_time_ns = 0;
  uint64_t publish_time_ns = 0;
  std::string_view data;
};

struct Chunk {
  static constexpr Opcode kOpcode = Opcode::kChunk;
  uint64_t start_time_ns = 0;  // least and greatest log time inside; both 0 without messages
  uint64_t end_time_ns = 0;
  uint64_t uncompressed_size = 0;
  uint32_t uncompressed_crc = 0;
  std::string_view compression;  // "zstd", "lz4" or ""
  std::string_view records;      // schemas, channels and messages, compressed so
};

struct MessageIndex {
  static constexpr Opcode kOpcode = Opcode::kMessageIndex;
  uint16_t channel_id = 0;
  std::vector<std::pair<uint64_t, uint64_t>> records;  // log time, offset in the uncompressed chunk
};

struct ChunkIndex {
  static constexpr Opcode kOpcode = Opcode::kChunkIndex;
  uint64_t start_time_ns = 0;
  uint64_t end_time_ns = 0;
  uint64_t chunk_start = 0;   // from the start of the file
  uint64_t chunk_length = 0;  // of the whole record
  std::map<uint16_t, uint64_t> message_index_offsets;
  uint64_t message_index_length = 0;
  std::string compression;
  uint64_t compressed_size = 0;
  uint64_t uncompressed_size = 0;
};

struct Attachment {
  static constexpr Opcode kOpcode = Opcode::kAttachment;
  uint64_t log_time_ns = 0;
  uint64_t create_time_ns = 0;
  std::string name;
  std::string content_type;
  std::string_view data;  // a view, as in Message
  uint32_t crc = 0;       // of the fields above; filled by append_record
};

struct AttachmentIndex {
  static constexpr Opcode kOpcode = Opcode::kAttachmentIndex;
  uint64_t offset = 0;
  uint64_t length = 0;  // of the whole record
  uint64_t log_time_ns = 0;
  uint64_t create_time_ns = 0;
  uint64_t data_size = 0;
  std::string name;
  std::string content_type;
};

struct Statistics {
  static constexpr Opcode kOpcode = Opcode::kStatistics;
  uint64_t message_count = 0;
  uint16_t schema_count = 0;
  uint32_t channel_count = 0;
  uint32_t attachment_count = 0;
  uint32_t metadata_count = 0;
  uint32_t chunk_count = 0;
  uint64_t start_time_ns = 0;
  uint64_t end_time_ns = 0;
  std::map<uint16_t, uint64_t> channel_message_counts;
};

struct Metadata {
  static constexpr Opcode kOpcode = Opcode::kMetadata;
  std::string name;
  std::map<std::string, std::string> values;
};

struct MetadataIndex {
  static constexpr Opcode kOpcode = Opcode::kMetadataIndex;
  uint64_t offset = 0;
  uint64_t length = 0;
  std::string name;
};

struct SummaryOffset {
  static constexpr Opcode kOpcode = Opcode::kSummaryOffset;
  Opcode group_opcode = Opcode::kSchema;
  uint64_t group_start = 0;
  uint64_t group_length = 0;
};

struct DataEnd {
  static constexpr Opcode kOpcode = Opcode::kDataEnd;
  uint32_t data_crc = 0;  // of the file from its first byte to the last before this record
};

// CRC-32 of `bytes`, going on from that of what came before.
uint32_t crc32_of(std::string_view bytes, uint32_t before = 0);

// Appends one whole record, of any of the kinds above. A string or array of 4 GiB or more is a misuse (asserted).
template <typename Record>
void append_record(std::string& out, const Record& record);

// Reads the fields of one record; `content` has neither its opcode nor its length. Returns false when it is too short
// for the sizes that it declares; `out` is then unspecified. Bytes after the known fields are ignored, as the
// specification asks. Never allocates more than a small multiple of the size of `content`.
template <typename Record>
bool decode(std::string_view content, Record& out);

// Reads the fields of an attachment that precede its data, from its first bytes. Does not change `offset` and `length`.
// Returns false when there are too few bytes.
bool decode_head(std::string_view content_start, AttachmentIndex& out);

// Removes the record at the front of `bytes`. Returns false, and leaves `bytes`, at the end or when the rest is too
// short for the record that it begins.
struct RecordView {
  Opcode opcode = Opcode::kHeader;
  std::string_view content;
};
bool take_record(std::string_view& bytes, RecordView& out);

}  // namespace sightline::mcap
