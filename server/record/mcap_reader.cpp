#include "server/record/mcap_reader.h"

#include <algorithm>

#include "server/record/chunk_codec.h"
#include "server/record/mcap_scanner.h"

namespace sightline {
namespace {

using mcap::Opcode;
using Visit = std::function<bool(const McapMessage&)>;

constexpr char kUnfit[] = "its fields do not fit into it, or schemas and channels are over the limit";

Error broken(const char* field, const char* what) {
  return Error{ErrorCode::kDataLoss, field, what};
}

Result<std::string> load(const ByteSource& source, uint64_t offset, uint64_t count, uint64_t limit) {
  if (offset > source.size() || count > source.size() - offset)
    return tl::unexpected(broken("offset", "points beyond the end of the file"));
  if (count > limit)
    return fail(ErrorCode::kResourceExhausted, "record", "is larger than the limit of " + std::to_string(limit));
  std::string bytes(count, '\0');
  if (Status ok = source.read_at(offset, bytes.data(), count); !ok) return tl::unexpected(ok.error());
  return bytes;
}

// Loads the record that an index points to; the result is a view of `bytes`.
Result<std::string_view> load_record(const ByteSource& source, uint64_t offset, uint64_t length, Opcode opcode,
                                     uint64_t limit, std::string& bytes) {
  Result<std::string> loaded = load(source, offset, length, limit);
  if (!loaded) return tl::unexpected(loaded.error());
  bytes = std::move(*loaded);
  std::string_view rest = bytes;
  mcap::RecordView record;
  if (!mcap::take_record(rest, record) || !rest.empty() || record.opcode != opcode)
    return tl::unexpected(broken("offset", "no such record is where the index points"));
  return record.content;
}

// Collects schemas and channels; the first of each id is kept. `room` is the number of bytes that may still be kept.
bool learn(const mcap::RecordView& record, McapInfo& info, uint64_t& room) {
  if (record.opcode != Opcode::kSchema && record.opcode != Opcode::kChannel) return true;
  if (record.content.size() > room) return false;
  bool is_new = false;
  if (record.opcode == Opcode::kSchema) {
    mcap::Schema schema;
    if (!mcap::decode(record.content, schema)) return false;
    is_new = schema.id != 0 && info.schemas.emplace(schema.id, std::move(schema)).second;
  } else {
    mcap::Channel channel;
    if (!mcap::decode(record.content, channel)) return false;
    is_new = info.channels.emplace(channel.id, std::move(channel)).second;
  }
  if (is_new) room -= record.content.size();
  return true;
}

// It covers the footer up to its last field, the CRC itself.
uint32_t summary_crc(std::string_view summary, std::string_view tail) {
  constexpr uint64_t kCheckedOfFooter = mcap::kRecordHeadBytes + mcap::kFooterContentBytes - sizeof(uint32_t);
  return mcap::crc32_of(tail.substr(0, kCheckedOfFooter), mcap::crc32_of(summary));
}

void count_message(const mcap::Message& message, mcap::Statistics& statistics) {
  const bool first = statistics.message_count == 0;
  statistics.start_time_ns = first ? message.log_time_ns : std::min(statistics.start_time_ns, message.log_time_ns);
  statistics.end_time_ns = first ? message.log_time_ns : std::max(statistics.end_time_ns, message.log_time_ns);
  ++statistics.message_count;
  ++statistics.channel_message_counts[message.channel_id];
}

// `length` is of the whole record.
bool read_attachment_head(const ByteSource& source, uint64_t offset, uint64_t length, mcap::AttachmentIndex& out) {
  constexpr uint64_t kHeadBytes = 64 << 10;  // times, two texts and the size of the data
  const uint64_t content = length - mcap::kRecordHeadBytes;
  const Result<std::string> head = load(source, offset + mcap::kRecordHeadBytes, std::min(content, kHeadBytes),
                                        kHeadBytes);
  if (!head || !mcap::decode_head(*head, out)) return false;
  out.offset = offset;
  out.length = length;
  return out.data_size <= content;
}

// The optional parts that a summary lacks although the file may need them. Without statistics, only a scan can show
// that there is nothing to index.
std::vector<std::string> absent_parts(const McapInfo& summary) {
  const mcap::Statistics& counted = summary.statistics;
  const auto lacks = [&](bool has_index, uint64_t count) {
    return !has_index && (count > 0 || !summary.has_statistics);
  };
  std::vector<std::string> absent;
  if (!summary.has_statistics) absent.emplace_back("statistics");
  if (summary.schemas.size() < counted.schema_count) absent.emplace_back("schemas");
  if (summary.channels.size() < counted.channel_count) absent.emplace_back("channels");
  if (lacks(!summary.chunks.empty(), counted.chunk_count)) absent.emplace_back("chunk index");
  if (lacks(!summary.attachments.empty(), counted.attachment_count)) absent.emplace_back("attachment index");
  if (lacks(!summary.metadata.empty(), counted.metadata_count)) absent.emplace_back("metadata index");
  return absent;
}

// Receives messages one by one and passes on the ones that match a query.
class Filter {
 public:
  Filter(const McapInfo& info, uint64_t room, const McapQuery& query, const Visit& visit, McapReadReport& report)
      : info_(info), query_(query), visit_(visit), report_(report), room_(room) {}

