#include "server/record/mcap_writer.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace sightline {
namespace {

constexpr size_t kMaxIds = std::numeric_limits<uint16_t>::max();

Error too_many(const char* what) {
  return Error{ErrorCode::kResourceExhausted, what, "must be at most 65535 in a file"};
}

Status check_size(const char* what, uint64_t size, uint64_t limit) {
  if (size <= limit) return {};
  return fail(ErrorCode::kResourceExhausted, what,
              "must be at most " + std::to_string(limit) + " bytes, got " + std::to_string(size));
}

// Appends `records` as one group of the summary and remembers where it stands.
template <typename Records>
void append_group(std::string& summary, uint64_t summary_start, mcap::Opcode opcode, const Records& records,
                  std::vector<mcap::SummaryOffset>& offsets) {
  const size_t start = summary.size();
  for (const auto& record : records) mcap::append_record(summary, record);
  if (summary.size() > start) offsets.push_back({opcode, summary_start + start, summary.size() - start});
}

// The records that are in the data, and so belong into the summary.
template <typename State, typename Record>
std::vector<Record> written(const std::vector<State>& states, Record State::*record) {
  std::vector<Record> found;
  for (const State& state : states)
    if (state.written) found.push_back(state.*record);
  return found;
}

}  // namespace

McapWriter::McapWriter(ByteSink& sink, McapWriterOptions options)
    : sink_(sink), options_(std::move(options)), packer_(options_.zstd_level) {
  pending_ = mcap::kMagic;
  mcap::append_record(pending_, mcap::Header{options_.profile, options_.library});
  trouble_ = put_pending();
}

McapWriter::ChannelState* McapWriter::find(uint16_t channel_id) {
  return channel_id >= 1 && channel_id <= channels_.size() ? &channels_[channel_id - 1] : nullptr;
}

Status McapWriter::put(std::string_view bytes) {
  if (!trouble_) return trouble_;
  trouble_ = sink_.write(bytes);
  if (trouble_) position_ += bytes.size();
  return trouble_;
}

Status McapWriter::put_pending() {
  data_crc_ = mcap::crc32_of(pending_, data_crc_);
  const Status done = put(pending_);
  pending_.clear();
  return done;
}

Result<uint16_t> McapWriter::add_schema(std::string name, std::string encoding, std::string data) {
  if (!trouble_) return tl::unexpected(trouble_.error());
  if (schemas_.size() == kMaxIds) return tl::unexpected(too_many("schemas"));
  const uint16_t id = static_cast<uint16_t>(schemas_.size() + 1);
  schemas_.push_back({{id, std::move(name), std::move(encoding), std::move(data)}});
  return id;
}

Result<uint16_t> McapWriter::add_channel(std::string topic, uint16_t schema_id, std::string message_encoding,
                                         std::map<std::string, std::string> metadata) {
  if (!trouble_) return tl::unexpected(trouble_.error());
  if (schema_id > schemas_.size()) return fail(ErrorCode::kNotFound, "schema_id", "no such schema was added");
  if (channels_.size() == kMaxIds) return tl::unexpected(too_many("channels"));
  const uint16_t id = static_cast<uint16_t>(channels_.size() + 1);
  ChannelState state;
  state.channel = {id, schema_id, std::move(topic), std::move(message_encoding), std::move(metadata)};
  channels_.push_back(std::move(state));
  return id;
}

Status McapWriter::write(uint16_t channel_id, uint64_t log_time_ns, uint64_t publish_time_ns, std::string_view data) {
  const ChannelState* state = find(channel_id);
  const uint32_t sequence = state == nullptr ? 0 : state->last_sequence + 1;
  return write({channel_id, sequence, log_time_ns, publish_time_ns, data});
}

Status McapWriter::write(const mcap::Message& message) {
  if (!trouble_) return trouble_;
  ChannelState* state = find(message.channel_id);
  if (state == nullptr) return fail(ErrorCode::kNotFound, "channel_id", "no such channel was added");
  if (Status ok = check_size("message", message.data.size(), options_.max_message_bytes); !ok) return ok;

  const uint64_t apart_ns = std::max(message.log_time_ns, first_time_ns_) -
                            std::min(message.log_time_ns, first_time_ns_);
  if (open_messages_ > 0 && apart_ns >= static_cast<uint64_t>(options_.chunk_time.count()))
    if (Status ok = end_chunk(); !ok) return ok;
  // A large message starts its own chunk, so that no chunk exceeds the limit of readers.
  if (open_chunk_.size() + message.data.size() > kMaxMessageBytes)
    if (Status ok = end_chunk(); !ok) return ok;

  introduce(*state);
  note_time(message.log_time_ns);
  state->open_index.emplace_back(message.log_time_ns, open_chunk_.size());
  mcap::append_record(open_chunk_, message);
  state->last_sequence = message.sequence;
  ++state->messages;
  ++open_messages_;
  return open_chunk_.size() >= options_.chunk_bytes ? end_chunk() : Status{};
}

// The format's own tools warn of a schema or channel that stands twice in the data.
void McapWriter::introduce(ChannelState& state) {
  if (state.channel.schema_id != 0) {
    SchemaState& schema = schemas_[state.channel.schema_id - 1];
    if (!std::exchange(schema.written, true)) mcap::append_record(open_chunk_, schema.schema);
  }
  if (!std::exchange(state.written, true)) mcap::append_record(open_chunk_, state.channel);
}

