#include "server/record/mcap_verify.h"

#include <algorithm>

#include "server/record/chunk_codec.h"
#include "server/record/mcap_reader.h"
#include "server/record/mcap_scanner.h"

namespace sightline {
namespace {

using mcap::Opcode;

Error differs(const char* field, const char* what) {
  return Error{ErrorCode::kDataLoss, field, what};
}

uint64_t distance(uint64_t a, uint64_t b) {
  return std::max(a, b) - std::min(a, b);
}

// One topic's messages, one after the other.
struct TopicWatch {
  TopicVerdict verdict;
  uint32_t last_sequence = 0;
  uint64_t last_time_ns = 0;

  void take(const mcap::Message& message) {
    if (verdict.messages == 0) {
      verdict.start_time_ns = verdict.end_time_ns = message.log_time_ns;
    } else {
      const bool back = message.sequence < last_sequence || message.log_time_ns < last_time_ns;
      if (back) ++verdict.out_of_order;
      if (message.sequence > last_sequence) verdict.missing += message.sequence - last_sequence - 1;
      verdict.longest_silence_ns = std::max(verdict.longest_silence_ns, distance(message.log_time_ns, last_time_ns));
    }
    verdict.start_time_ns = std::min(verdict.start_time_ns, message.log_time_ns);
    verdict.end_time_ns = std::max(verdict.end_time_ns, message.log_time_ns);
    ++verdict.messages;
    last_sequence = message.sequence;
    last_time_ns = message.log_time_ns;
  }
};

// Where a message stands within the records of its chunk.
struct Place {
  uint64_t offset = 0;
  uint16_t channel_id = 0;
  uint64_t log_time_ns = 0;
  bool operator==(const Place&) const = default;
};
using Places = std::vector<Place>;  // by offset

class Verifier {
 public:
  Verifier(const ByteSource& source, const McapReader& reader)
      : source_(source), stated_(reader.info()), summary_(reader.summary()) {
    if (summary_)
      for (const mcap::ChunkIndex& index : summary_->chunks) stated_chunks_.emplace(index.chunk_start, &index);
  }

  void take(const ScannedRecord& record) {
    if (record.opcode == Opcode::kChunk) take_chunk(record);
    if (record.opcode == Opcode::kMessage) take_message(record.content, record.offset);
    if (record.opcode == Opcode::kAttachment) ++attachments_;
    if (record.opcode == Opcode::kMetadata) ++metadata_;
  }

  McapVerdict finish(const McapScanner& scanner) {
    verdict_.loss = scanner.loss();
    verdict_.finished = scanner.finished();
    verdict_.summary_used = stated_.from_summary;
    verdict_.absent = stated_.absent;
    for (auto& [id, watch] : watches_) {
      std::string topic = topic_of(id);
      if (verdict_.topics.contains(topic)) topic.append(" (channel ").append(std::to_string(id)).append(")");
      verdict_.topics[topic] = watch.verdict;
    }
    if (summary_)
      compare_counts();
    else
      for (const McapTrouble& trouble : stated_.loss.first_troubles)
        if (trouble.offset == source_.size()) verdict_.disagreements.note(trouble.offset, trouble.error);
    if (scanner.finished()) check_data_crc(scanner.data_end());
    return std::move(verdict_);
  }

 private:
  std::string topic_of(uint16_t id) const {
    const auto channel = stated_.channels.find(id);
    std::string unknown = "channel ";
    unknown.append(std::to_string(id));
    return channel == stated_.channels.end() ? unknown : channel->second.topic;
  }

  void take_message(std::string_view content, uint64_t offset) {
    mcap::Message message;
    if (!mcap::decode(content, message)) {
      verdict_.disagreements.note(offset, differs("message", "is too short"));
      return;
    }
    watches_[message.channel_id].take(message);
    ++messages_;
  }

  void take_chunk(const ScannedRecord& record) {
    ++verdict_.chunks;
    if (record.chunk.uncompressed_crc == 0) ++verdict_.chunks_without_crc;
    uint64_t least_ns = 0, greatest_ns = 0, messages = 0;
    mcap::RecordView part;
    std::string_view rest = record.records;
    Places places;
    while (true) {
      const uint64_t place = record.records.size() - rest.size();
      if (!mcap::take_record(rest, part)) break;
      mcap::Message message;
      if (part.opcode != Opcode::kMessage) continue;
      take_message(part.content, record.offset);
      if (!mcap::decode(part.content, message)) continue;
      places.push_back({place, message.channel_id, message.log_time_ns});
      least_ns = messages == 0 ? message.log_time_ns : std::min(least_ns, message.log_time_ns);
      greatest_ns = std::max(greatest_ns, message.log_time_ns);
      ++messages;
    }
    if (!rest.empty()) verdict_.disagreements.note(record.offset, differs("chunk.records", "end within a record"));
    if (least_ns != record.chunk.start_time_ns || greatest_ns != record.chunk.end_time_ns)
      verdict_.disagreements.note(record.offset, differs("chunk", "its times are not those of its messages"));
    compare_index(record, places);
  }

