// Writes an MCAP file (https://mcap.dev/spec) from front to back, never going back:
//
//   McapWriter writer(sink, {});
//   const uint16_t schema = *writer.add_schema("sightline.v1.Tick", "protobuf", descriptors);
//   const uint16_t channel = *writer.add_channel("/tick", schema, "protobuf", {});
//   writer.write(channel, now_ns, now_ns, bytes);  ...
//   writer.finish();
//
// Messages are gathered into chunks (zstd, CRC), each followed by an index of its messages. The file ends with a
// summary: schemas, channels, statistics, and the indexes of chunks, attachments and metadata. A file that is cut off
// before finish() lacks only the summary and the open chunk. A schema or channel stands once in the data, in the chunk
// that first uses it, where a CRC covers it; the summary repeats it. One that no message uses is not in the file.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/error.h"
#include "server/record/byte_io.h"
#include "server/record/chunk_codec.h"
#include "server/record/mcap_format.h"

namespace sightline {

// A reader with the default limits accepts everything within these limits.
inline constexpr uint64_t kMaxMessageBytes = uint64_t{32} << 20;
inline constexpr uint64_t kMaxAttachmentBytes = uint64_t{1} << 30;

struct McapWriterOptions {
  std::string profile = {};
  std::string library = "sightline";
  // A message closes the chunk when the chunk reaches this size (unpacked), or this age by log time. Smaller chunks
  // lose less when the process is killed; larger ones take fewer bytes on the disk.
  uint64_t chunk_bytes = uint64_t{1} << 20;  // [1, 32 MiB]
  std::chrono::nanoseconds chunk_time{500'000'000};
  int zstd_level = 1;                             // [1, 19]; 0: not packed
  uint64_t max_message_bytes = kMaxMessageBytes;  // no more than that; tests have less
};

// Not thread-safe. Errors of the sink stick: once a call has failed so, every later one fails in the same way and
// writes nothing. A call refused for its arguments leaves the file as it was.
class McapWriter {
 public:
  // Writes the head of the file at once; should that fail, the first call says so. `sink` must outlive the writer.
  McapWriter(ByteSink& sink, McapWriterOptions options);

  // Ids count from 1. Fail with kResourceExhausted after 65535 of them.
  Result<uint16_t> add_schema(std::string name, std::string encoding, std::string data);
  // `schema_id` 0: none. kNotFound for a schema that was not added.
  Result<uint16_t> add_channel(std::string topic, uint16_t schema_id, std::string message_encoding,
                               std::map<std::string, std::string> metadata);

  // The channel's own count, from 1 on, becomes the sequence. kNotFound for a channel that was not added,
  // kResourceExhausted over `max_message_bytes`.
  Status write(uint16_t channel_id, uint64_t log_time_ns, uint64_t publish_time_ns, std::string_view data);
  // The same with a sequence from elsewhere (a copy of a recording).
  Status write(const mcap::Message& message);

  // Written at once, between chunks: the open chunk is closed first. kResourceExhausted over kMaxAttachmentBytes.
  Status attach(mcap::Attachment attachment);
  Status add_metadata(const mcap::Metadata& metadata);

  // Hands all messages so far to the sink. Call it when time passes without messages.
  Status end_chunk();
  // False: no message waits.
  bool has_open_chunk() const { return open_messages_ > 0; }

  // Closes the chunk and writes the summary. Afterwards only bytes_written() may be called.
  Status finish();

  // The first error of the sink, which all later calls repeat; or success.
  const Status& status() const { return trouble_; }
  // Handed to the sink.
  uint64_t bytes_written() const { return position_; }

 private:
  struct SchemaState {
    mcap::Schema schema;
    bool written = false;  // its record is in a chunk
  };
  struct ChannelState {
    mcap::Channel channel;
    uint64_t messages = 0;
    uint32_t last_sequence = 0;
    bool written = false;                                   // its record is in a chunk
    std::vector<std::pair<uint64_t, uint64_t>> open_index;  // of the open chunk
  };

  ChannelState* find(uint16_t channel_id);
  Status put(std::string_view bytes);
  Status put_pending();
  void note_time(uint64_t log_time_ns);
  void introduce(ChannelState& state);
  mcap::ChunkIndex put_message_indexes(uint64_t chunk_start, uint64_t chunk_length);
  std::string summary(mcap::Footer& footer) const;

  ByteSink& sink_;
  const McapWriterOptions options_;
  ChunkPacker packer_;
  Status trouble_;
  uint64_t position_ = 0;
  uint32_t data_crc_ = 0;
  std::string pending_;  // records on their way to the sink

  std::vector<SchemaState> schemas_;    // id - 1
  std::vector<ChannelState> channels_;  // id - 1
  std::vector<mcap::ChunkIndex> chunks_;
  std::vector<mcap::AttachmentIndex> attachments_;
  std::vector<mcap::MetadataIndex> metadata_;
  mcap::Statistics statistics_;

  std::string open_chunk_;
  uint64_t open_messages_ = 0;
  uint64_t first_time_ns_ = 0;  // of the open chunk, in the order of writing
  uint64_t least_time_ns_ = 0;
  uint64_t greatest_time_ns_ = 0;
};

}  // namespace sightline
