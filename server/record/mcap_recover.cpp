#include "server/record/mcap_recover.h"

#include <optional>

#include "server/record/chunk_codec.h"
#include "server/record/mcap_reader.h"
#include "server/record/mcap_scanner.h"

namespace sightline {
namespace {

using mcap::Opcode;

// The copy, which has its own ids.
class Copy {
 public:
  Copy(const ByteSource& source, ByteSink& sink, McapLimits limits, McapWriterOptions options, McapRecovery& done)
      : source_(source),
        sink_(sink),
        limits_(limits),
        options_(std::move(options)),
        room_(limits.max_definition_bytes),
        done_(done) {}

  Status take(const mcap::RecordView& record, uint64_t offset) {
    offset_ = offset;
    switch (record.opcode) {
      case Opcode::kHeader:
        return take_header(record.content);
      case Opcode::kSchema:
        return take_schema(record.content);
      case Opcode::kChannel:
        return take_channel(record.content);
      case Opcode::kMessage:
        return take_message(record.content);
      case Opcode::kAttachment:
        return take_attachment(record.content);
      case Opcode::kMetadata:
        return take_metadata(record.content);
      default:
        return {};
    }
  }
  bool empty() const { return !writer_; }
  Status add(const mcap::Metadata& metadata) { return writer().add_metadata(metadata); }
  Status finish() { return writer().finish(); }

 private:
  McapWriter& writer() {
    if (!writer_) writer_.emplace(sink_, options_);
    return *writer_;
  }
  Status lose(const char* what) {
    done_.loss.note(offset_, Error{ErrorCode::kDataLoss, "record", what});
    return {};
  }
  // A record that is refused is a loss; an error of the sink ends the copy.
  Status lose_unless_sink(const Error& error) {
    if (writer().status()) return lose(error.message.c_str());
    return tl::unexpected(error);
  }

  Status take_header(std::string_view content) {
    mcap::Header header;
    if (writer_ || !mcap::decode(content, header)) return lose("a header that does not fit");
    options_.profile = header.profile;
    options_.library = header.library;
    writer();
    return {};
  }

  // Definitions are only written when a message needs them. Those outside chunks have no CRC, and in files of earlier
  // versions the chunk that first uses one repeats it.
  Status take_schema(std::string_view content) {
    mcap::Schema schema;
    if (!mcap::decode(content, schema) || content.size() > room_) return lose("a schema that does not fit");
    if (schema.id == 0 || schemas_.contains(schema.id)) return {};
    room_ -= content.size();
    known_schemas_[schema.id] = std::move(schema);
    return {};
  }

  Status take_channel(std::string_view content) {
    mcap::Channel channel;
    if (!mcap::decode(content, channel) || content.size() > room_) return lose("a channel that does not fit");
    if (channels_.contains(channel.id)) return {};
    room_ -= content.size();
    known_channels_[channel.id] = std::move(channel);
    return {};
  }

  // Null: no sound part of the source has it. A lost chunk may have held the only record in the data; the summary
  // repeats it.
  template <typename Record>
  const Record* find(uint16_t id, const std::map<uint16_t, Record>& known,
                     std::map<uint16_t, Record> McapInfo::*repeated) {
    if (const auto found = known.find(id); found != known.end()) return &found->second;
    const McapInfo* whole = whole_source();
    if (whole == nullptr) return nullptr;
    const auto found = (whole->*repeated).find(id);
    return found == (whole->*repeated).end() ? nullptr : &found->second;
  }
  // Opened once, when a definition is missing: without a summary it scans the whole source. Null: it cannot be opened.
  const McapInfo* whole_source() {
    if (!whole_) whole_.emplace(McapReader::open(source_, limits_));
    return *whole_ ? &(*whole_)->info() : nullptr;
  }

  // The copy's ids.
  Result<uint16_t> schema_of(uint16_t id) {
    if (id == 0) return uint16_t{0};
    if (const auto done = schemas_.find(id); done != schemas_.end()) return done->second;
    const mcap::Schema* schema = find(id, known_schemas_, &McapInfo::schemas);
    if (schema == nullptr) return fail(ErrorCode::kDataLoss, "schema", "a channel without its schema");
    const Result<uint16_t> made = writer().add_schema(schema->name, schema->encoding, schema->data);
    if (made) schemas_[id] = *made;
    return made;
  }

