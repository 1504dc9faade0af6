#include "client/report/digest.h"
#include "client/recordings/game_time.h"

#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <filesystem>

#include "client/base/text_table.h"
#include "server/wire/short_name.h"

namespace sightline {
namespace {

constexpr size_t kLeastFrames = 500;  // however many instances move
constexpr size_t kLongestText = 400;

std::string short_json(const google::protobuf::Message& message) {
  const std::string json = json_of(message);
  return json.size() <= kLongestText ? json : json.substr(0, kLongestText) + "...";
}

// The parts of a reply whose changes must show when frames are left out.
struct Outline {
  v1::TrackingStatus status{};
  v1::MoveReason reason{};
  std::string flags;
  bool operator==(const Outline&) const = default;
};

class Digester {
 public:
  Digester(const Convention& convention, const DigestOptions& options) : options_(options), digest_(convention) {}

  RecordingDigest run(const Recording& recording) {
    digest_.read = recording.read(options_.range, [this](RecordedEvent& event) {
      std::visit([&](auto& message) { take(message, event.log_ns); }, event.message);
      return true;
    });
    choose();
    return std::move(digest_);
  }

 private:
  void mark(std::string kind, std::string text) {
    if (digest_.marks.size() < kMaxMarks)
      digest_.marks.push_back({digest_.replies.replies(), std::move(kind), std::move(text)});
    else
      ++digest_.left_out_marks;
  }

  void take(const v1::Tick& tick, uint64_t log_ns) {
    ++digest_.ticks;
    digest_.replies.take(tick);
    newest_tick_ = {tick.sequence(), log_ns};
    poses_ += static_cast<size_t>(tick.transforms().ids_size());
    if (tick.has_settings()) mark("change", "settings " + short_json(tick.settings()));
    if (tick.has_tuning()) mark("change", "tuning " + short_json(tick.tuning()));
    if (tick.has_limits()) mark("change", "limits " + short_json(tick.limits()));
    if (tick.has_lens()) mark("change", "lens " + short_json(tick.lens()));
    if (tick.has_targets()) mark("change", targets_text(tick.targets()));
  }

  static std::string targets_text(const v1::TargetList& list) {
    std::string text = "targets:";
    for (const v1::Target& target : list.targets()) text.append(" ").append(std::to_string(target.id()));
    return list.targets().empty() ? "no targets" : text;
  }

  void take(const v1::StepMemory&, uint64_t) {}

  void take(const v1::TickError& rejection, uint64_t) {
    ++digest_.rejections;
    mark("rejection", "tick " + std::to_string(rejection.sequence()) + ": " + rejection.message());
  }
  void take(const v1::Fault& fault, uint64_t) {
    ++digest_.faults;
    mark("fault", (fault.stage().empty() ? "" : fault.stage() + ": ") + fault.message());
  }
  void take(const v1::Gap& gap, uint64_t) {
    digest_.missing += gap.messages();
    std::string text = std::to_string(gap.messages()) + " messages are missing: " + short_name(gap.reason());
    mark("gap", gap.text().empty() ? text : text + ", " + gap.text());
  }

  void take(const v1::CameraReply& reply, uint64_t log_ns) {
    if (digest_.replies.replies() == 0) digest_.first_log_ns = log_ns;
    digest_.candidates = std::max(digest_.candidates, static_cast<size_t>(reply.candidates().visible_masks_size()));
    if (reply.candidates().visible_masks_size() > 0) digest_.has_candidates = true;
    Outline outline{reply.status(), reply.reason(), reply.flags().SerializeAsString()};
    important_.push_back(reply.cut() || !(outline == last_));
    last_ = std::move(outline);
    digest_.replies.add(reply);
    if (newest_tick_.sequence == reply.sequence() && log_ns >= newest_tick_.log_ns)
      digest_.answer_ms.push_back(static_cast<double>(log_ns - newest_tick_.log_ns) * 1e-6);
    if (options_.progress) options_.progress(digest_.replies.replies());
  }

  // ---- which become frames ----

  size_t frames_allowed() const {
    const size_t replies = std::max<size_t>(1, important_.size());
    const size_t poses_a_reply = std::max<size_t>(1, poses_ / replies);
    return std::clamp(kMaxPagePoses / poses_a_reply, std::min(kLeastFrames, options_.max_frames), options_.max_frames);
  }

  void choose() {
    const size_t replies = important_.size(), allowed = frames_allowed();
    digest_.kept.assign(replies, replies <= allowed);
    digest_.frames = std::min(replies, allowed);
    if (replies <= allowed) return;
    important_.front() = important_.back() = true;
    const auto count = static_cast<size_t>(std::count(important_.begin(), important_.end(), true));
    // When the changes alone are too many, a quarter of the frames still goes to the calm stretches.
    const size_t for_changes = count <= allowed ? count : allowed * 3 / 4;
    digest_.changes = count, digest_.kept_changes = for_changes;
    keep_some(important_, count, for_changes);
    std::vector<bool> others(replies);
    for (size_t i = 0; i < replies; ++i) others[i] = !important_[i];
    keep_some(others, replies - count, allowed - for_changes);
    digest_.kept.front() = digest_.kept.back() = true;
    digest_.frames = static_cast<size_t>(std::count(digest_.kept.begin(), digest_.kept.end(), true));
  }