void McapWriter::note_time(uint64_t log_time_ns) {
  if (open_messages_ == 0) first_time_ns_ = least_time_ns_ = greatest_time_ns_ = log_time_ns;
  least_time_ns_ = std::min(least_time_ns_, log_time_ns);
  greatest_time_ns_ = std::max(greatest_time_ns_, log_time_ns);
  const bool first = statistics_.message_count == 0;
  statistics_.start_time_ns = first ? log_time_ns : std::min(statistics_.start_time_ns, log_time_ns);
  statistics_.end_time_ns = first ? log_time_ns : std::max(statistics_.end_time_ns, log_time_ns);
  ++statistics_.message_count;
}

Status McapWriter::end_chunk() {
  if (!trouble_) return trouble_;
  if (open_messages_ == 0) return {};
  mcap::Chunk chunk;
  chunk.start_time_ns = least_time_ns_;
  chunk.end_time_ns = greatest_time_ns_;
  if (trouble_ = packer_.pack(open_chunk_, chunk); !trouble_) return trouble_;
  const uint64_t start = pending_.size();
  mcap::append_record(pending_, chunk);
  mcap::ChunkIndex index = put_message_indexes(position_ + start, pending_.size() - start);
  index.start_time_ns = chunk.start_time_ns;
  index.end_time_ns = chunk.end_time_ns;
  index.compression = chunk.compression;
  index.compressed_size = chunk.records.size();
  index.uncompressed_size = chunk.uncompressed_size;
  chunks_.push_back(std::move(index));
  open_chunk_.clear();
  open_messages_ = 0;
  return put_pending();
}

mcap::ChunkIndex McapWriter::put_message_indexes(uint64_t chunk_start, uint64_t chunk_length) {
  mcap::ChunkIndex index;
  index.chunk_start = chunk_start;
  index.chunk_length = chunk_length;
  const size_t before = pending_.size();
  for (ChannelState& state : channels_) {
    if (state.open_index.empty()) continue;
    std::stable_sort(state.open_index.begin(), state.open_index.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    index.message_index_offsets[state.channel.id] = position_ + pending_.size();
    mcap::append_record(pending_, mcap::MessageIndex{state.channel.id, std::move(state.open_index)});
    state.open_index.clear();
  }
  index.message_index_length = pending_.size() - before;
  return index;
}

Status McapWriter::attach(mcap::Attachment attachment) {
  if (!trouble_) return trouble_;
  if (Status ok = check_size("attachment", attachment.data.size(), kMaxAttachmentBytes); !ok) return ok;
  if (Status ok = end_chunk(); !ok) return ok;
  mcap::append_record(pending_, attachment);
  attachments_.push_back({position_, pending_.size(), attachment.log_time_ns, attachment.create_time_ns,
                          attachment.data.size(), std::move(attachment.name), std::move(attachment.content_type)});
  const Status done = put_pending();
  pending_.shrink_to_fit();
  return done;
}

Status McapWriter::add_metadata(const mcap::Metadata& metadata) {
  if (Status ok = end_chunk(); !ok) return ok;
  mcap::append_record(pending_, metadata);
  metadata_.push_back({position_, pending_.size(), metadata.name});
  return put_pending();
}

std::string McapWriter::summary(mcap::Footer& footer) const {
  const std::vector<mcap::Schema> schemas = written(schemas_, &SchemaState::schema);
  const std::vector<mcap::Channel> channels = written(channels_, &ChannelState::channel);
  mcap::Statistics statistics = statistics_;
  statistics.schema_count = static_cast<uint16_t>(schemas.size());
  statistics.channel_count = static_cast<uint32_t>(channels.size());
  statistics.attachment_count = static_cast<uint32_t>(attachments_.size());
  statistics.metadata_count = static_cast<uint32_t>(metadata_.size());
  statistics.chunk_count = static_cast<uint32_t>(chunks_.size());
  for (const ChannelState& state : channels_)
    if (state.messages > 0) statistics.channel_message_counts[state.channel.id] = state.messages;

  std::string out;
  std::vector<mcap::SummaryOffset> offsets;
  append_group(out, position_, mcap::Opcode::kSchema, schemas, offsets);
  append_group(out, position_, mcap::Opcode::kChannel, channels, offsets);
  append_group(out, position_, mcap::Opcode::kStatistics, std::vector{statistics}, offsets);
  append_group(out, position_, mcap::Opcode::kChunkIndex, chunks_, offsets);
  append_group(out, position_, mcap::Opcode::kAttachmentIndex, attachments_, offsets);
  append_group(out, position_, mcap::Opcode::kMetadataIndex, metadata_, offsets);
  footer.summary_start = position_;
  footer.summary_offset_start = position_ + out.size();
  for (const mcap::SummaryOffset& offset : offsets) mcap::append_record(out, offset);
  return out;
}

Status McapWriter::finish() {
  if (Status ok = end_chunk(); !ok) return ok;
  mcap::append_record(pending_, mcap::DataEnd{data_crc_});
  if (Status ok = put_pending(); !ok) return ok;
  mcap::Footer footer;
  std::string tail = summary(footer);
  // The CRC covers the footer without its last four bytes, which hold the CRC.
  std::string footer_bytes;
  mcap::append_record(footer_bytes, footer);
  footer.summary_crc = mcap::crc32_of(tail);
  footer.summary_crc = mcap::crc32_of(
      std::string_view(footer_bytes).substr(0, footer_bytes.size() - sizeof footer.summary_crc), footer.summary_crc);
  mcap::append_record(tail, footer);
  tail.append(mcap::kMagic);
  return put(tail);
}

}  // namespace sightline