  void compare_index(const ScannedRecord& record, const Places& places) {
    if (stated_chunks_.empty()) return;  // the file has no index of its chunks
    const auto stated = stated_chunks_.find(record.offset);
    if (stated == stated_chunks_.end()) {
      verdict_.disagreements.note(record.offset, differs("chunk_index", "does not name this chunk"));
      return;
    }
    const mcap::ChunkIndex& index = *stated->second;
    if (index.chunk_length != record.length || index.start_time_ns != record.chunk.start_time_ns ||
        index.end_time_ns != record.chunk.end_time_ns || index.compression != record.chunk.compression ||
        index.compressed_size != record.chunk.records.size() ||
        index.uncompressed_size != record.chunk.uncompressed_size)
      verdict_.disagreements.note(record.offset, differs("chunk_index", "is not what the chunk says"));
    compare_message_indexes(index, places);
  }

  // Every message must occur once, with its offset and time, in the index record of its channel.
  void compare_message_indexes(const mcap::ChunkIndex& index, const Places& places) {
    if (index.message_index_offsets.empty()) return;  // the file has none
    const uint64_t start = index.chunk_start + index.chunk_length;
    std::string bytes(index.message_index_length, '\0');  // within the file: check_summary saw to it
    if (!source_.read_at(start, bytes.data(), bytes.size())) return;
    std::string_view rest = bytes;
    uint64_t named = 0;
    bool right = true;
    mcap::RecordView record;
    mcap::MessageIndex messages;
    while (right) {
      const uint64_t offset = start + (bytes.size() - rest.size());
      if (!mcap::take_record(rest, record)) break;
      right = record.opcode == Opcode::kMessageIndex && mcap::decode(record.content, messages);
      if (!right) break;
      const auto stated = index.message_index_offsets.find(messages.channel_id);
      right = stated != index.message_index_offsets.end() && stated->second == offset;
      for (const auto& [time_ns, place] : messages.records) {
        const auto found = std::lower_bound(places.begin(), places.end(), place,
                                            [](const Place& a, uint64_t at) { return a.offset < at; });
        right = right && found != places.end() && *found == Place{place, messages.channel_id, time_ns};
      }
      named += messages.records.size();
    }
    if (!right || !rest.empty() || named != places.size())
      verdict_.disagreements.note(start, differs("message_index", "is not what the chunk holds"));
  }

  void compare_counts() {
    const mcap::Statistics& stated = summary_->statistics;
    bool right = !summary_->has_statistics ||
                 (stated.message_count == messages_ && stated.chunk_count == verdict_.chunks &&
                  stated.attachment_count == attachments_ && stated.metadata_count == metadata_);
    for (const auto& [id, count] : stated.channel_message_counts) {
      const auto watch = watches_.find(id);
      right = right && (watch == watches_.end() ? 0 : watch->second.verdict.messages) == count;
    }
    if (!right) verdict_.disagreements.note(0, differs("statistics", "are not the counts of the data"));
    // An index that is left out is no disagreement; one that names too few is.
    if (!summary_->attachments.empty() && summary_->attachments.size() != attachments_)
      verdict_.disagreements.note(0, differs("attachment_index", "does not name every attachment"));
    if (!summary_->metadata.empty() && summary_->metadata.size() != metadata_)
      verdict_.disagreements.note(0, differs("metadata_index", "does not name all metadata"));
  }

  void check_data_crc(uint64_t data_end) {
    char record[mcap::kRecordHeadBytes + sizeof(uint32_t)];
    mcap::RecordView view;
    mcap::DataEnd end;
    std::string_view rest(record, sizeof record);
    if (!source_.read_at(data_end, record, sizeof record) || !mcap::take_record(rest, view) ||
        view.opcode != Opcode::kDataEnd || !mcap::decode(view.content, end)) {
      verdict_.disagreements.note(data_end, differs("data_end", "is not what ends the data"));
      return;
    }
    if (end.data_crc == 0) return;
    std::string block;
    uint32_t crc = 0;
    for (uint64_t at = 0; at < data_end; at += block.size()) {
      block.resize(std::min(uint64_t{1} << 20, data_end - at));
      if (Status ok = source_.read_at(at, block.data(), block.size()); !ok) return;
      crc = mcap::crc32_of(block, crc);
    }
    if (crc != end.data_crc)
      verdict_.disagreements.note(data_end, differs("data_end.crc", "is not the CRC of the data"));
  }

  const ByteSource& source_;
  const McapInfo& stated_;
  const McapInfo* summary_;                                    // as the file has it; null: none
  std::map<uint64_t, const mcap::ChunkIndex*> stated_chunks_;  // by offset
  std::map<uint16_t, TopicWatch> watches_;                     // by channel
  McapVerdict verdict_;
  uint64_t messages_ = 0;
  uint64_t attachments_ = 0;
  uint64_t metadata_ = 0;
};

}  // namespace

Result<McapVerdict> verify_mcap(const ByteSource& source, McapLimits limits) {
  const Result<McapReader> reader = McapReader::open(source, limits);
  if (!reader) return tl::unexpected(reader.error());
  Verifier verifier(source, *reader);
  McapScanner scanner(source, limits, true);
  ScannedRecord record;
  while (scanner.next(record)) verifier.take(record);
  if (scanner.exhausted()) return tl::unexpected(unpacks_too_far(limits.unpacked_within(source.size())));
  return verifier.finish(scanner);
}

}  // namespace sightline