  // False: no further message is wanted.
  bool take(const mcap::RecordView& record, uint64_t offset) {
    if (record.opcode == Opcode::kMessage) return take_message(record.content, offset);
    if (!learn(record, found_, room_)) report_.loss.note(offset, broken("record", kUnfit));
    return true;
  }

  // Every record of an unpacked chunk.
  bool take_all(std::string_view records, uint64_t offset) {
    mcap::RecordView record;
    while (mcap::take_record(records, record))
      if (!take(record, offset)) return false;
    if (!records.empty()) report_.loss.note(offset, broken("chunk.records", "end within a record"));
    return true;
  }

 private:
  bool take_message(std::string_view content, uint64_t offset) {
    mcap::Message message;
    const mcap::Channel* channel = nullptr;
    if (mcap::decode(content, message)) channel = find_channel(message.channel_id);
    if (channel == nullptr) {
      ++report_.loss.messages;
      report_.loss.note(offset, broken("message.channel_id", "no such channel, or the message is too short"));
      return true;
    }
    if (message.log_time_ns < query_.start_ns || message.log_time_ns >= query_.end_ns) return true;
    const auto& topics = query_.topics;
    if (!topics.empty() && std::find(topics.begin(), topics.end(), channel->topic) == topics.end()) return true;
    ++report_.messages;
    return visit_({*channel, find_schema(channel->schema_id), message});
  }

  const mcap::Channel* find_channel(uint16_t id) const {
    for (const McapInfo* known : {&info_, &found_})
      if (const auto found = known->channels.find(id); found != known->channels.end()) return &found->second;
    return nullptr;
  }
  const mcap::Schema* find_schema(uint16_t id) const {
    for (const McapInfo* known : {&info_, &found_})
      if (const auto found = known->schemas.find(id); found != known->schemas.end()) return &found->second;
    return nullptr;
  }