  Result<uint16_t> channel_of(uint16_t id) {
    if (const auto done = channels_.find(id); done != channels_.end()) return done->second;
    const mcap::Channel* channel = find(id, known_channels_, &McapInfo::channels);
    if (channel == nullptr) return fail(ErrorCode::kDataLoss, "channel", "a message without its channel");
    const Result<uint16_t> schema = schema_of(channel->schema_id);
    if (!schema) return schema;
    const Result<uint16_t> made = writer().add_channel(channel->topic, *schema, channel->message_encoding,
                                                       channel->metadata);
    if (made) channels_[id] = *made;
    return made;
  }

  Status take_message(std::string_view content) {
    mcap::Message message;
    Status written = fail(ErrorCode::kDataLoss, "message", "a message that is too short");
    if (mcap::decode(content, message)) {
      const Result<uint16_t> channel = channel_of(message.channel_id);
      message.channel_id = channel.value_or(0);
      written = channel ? writer().write(message) : tl::unexpected(channel.error());
    }
    if (written) {
      ++done_.messages;
      return {};
    }
    ++done_.loss.messages;
    return lose_unless_sink(written.error());
  }

  Status take_attachment(std::string_view content) {
    mcap::Attachment attachment;
    if (!mcap::decode(content, attachment)) return lose("an attachment that is too short");
    if (Status ok = writer().attach(std::move(attachment)); !ok) return lose_unless_sink(ok.error());
    ++done_.attachments;
    return {};
  }

  Status take_metadata(std::string_view content) {
    mcap::Metadata metadata;
    if (!mcap::decode(content, metadata)) return lose("metadata that are too short");
    if (Status ok = writer().add_metadata(metadata); !ok) return ok;
    ++done_.metadata;
    return {};
  }

  const ByteSource& source_;
  ByteSink& sink_;
  const McapLimits limits_;
  McapWriterOptions options_;
  uint64_t room_;                                   // bytes of schemas and channels that may still be kept
  std::map<uint16_t, mcap::Schema> known_schemas_;  // the newest, by the source's id
  std::map<uint16_t, mcap::Channel> known_channels_;
  std::optional<Result<McapReader>> whole_;
  McapRecovery& done_;
  std::optional<McapWriter> writer_;
  std::map<uint16_t, uint16_t> schemas_;  // written: id in the copy by id in the source
  std::map<uint16_t, uint16_t> channels_;
  uint64_t offset_ = 0;
};

}  // namespace

Result<McapRecovery> recover_mcap(const ByteSource& source, ByteSink& sink, McapLimits limits,
                                  McapWriterOptions options, const RecoveryNote& note) {
  McapRecovery done;
  Copy copy(source, sink, limits, std::move(options), done);
  McapScanner scanner(source, limits, true);
  ScannedRecord record;
  while (scanner.next(record)) {
    if (record.opcode != Opcode::kChunk) {
      if (Status ok = copy.take({record.opcode, record.content}, record.offset); !ok) return tl::unexpected(ok.error());
      continue;
    }
    ++done.chunks;
    mcap::RecordView part;
    while (mcap::take_record(record.records, part))
      if (Status ok = copy.take(part, record.offset); !ok) return tl::unexpected(ok.error());
  }
  if (scanner.exhausted()) return tl::unexpected(unpacks_too_far(limits.unpacked_within(source.size())));
  if (copy.empty()) return fail(ErrorCode::kDataLoss, "", "holds no sound record of MCAP");
  McapLoss loss = scanner.loss();
  for (McapTrouble& trouble : done.loss.first_troubles) loss.note(trouble.offset, std::move(trouble.error));
  loss.messages += done.loss.messages;
  done.loss = std::move(loss);
  done.was_finished = scanner.finished();
  if (const auto metadata = note ? note(done) : std::nullopt)
    if (Status ok = copy.add(*metadata); !ok) return tl::unexpected(ok.error());
  if (Status ok = copy.finish(); !ok) return tl::unexpected(ok.error());
  return done;
}

}  // namespace sightline
