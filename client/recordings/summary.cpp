#include "client/recordings/summary.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "client/base/text_table.h"
#include "server/wire/short_name.h"

namespace sightline {
namespace {

const char* topic_name(RecordTopic topic) {
  return all_record_topics()[static_cast<size_t>(topic)].topic;
}

uint64_t messages_of(const RecordingSummary& summary, RecordTopic topic) {
  uint64_t count = 0;
  for (const TopicSummary& found : summary.topics)
    if (found.topic == topic_name(topic)) count += found.messages;
  return count;
}

std::map<std::string, std::string> metadata_named(const McapReader& reader, const char* name) {
  for (const mcap::MetadataIndex& index : reader.info().metadata)
    if (index.name == name)
      if (auto metadata = reader.metadata(index)) return std::move(metadata->values);
  return {};
}

void take_container(const McapReader& reader, RecordingSummary& out) {
  const McapInfo& info = reader.info();
  out.start_ns = info.statistics.start_time_ns;
  out.end_ns = info.statistics.end_time_ns;
  out.chunks = info.chunks.size();
  std::set<std::string> ways;
  for (const mcap::ChunkIndex& chunk : info.chunks) {
    out.packed_bytes += chunk.compressed_size;
    out.unpacked_bytes += chunk.uncompressed_size;
    ways.insert(chunk.compression.empty() ? "not packed" : chunk.compression);
  }
  for (const std::string& way : ways) out.compression.append(out.compression.empty() ? "" : ", ").append(way);
  for (const auto& [id, channel] : info.channels) {
    const auto schema = info.schemas.find(channel.schema_id);
    const auto count = info.statistics.channel_message_counts.find(id);
    out.topics.push_back({channel.topic, schema == info.schemas.end() ? "" : schema->second.name,
                          count == info.statistics.channel_message_counts.end() ? 0 : count->second});
  }
  out.attachments = info.attachments;
  out.finished = info.finished;
  out.absent = info.absent;
  out.loss = info.loss;
  out.cut = metadata_named(reader, kCutMetadata);
  out.recovered = metadata_named(reader, kRecoveredMetadata);
}

void take_gaps(const McapReader& reader, RecordingSummary& out) {
  McapQuery query;
  query.topics.emplace_back(topic_name(RecordTopic::kGap));
  uint64_t read = 0;
  if (out.gaps == 0) return;
  reader.read(query, [&](const McapMessage& m) {
    v1::Gap gap;
    if (gap.ParseFromArray(m.message.data.data(), static_cast<int>(m.message.data.size())))
      out.missing[short_name(gap.reason())] += gap.messages();
    return ++read < RecordingSummary::kMaxGaps;
  });
}

void take_session(const Recording& recording, RecordingSummary& out) {
  out.session = recording.info();
  out.game_time = game_time_of(recording);
  const uint64_t snapshots = recording.info().snapshot_ticks() > 0 ? 1 : 0;
  const auto less = [](uint64_t a, uint64_t b) { return a > b ? a - b : 0; };
  out.ticks = less(messages_of(out, RecordTopic::kTick), snapshots);
  out.replies = messages_of(out, RecordTopic::kReply);
  out.rejections = messages_of(out, RecordTopic::kTickError);
  out.faults = messages_of(out, RecordTopic::kFault);
  out.gaps = messages_of(out, RecordTopic::kGap);
  out.merged = less(less(out.ticks, out.rejections), out.replies);
}

std::string counted(uint64_t count, const char* what) {
  std::string text = grouped(count);
  return text.append(" ").append(what).append(count == 1 ? "" : "s");
}

std::string seconds_text(double seconds) {
  if (seconds < 60) return formatted("%.3f s", seconds);
  const auto whole = static_cast<uint64_t>(seconds);
  return formatted("%llu:%02llu:%06.3f", static_cast<unsigned long long>(whole / 3600),
                   static_cast<unsigned long long>(whole / 60 % 60), seconds - static_cast<double>(whole / 60 * 60));
}

// "QUEUE_FULL" -> "queue full"
std::string plain_word(std::string name) {
  for (char& c : name) c = c == '_' ? ' ' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return name;
}

std::string missing_text(const RecordingSummary& s) {
  if (s.gaps == 0) return "nothing";
  uint64_t messages = 0;
  std::string reasons;
  for (const auto& [reason, count] : s.missing) {
    messages += count;
    reasons.append(reasons.empty() ? "" : ", ").append(plain_word(reason)).append(" ").append(grouped(count));
  }
  std::string text = counted(messages, "message");
  text.append(" in ").append(counted(s.gaps, "gap")).append(": ").append(reasons);
  if (s.gaps > RecordingSummary::kMaxGaps) text.append("; the rest of the gaps was not looked at");
  return text;
}

std::string value_of(const std::map<std::string, std::string>& values, const char* name) {
  const auto found = values.find(name);
  return printable(found == values.end() ? "" : found->second, 100);
}

void print_session(std::ostream& out, const RecordingSummary& s) {
  if (!s.session) {
    out << "session     none: " << printable(s.not_a_session, 200) << '\n';
    return;
  }
  const v1::RecordingInfo& info = *s.session;
  out << "session     " << printable(info.session_id(), 64) << ", part " << info.part() << '\n'
      << "label       " << printable(info.label(), 64) << '\n'
      << "server      " << printable(info.server_version()) << ", " << printable(info.build(), 200) << '\n'
      << "sampler     " << printable(info.sampler()) << '\n'
      << "seed        " << info.seed() << '\n'
      << "started     " << utc_text(info.start_time_ns()) << '\n'
      << "begins      "
      << (info.snapshot_ticks() == 0
              ? std::string(info.part() > 1 ? "within the session, without what came before" : "with the session")
              : "after " + counted(info.snapshot_ticks(), "tick") + ", given as one snapshot tick")
      << '\n';
  if (s.replies == 0) out << "note        no reply was recorded: there is nothing to compare or to show\n";
  out << "ticks       " << grouped(s.ticks) << ": " << grouped(s.replies) << " answered, " << grouped(s.merged)
      << " merged or not answered, " << grouped(s.rejections) << " refused\n"
      << "faults      " << grouped(s.faults) << '\n'
      << "missing     " << missing_text(s) << '\n';
}

void print_topics(std::ostream& out, const RecordingSummary& s) {
  if (s.topics.empty()) return;
  out << "\ntopics (" << s.topics.size() << ")\n";
  Table table({{"topic"}, {"messages", true}, {"a second", true}, {"type"}});
  for (const TopicSummary& topic : s.topics)
    table.row({printable(topic.topic, 100), grouped(topic.messages),
               s.duration_s() > 0 ? formatted("%.2f", static_cast<double>(topic.messages) / s.duration_s()) : "",
               printable(topic.type, 100)});
  table.print(out);
}

void print_attachments(std::ostream& out, const RecordingSummary& s) {
  if (s.attachments.empty()) return;
  out << "\nattachments (" << s.attachments.size() << ")\n";
  Table table({{"name"}, {"size", true}, {"type"}, {"recorded"}});
  for (const mcap::AttachmentIndex& attachment : s.attachments)
    table.row({printable(attachment.name, 100), bytes_text(attachment.data_size), printable(attachment.content_type),
               utc_text(attachment.log_time_ns)});
  table.print(out);
}

nlohmann::ordered_json session_json(const RecordingSummary& s) {
  const v1::RecordingInfo& info = *s.session;
  return {{"id", info.session_id()},
          {"part", info.part()},
          {"label", info.label()},
          {"server_version", info.server_version()},
          {"build", info.build()},
          {"sampler", info.sampler()},
          {"seed", info.seed()},
          {"start_time_ns", info.start_time_ns()},
          {"start_time", utc_text(info.start_time_ns())},
          {"snapshot_ticks", info.snapshot_ticks()},
          {"ticks", s.ticks},
          {"replies", s.replies},
          {"merged", s.merged},
          {"rejections", s.rejections},
          {"faults", s.faults},
          {"gaps", s.gaps},
          {"missing", s.missing}};
}

}  // namespace

Result<RecordingSummary> summarise_recording(std::shared_ptr<const ByteSource> source, const std::string& name,
                                             McapLimits limits) {
  RecordingSummary summary;
  summary.name = name;
  summary.bytes = source->size();
  const auto recording = Recording::open(source, name, limits);
  if (recording) {
    take_container(recording->reader(), summary);
    take_session(*recording, summary);
    take_gaps(recording->reader(), summary);
    return summary;
  }
  if (recording.error().code != ErrorCode::kInvalidArgument) return tl::unexpected(recording.error());
  const auto reader = McapReader::open(*source, limits);
  if (!reader) return tl::unexpected(reader.error());
  take_container(*reader, summary);
  summary.not_a_session = recording.error().message.substr(std::min(recording.error().message.size(), name.size() + 2));
  return summary;
}

void print_summary(std::ostream& out, const RecordingSummary& s) {
  out << "file        " << s.name << ", " << bytes_text(s.bytes) << '\n';
  print_session(out, s);
  if (!s.cut.empty())
    out << "cut         " << value_of(s.cut, "start_s") << " s to " << value_of(s.cut, "end_s") << " s of "
        << value_of(s.cut, "of") << ", after a lead of " << value_of(s.cut, "lead_s") << " s\n";
  if (!s.recovered.empty()) out << "recovered   lost " << value_of(s.recovered, "lost") << '\n';
  out << "first       " << (s.end_ns == 0 ? "-" : utc_text(s.start_ns)) << '\n'
      << "duration    " << seconds_text(s.duration_s()) << " by the wall clock\n";
  if (s.game_time) out << "game time   " << game_time_text(*s.game_time) << '\n';
  out << "chunks      " << grouped(s.chunks);
  if (s.packed_bytes > 0)
    out << ", " << s.compression << ": " << bytes_text(s.unpacked_bytes) << " in " << bytes_text(s.packed_bytes)
        << formatted(", %.2f to 1", static_cast<double>(s.unpacked_bytes) / static_cast<double>(s.packed_bytes));
  out << '\n'
      << "finished    " << (s.finished ? "yes" : "no: its end is missing, as a killed server leaves it") << '\n'
      << "lost        " << loss_text(s.loss) << '\n';
  print_absent(out, s.absent);
  print_troubles(out, s.loss);
  print_topics(out, s);
  print_attachments(out, s);
}

nlohmann::ordered_json json_of(const McapLoss& loss) {
  nlohmann::ordered_json out = {{"chunks", loss.chunks}, {"messages", loss.messages}, {"bytes", loss.bytes}};
  out["troubles"] = loss.troubles;
  out["first"] = nlohmann::ordered_json::array();
  for (const McapTrouble& trouble : loss.first_troubles)
    out["first"].push_back({{"offset", trouble.offset}, {"text", to_string(trouble.error)}});
  return out;
}

nlohmann::ordered_json json_of(const RecordingSummary& s) {
  nlohmann::ordered_json out = {{"file", s.name}, {"bytes", s.bytes}};
  if (s.session)
    out["session"] = session_json(s);
  else
    out["session"] = nullptr;
  if (!s.cut.empty()) out["cut"] = s.cut;
  if (!s.recovered.empty()) out["recovered"] = s.recovered;
  out["first_time_ns"] = s.start_ns;
  out["last_time_ns"] = s.end_ns;
  out["duration_s"] = s.duration_s();
  out["game_time"] = nullptr;
  if (s.game_time)
    out["game_time"] = {
        {"start_s", s.game_time->start_s}, {"end_s", s.game_time->end_s}, {"duration_s", s.game_time->duration_s()}};
  out["chunks"] = {{"count", s.chunks},
                   {"compression", s.compression},
                   {"packed_bytes", s.packed_bytes},
                   {"unpacked_bytes", s.unpacked_bytes}};
  out["finished"] = s.finished;
  out["absent"] = s.absent;
  out["lost"] = {
      {"chunks", s.loss.chunks}, {"messages", s.loss.messages}, {"bytes", s.loss.bytes}, {"troubles", s.loss.troubles}};
  out["topics"] = nlohmann::ordered_json::array();
  for (const TopicSummary& topic : s.topics)
    out["topics"].push_back({{"topic", topic.topic}, {"messages", topic.messages}, {"type", topic.type}});
  out["attachments"] = nlohmann::ordered_json::array();
  for (const mcap::AttachmentIndex& a : s.attachments)
    out["attachments"].push_back({{"name", a.name},
                                  {"bytes", a.data_size},
                                  {"type", a.content_type},
                                  {"log_time_ns", a.log_time_ns},
                                  {"create_time_ns", a.create_time_ns}});
  return out;
}

std::string error_text(const std::string& name, const Error& error) {
  const std::string text = to_string(error);
  return text.find(name) == std::string::npos ? name + ": " + text : text;
}

std::string loss_text(const McapLoss& loss) {
  if (loss.none()) return "nothing";
  std::string text = counted(loss.chunks, "chunk");
  text.append(", ").append(counted(loss.messages, "message")).append(" known of, ").append(bytes_text(loss.bytes));
  return text.append(" of the file");
}

void print_absent(std::ostream& out, const std::vector<std::string>& absent) {
  if (absent.empty()) return;
  std::string parts;
  for (const std::string& part : absent) parts.append(parts.empty() ? "" : ", ").append(part);
  out << "not there   " << parts
      << ": no damage, the format lets them be left out; the file was read through instead\n";
}

void print_troubles(std::ostream& out, const McapLoss& loss) {
  for (const McapTrouble& trouble : loss.first_troubles)
    out << "  at byte " << grouped(trouble.offset) << ": " << printable(to_string(trouble.error), 300) << '\n';
  if (loss.troubles > loss.first_troubles.size())
    out << "  ... and " << grouped(loss.troubles - loss.first_troubles.size()) << " more\n";
}

}  // namespace sightline