  // Keeps `most` of the `count` replies that `of` marks, evenly spaced.
  void keep_some(const std::vector<bool>& of, size_t count, size_t most) {
    most = std::min(most, count);
    size_t k = 0;
    for (size_t i = 0; i < of.size(); ++i) {
      if (!of[i]) continue;
      if ((k + 1) * most / count != k * most / count) digest_.kept[i] = true;
      ++k;
    }
  }

  struct Arrival {
    uint64_t sequence = 0, log_ns = 0;
  };

  const DigestOptions& options_;
  RecordingDigest digest_;
  std::vector<bool> important_;  // by reply
  Outline last_;
  Arrival newest_tick_;
  size_t poses_ = 0;
};

std::string part_text(const v1::RecordingInfo& info) {
  std::string text = std::to_string(info.part());
  if (info.snapshot_ticks() > 0)
    text.append(", begins after ").append(std::to_string(info.snapshot_ticks())).append(" ticks");
  return text;
}

std::string convention_text(const v1::Convention& convention) {
  return convention.preset() == v1::Convention::PRESET_UNSPECIFIED ? "GLTF" : short_name(convention.preset());
}

std::string preset_text(const v1::Settings& settings) {
  return settings.preset() == v1::Settings::PRESET_UNSPECIFIED ? std::string() : short_name(settings.preset());
}

}  // namespace

std::string json_of(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  std::string json;
  if (!google::protobuf::util::MessageToJsonString(message, &json, options).ok()) json.clear();
  return json;
}

RecordingDigest digest_recording(const Recording& recording, const Convention& convention,
                                 const DigestOptions& options) {
  return Digester(convention, options).run(recording);
}

std::vector<FigureRow> figures_of(const RecordingDigest& digest, const std::map<uint64_t, std::string>& names) {
  const ReplyFigures* const runs[] = {&digest.replies};
  std::vector<FigureRow> rows = reply_rows(runs, names);
  rows.push_back({"ticks refused", {std::to_string(digest.rejections)}});
  rows.push_back({"faults", {std::to_string(digest.faults)}});
  rows.push_back({"messages missing in the file", {std::to_string(digest.missing)}});
  rows.push_back({"from tick to reply", {spread_text(digest.answer_ms, 1.0)}});
  return rows;
}

std::vector<std::pair<std::string, std::string>> facts_of(const Recording& recording, const RecordingDigest& digest) {
  const v1::RecordingInfo& info = recording.info();
  const v1::SessionOpened& opened = recording.opened();
  const std::optional<GameTime> game = game_time_of(recording);
  std::vector<std::pair<std::string, std::string>> facts = {
      {"start", utc_text(info.start_time_ns() != 0 ? info.start_time_ns() : recording.start_ns())},
      {"wall clock", formatted("%.2f s", recording.duration_s())},
      {"game time", game ? game_time_text(*game) : ""},
      {"sampler", info.sampler()},
      {"ticks", std::to_string(digest.ticks)},
      {"replies", std::to_string(digest.replies.replies())},
      {"refused", std::to_string(digest.rejections)},
      {"faults", std::to_string(digest.faults)},
      {"missing", std::to_string(digest.missing)},
      {"session", info.session_id()},
      {"label", info.label()},
      {"recording", std::filesystem::path(recording.name()).filename().string()},
      {"part", part_text(info)},
      {"seed", std::to_string(recording.open_session().seed())},
      {"preset", preset_text(recording.open_session().settings())},
      {"server", info.server_version()},
      {"build", info.build()},
      {"convention", convention_text(recording.open_session().convention())},
      {"instances", std::to_string(opened.instance_count())},
      {"triangles", std::to_string(opened.triangle_count())},
      {"mirror", formatted("%016llx", static_cast<unsigned long long>(opened.mirror_hash()))}};
  for (const std::string& warning : opened.warnings()) facts.emplace_back("warning", warning);
  std::erase_if(facts, [](const auto& fact) { return fact.second.empty(); });
  return facts;
}

std::vector<std::string> notices_of(const Recording& recording, const RecordingDigest& digest) {
  std::vector<std::string> notices;
  const auto count = [](uint64_t n) { return std::to_string(n); };
  const size_t replies = digest.kept.size();
  if (digest.frames < replies) {
    const std::string changes = "change of status, reason or flags or a cut";
    notices.push_back(count(digest.frames) + " of " + count(replies) + " replies are frames here: " +
                      (digest.kept_changes < digest.changes
                           ? count(digest.kept_changes) + " of the " + count(digest.changes) + " with a " + changes
                           : "every one with a " + changes) +
                      ", and an even share of the others; the figures are of all.");
  }
  if (!recording.container().finished)
    notices.push_back("The file has no end: its writer was stopped, and up to a second may be missing.");
  if (!recording.container().loss.none() || !digest.read.loss.none())
    notices.push_back("The file is damaged: " + count(recording.container().loss.troubles + digest.read.loss.troubles) +
                      " places cannot be read.");
  if (digest.read.undecodable > 0)
    notices.push_back(count(digest.read.undecodable) + " messages cannot be decoded and are left out.");
  if (recording.info().snapshot_ticks() > 0)
    notices.push_back("The file begins in the middle of its session, after " +
                      count(recording.info().snapshot_ticks()) + " ticks.");
  if (digest.missing > 0)
    notices.push_back(count(digest.missing) +
                      " messages were not recorded: after such a gap things may not stand where they stood.");
  if (digest.left_out_marks > 0) notices.push_back(count(digest.left_out_marks) + " more events are not listed.");
  return notices;
}

}  // namespace sightline