  const McapInfo& info_;
  const McapQuery& query_;
  const Visit& visit_;
  McapReadReport& report_;
  McapInfo found_;  // schemas and channels that only the data hold
  uint64_t room_;   // for more of them, bytes
};

}  // namespace

Result<McapReader> McapReader::open(const ByteSource& source, McapLimits limits) {
  Result<std::string> magic = load(source, 0, std::min(source.size(), uint64_t{mcap::kMagic.size()}),
                                   mcap::kMagic.size());
  if (!magic) return tl::unexpected(magic.error());
  if (*magic != mcap::kMagic) return tl::unexpected(broken("", "is not an MCAP file"));
  McapReader reader(source, limits);
  const Result<bool> taken = reader.take_summary();
  if (taken && *taken) return reader;
  if (!taken) reader.info_.loss.note(source.size(), taken.error());
  if (Status ok = reader.go_through(); !ok) return tl::unexpected(std::move(ok.error()));
  return reader;
}

// False: the file was finished without a summary, or its summary lacks parts that are needed here, as is allowed.
Result<bool> McapReader::take_summary() {
  McapInfo found;
  const Result<bool> read = read_summary(found);
  if (!read || !*read) return read;
  found.from_summary = found.finished = true;
  summary_ = found;
  info_.absent = absent_parts(found);
  const bool loose = found.chunks.empty() && found.statistics.message_count > 0;
  if (!info_.absent.empty() || loose) return false;
  info_ = std::move(found);
  return true;
}

Result<McapReader::Tail> McapReader::read_tail() const {
  const uint64_t size = source_->size();
  if (size < mcap::kMagic.size() + mcap::kTailBytes) return tl::unexpected(broken("footer", "there is none"));
  Tail tail;
  tail.start = size - mcap::kTailBytes;
  Result<std::string> bytes = load(*source_, tail.start, mcap::kTailBytes, mcap::kTailBytes);
  if (!bytes) return tl::unexpected(bytes.error());
  tail.bytes = std::move(*bytes);
  std::string_view rest = tail.bytes;
  mcap::RecordView record;
  if (!mcap::take_record(rest, record) || rest != mcap::kMagic || record.opcode != Opcode::kFooter ||
      !mcap::decode(record.content, tail.footer))
    return tl::unexpected(broken("footer", "there is none"));
  return tail;
}

Result<bool> McapReader::read_summary(McapInfo& out) const {
  const Result<Tail> tail = read_tail();
  if (!tail) return tl::unexpected(tail.error());
  const mcap::Footer& footer = tail->footer;
  if (footer.summary_start == 0) return false;
  if (footer.summary_start < mcap::kMagic.size() || footer.summary_start > tail->start)
    return tl::unexpected(broken("footer.summary_start", "points to no summary"));

  Result<std::string> summary = load(*source_, footer.summary_start, tail->start - footer.summary_start,
                                     limits_.max_summary_bytes);
  if (!summary) return tl::unexpected(summary.error());
  if (footer.summary_crc != 0 && footer.summary_crc != summary_crc(*summary, tail->bytes))
    return tl::unexpected(broken("footer.summary_crc", "is not the CRC of the summary"));

  std::string_view rest = *summary;
  mcap::RecordView record;
  uint64_t room = limits_.max_definition_bytes;
  while (mcap::take_record(rest, record)) {
    bool sound = learn(record, out, room);
    const auto decode_into = [&](auto& list) { return mcap::decode(record.content, list.emplace_back()); };
    if (record.opcode == Opcode::kChunkIndex) sound = decode_into(out.chunks);
    if (record.opcode == Opcode::kAttachmentIndex) sound = decode_into(out.attachments);
    if (record.opcode == Opcode::kMetadataIndex) sound = decode_into(out.metadata);
    if (record.opcode == Opcode::kStatistics) sound = out.has_statistics = mcap::decode(record.content, out.statistics);
    if (!sound) return tl::unexpected(broken("summary", kUnfit));
  }
  if (!rest.empty()) return tl::unexpected(broken("summary", "ends within a record"));
  if (Status ok = check_summary(out); !ok) return tl::unexpected(ok.error());
  if (Status ok = read_header(out); !ok) return tl::unexpected(ok.error());
  return true;
}

Status McapReader::read_header(McapInfo& out) const {
  std::string bytes;
  char head[mcap::kRecordHeadBytes];
  if (Status ok = source_->read_at(mcap::kMagic.size(), head, sizeof head); !ok) return ok;
  uint64_t length = 0;
  std::copy_n(head + 1, sizeof length, reinterpret_cast<char*>(&length));
  if (length > source_->size()) return tl::unexpected(broken("header", "is longer than the file"));
  const Result<std::string_view> header = load_record(*source_, mcap::kMagic.size(), mcap::kRecordHeadBytes + length,
                                                      Opcode::kHeader, limits_.max_record_bytes, bytes);
  if (!header || !mcap::decode(*header, out.header)) return tl::unexpected(broken("header", "there is none"));
  return {};
}

// Checks that the summary is possible. An index that is there must be complete.
Status McapReader::check_summary(const McapInfo& summary) const {
  const auto inside = [&](uint64_t offset, uint64_t length) {
    return offset >= mcap::kMagic.size() && offset <= source_->size() && length <= source_->size() - offset;
  };
  uint64_t declared = 0, left = limits_.unpacked_within(source_->size());
  for (const mcap::ChunkIndex& chunk : summary.chunks) {
    const uint64_t behind = chunk.chunk_start + chunk.chunk_length;
    if (!inside(chunk.chunk_start, chunk.chunk_length) || !inside(behind, chunk.message_index_length) ||
        chunk.start_time_ns > chunk.end_time_ns)
      return tl::unexpected(broken("chunk_index", "points to no chunk"));
    // Chunks do not overlap, so that a short file cannot ask for the same one a million times.
    declared += chunk.chunk_length + chunk.message_index_length;
    if (declared > source_->size()) return tl::unexpected(broken("chunk_index", "the chunks are larger than the file"));
    // The chunks themselves say whether that is so.
    if (!chunk.compression.empty() && chunk.uncompressed_size > left)
      return tl::unexpected(broken("chunk_index", "the chunks unpack to more than the limit for a file of this size"));
    left -= chunk.compression.empty() ? 0 : chunk.uncompressed_size;
  }
  for (const mcap::AttachmentIndex& index : summary.attachments)
    if (!inside(index.offset, index.length))
      return tl::unexpected(broken("attachment_index", "points to no attachment"));
  for (const mcap::MetadataIndex& index : summary.metadata)
    if (!inside(index.offset, index.length)) return tl::unexpected(broken("metadata_index", "points to no metadata"));
  if (!summary.chunks.empty() && summary.chunks.size() < summary.statistics.chunk_count)
    return tl::unexpected(broken("summary", "has no index of all chunks"));
  return {};
}

// Schemas and channels of chunks that were lost. `start`: where the summary stands, behind the data. Its offsets may be
// wrong in a damaged file, so only its CRC counts.
void McapReader::learn_from_summary(uint64_t start, uint64_t& room) {
  const Result<Tail> tail = read_tail();
  if (!tail || start > tail->start) return;
  const Result<std::string> summary = load(*source_, start, tail->start - start, limits_.max_summary_bytes);
  if (!summary || tail->footer.summary_crc != summary_crc(*summary, tail->bytes)) return;
  std::string_view rest = *summary;
  mcap::RecordView record;
  while (mcap::take_record(rest, record))
    if (!learn(record, info_, room)) info_.loss.note(start, broken("summary", kUnfit));
}

Status McapReader::go_through() {
  McapScanner scanner(*source_, limits_, false);
  ScannedRecord record;
  mcap::Statistics& counted = info_.statistics;
  uint64_t room = limits_.max_definition_bytes;
  McapInfo unproven;  // schemas and channels outside chunks, which no CRC covers; definitions in chunks win over them
  const auto take = [&](const mcap::RecordView& part, uint64_t offset, McapInfo& definitions) {
    mcap::Message message;
    if (!learn(part, definitions, room)) info_.loss.note(offset, broken("record", kUnfit));
    if (part.opcode == Opcode::kMessage && mcap::decode(part.content, message)) count_message(message, counted);
  };
  while (scanner.next(record)) {
    if (record.opcode == Opcode::kChunk) {
      const mcap::Chunk& chunk = record.chunk;
      mcap::RecordView part;
      std::string_view rest = record.records;
      while (mcap::take_record(rest, part)) take(part, record.offset, info_);
      info_.chunks.push_back({chunk.start_time_ns,
                              chunk.end_time_ns,
                              record.offset,
                              record.length,
                              {},
                              0,
                              std::string(chunk.compression),
                              chunk.records.size(),
                              chunk.uncompressed_size});
    } else if (record.opcode == Opcode::kAttachment) {
      mcap::AttachmentIndex index;
      if (read_attachment_head(*source_, record.offset, record.length, index))
        info_.attachments.push_back(std::move(index));
      else
        info_.loss.note(record.offset, broken("attachment", kUnfit));
    } else if (record.opcode == Opcode::kMetadata) {
      mcap::Metadata metadata;
      if (mcap::decode(record.content, metadata))
        info_.metadata.push_back({record.offset, record.length, metadata.name});
    } else if (record.opcode == Opcode::kHeader) {
      mcap::Header header;
      if (mcap::decode(record.content, header)) info_.header = std::move(header);
    } else {
      if (record.opcode == Opcode::kMessage) info_.loose_messages = true;
      take({record.opcode, record.content}, record.offset, unproven);
    }
  }
  if (scanner.exhausted()) return tl::unexpected(unpacks_too_far(limits_.unpacked_within(source_->size())));
  if (scanner.finished()) learn_from_summary(scanner.data_end() + mcap::kDataEndBytes, room);
  info_.schemas.merge(unproven.schemas);
  info_.channels.merge(unproven.channels);
  info_.has_statistics = true;
  counted.schema_count = static_cast<uint16_t>(info_.schemas.size());
  counted.channel_count = static_cast<uint32_t>(info_.channels.size());
  counted.attachment_count = static_cast<uint32_t>(info_.attachments.size());
  counted.metadata_count = static_cast<uint32_t>(info_.metadata.size());
  counted.chunk_count = static_cast<uint32_t>(info_.chunks.size());
  const auto needless = [&](const std::string& part) {
    return (part == "chunk index" && info_.chunks.empty()) ||
           (part == "attachment index" && info_.attachments.empty()) ||
           (part == "metadata index" && info_.metadata.empty());
  };
  std::erase_if(info_.absent, needless);
  info_.finished = scanner.finished();
  McapLoss loss = scanner.loss();
  for (McapTrouble& trouble : info_.loss.first_troubles) loss.note(trouble.offset, std::move(trouble.error));
  info_.loss = std::move(loss);
  return {};
}

bool McapReader::wanted(const mcap::ChunkIndex& chunk, const McapQuery& query) const {
  if (chunk.end_time_ns < query.start_ns || chunk.start_time_ns >= query.end_ns) return false;
  if (query.topics.empty() || chunk.message_index_offsets.empty()) return true;
  return std::any_of(chunk.message_index_offsets.begin(), chunk.message_index_offsets.end(), [&](const auto& entry) {
    const auto channel = info_.channels.find(entry.first);
    return channel == info_.channels.end() ||
           std::find(query.topics.begin(), query.topics.end(), channel->second.topic) != query.topics.end();
  });
}

uint64_t McapReader::messages_by_index(const mcap::ChunkIndex& chunk) const {
  const Result<std::string> bytes = load(*source_, chunk.chunk_start + chunk.chunk_length, chunk.message_index_length,
                                         limits_.max_record_bytes);
  if (!bytes) return 0;
  std::string_view rest = *bytes;
  uint64_t count = 0;
  mcap::RecordView record;
  mcap::MessageIndex index;
  while (mcap::take_record(rest, record))
    if (record.opcode == Opcode::kMessageIndex && mcap::decode(record.content, index)) count += index.records.size();
  return count;
}

McapReadReport McapReader::read(const McapQuery& query, const Visit& visit) const {
  McapReadReport report;
  if (info_.loose_messages)
    read_through(query, visit, report);
  else
    read_chunks(query, visit, report);
  return report;
}

void McapReader::read_chunks(const McapQuery& query, const Visit& visit, McapReadReport& report) const {
  ChunkUnpacker unpacker(limits_.max_chunk_bytes, limits_.unpacked_within(source_->size()));
  Filter filter(info_, limits_.max_definition_bytes, query, visit, report);
  std::string bytes;
  for (const mcap::ChunkIndex& index : info_.chunks) {
    if (!wanted(index, query)) continue;
    mcap::Chunk chunk;
    Result<std::string_view> records = load_record(*source_, index.chunk_start, index.chunk_length, Opcode::kChunk,
                                                   limits_.max_record_bytes, bytes);
    if (records && !mcap::decode(*records, chunk)) records = tl::unexpected(broken("chunk", "is too short"));
    if (records) records = unpacker.unpack(chunk);
    if (!records) {
      ++report.loss.chunks;
      report.loss.messages += messages_by_index(index);
      report.loss.bytes += index.chunk_length;
      report.loss.note(index.chunk_start, records.error());
      if (unpacker.exhausted()) return;
      continue;
    }
    ++report.chunks_read;
    if (!filter.take_all(*records, index.chunk_start)) return;
  }
}

void McapReader::read_through(const McapQuery& query, const Visit& visit, McapReadReport& report) const {
  McapScanner scanner(*source_, limits_, false);
  Filter filter(info_, limits_.max_definition_bytes, query, visit, report);
  ScannedRecord record;
  bool more = true;
  while (more && scanner.next(record)) {
    if (record.opcode == Opcode::kChunk) {
      ++report.chunks_read;
      more = filter.take_all(record.records, record.offset);
    } else {
      more = filter.take({record.opcode, record.content}, record.offset);
    }
  }
}

Result<std::string> McapReader::attachment(const mcap::AttachmentIndex& index) const {
  std::string bytes;
  const Result<std::string_view> content = load_record(*source_, index.offset, index.length, Opcode::kAttachment,
                                                       limits_.max_attachment_bytes, bytes);
  if (!content) return tl::unexpected(content.error());
  mcap::Attachment attachment;
  if (!mcap::decode(*content, attachment)) return tl::unexpected(broken("attachment", "is too short"));
  const size_t checked = static_cast<size_t>(attachment.data.data() + attachment.data.size() - content->data());
  if (attachment.crc != 0 && mcap::crc32_of(content->substr(0, checked)) != attachment.crc)
    return tl::unexpected(broken("attachment.crc", "is not the CRC of the attachment"));
  return std::string(attachment.data);
}

Result<mcap::Metadata> McapReader::metadata(const mcap::MetadataIndex& index) const {
  std::string bytes;
  const Result<std::string_view> content = load_record(*source_, index.offset, index.length, Opcode::kMetadata,
                                                       limits_.max_record_bytes, bytes);
  if (!content) return tl::unexpected(content.error());
  mcap::Metadata metadata;
  if (!mcap::decode(*content, metadata)) return tl::unexpected(broken("metadata", "is too short"));
  return metadata;
}

}  // namespace sightline
