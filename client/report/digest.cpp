#include "client/report/digest.h"

#include <google/protobuf/util/json_util.h>

#include <algorithm>
#include <optional>

#include "client/page/page_reply.h"
#include "client/scenario/scenario_session.h"
#include "server/wire/short_name.h"

namespace sightline {
namespace {

constexpr size_t kLeastFrames = 500;  // however much moves
constexpr size_t kLongestText = 400;

std::string json_of(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  std::string json;
  if (!google::protobuf::util::MessageToJsonString(message, &json, options).ok()) return "?";
  return json.size() <= kLongestText ? json : json.substr(0, kLongestText) + "...";
}

// What of a reply must not be lost when frames are left out.
struct Outline {
  v1::TrackingStatus status{};
  v1::MoveReason reason{};
  std::string flags;
  bool operator==(const Outline&) const = default;
};

class Digester {
 public:
  Digester(const Convention& convention, const DigestOptions& options)
      : convention_(convention), options_(options) {
    digest_.figures.stage_us.resize(page_stages().size());
  }

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
      digest_.marks.push_back({digest_.figures.replies, std::move(kind), std::move(text)});
    else
      ++digest_.left_out_marks;
  }

  void take(const v1::Tick& tick, uint64_t log_ns) {
    ++digest_.figures.ticks;
    newest_tick_ = {tick.sequence(), log_ns};
    poses_ += static_cast<size_t>(tick.transforms().ids_size());
    if (tick.has_settings()) mark("change", "settings " + json_of(tick.settings()));
    if (tick.has_tuning()) mark("change", "tuning " + json_of(tick.tuning()));
    if (tick.has_limits()) mark("change", "limits " + json_of(tick.limits()));
    if (tick.has_lens()) mark("change", "lens " + json_of(tick.lens()));
    if (tick.has_targets()) mark("change", targets_text(tick.targets()));
  }

  static std::string targets_text(const v1::TargetList& list) {
    std::string text = "targets:";
    for (const v1::Target& target : list.targets()) text.append(" ").append(std::to_string(target.id()));
    return list.targets().empty() ? "no targets" : text;
  }

  void take(const v1::TickError& rejection, uint64_t) {
    ++digest_.figures.rejections;
    mark("rejection", "tick " + std::to_string(rejection.sequence()) + ": " + rejection.message());
  }
  void take(const v1::Fault& fault, uint64_t) {
    ++digest_.figures.faults;
    mark("fault", (fault.stage().empty() ? "" : fault.stage() + ": ") + fault.message());
  }
  void take(const v1::Gap& gap, uint64_t) {
    digest_.figures.missing += gap.messages();
    std::string text =
        std::to_string(gap.messages()) + " messages are missing: " + short_name(gap.reason());
    mark("gap", gap.text().empty() ? text : text + ", " + gap.text());
  }

  void take(const v1::CameraReply& reply, uint64_t log_ns) {
    if (digest_.figures.replies == 0) digest_.first_log_ns = log_ns;
    digest_.candidates =
        std::max(digest_.candidates, static_cast<size_t>(reply.candidates().visible_masks_size()));
    if (reply.candidates().visible_masks_size() > 0) digest_.has_candidates = true;
    Outline outline{reply.status(), reply.reason(), reply.flags().SerializeAsString()};
    important_.push_back(reply.cut() || !(outline == last_));
    last_ = std::move(outline);
    count(reply);
    time(reply, log_ns);
    ++digest_.figures.replies;
    if (options_.progress) options_.progress(digest_.figures.replies);
  }

  void count(const v1::CameraReply& reply) {
    DigestFigures& figures = digest_.figures;
    bool all = true;
    for (const v1::TargetVisibility& seen : reply.targets()) {
      TargetSums& sums = figures.targets[seen.id()];
      ++sums.replies;
      sums.visible += seen.visible_share();
      sums.filtered += seen.filtered_share();
      sums.distance_m += seen.distance() * convention_.metres_per_unit;
      all = all && seen.state() == v1::TARGET_STATE_VISIBLE;
    }
    if (!reply.targets().empty()) ++figures.with_targets, figures.all_visible += all ? 1 : 0;
    ++figures.statuses[short_name(reply.status())];
    ++figures.reasons[short_name(reply.reason())];
    const glm::dvec3 place = position_from_client(convention_, pose_from(reply.pose()).position_m);
    if (place_m_ && !reply.cut()) figures.travel_m += glm::distance(*place_m_, place);
    place_m_ = place;
    figures.cuts += reply.cut() ? 1 : 0;
    figures.merged_ticks += reply.merged_ticks();
    figures.degraded += reply.flags().degraded() ? 1 : 0;
    figures.recording_degraded += reply.flags().recording_degraded() ? 1 : 0;
  }

  void time(const v1::CameraReply& reply, uint64_t log_ns) {
    DigestFigures& figures = digest_.figures;
    const v1::StageTimes& times = reply.stage_times();
    const double stages[] = {times.scene_us(), times.bound_us(), times.sample_us(), times.aggregate_us(),
                             times.move_us()};
    for (size_t i = 0; i < figures.stage_us.size(); ++i) figures.stage_us[i].push_back(stages[i]);
    figures.total_us.push_back(times.total_us());
    figures.queue_us.push_back(times.queue_us());
    if (newest_tick_.sequence == reply.sequence() && log_ns >= newest_tick_.log_ns)
      figures.answer_ms.push_back(static_cast<double>(log_ns - newest_tick_.log_ns) * 1e-6);
  }

  // ---- which become frames ----

  size_t frames_allowed() const {
    const size_t replies = std::max<size_t>(1, important_.size());
    const size_t poses_a_reply = std::max<size_t>(1, poses_ / replies);
    return std::clamp(kMaxPagePoses / poses_a_reply, std::min(kLeastFrames, options_.max_frames),
                      options_.max_frames);
  }

  void choose() {
    const size_t replies = important_.size(), allowed = frames_allowed();
    digest_.kept.assign(replies, replies <= allowed);
    digest_.frames = std::min(replies, allowed);
    if (replies <= allowed) return;
    important_.front() = important_.back() = true;
    const auto count = static_cast<size_t>(std::count(important_.begin(), important_.end(), true));
    // Where changes alone are too many, calm stretches still have their share.
    const size_t for_changes = count <= allowed ? count : allowed * 3 / 4;
    digest_.changes = count, digest_.kept_changes = for_changes;
    keep_some(important_, count, for_changes);
    std::vector<bool> others(replies);
    for (size_t i = 0; i < replies; ++i) others[i] = !important_[i];
    keep_some(others, replies - count, allowed - for_changes);
    digest_.kept.front() = digest_.kept.back() = true;
    digest_.frames = static_cast<size_t>(std::count(digest_.kept.begin(), digest_.kept.end(), true));
  }

  // Of `count` replies as many as `most`, evenly spaced.
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

  const Convention& convention_;
  const DigestOptions& options_;
  RecordingDigest digest_;
  std::vector<bool> important_;  // by reply
  Outline last_;
  Arrival newest_tick_;
  std::optional<glm::dvec3> place_m_;
  size_t poses_ = 0;
};

}  // namespace

RecordingDigest digest_recording(const Recording& recording, const Convention& convention,
                                 const DigestOptions& options) {
  return Digester(convention, options).run(recording);
}

}  // namespace sightline
