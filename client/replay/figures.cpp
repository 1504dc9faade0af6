#include "client/replay/figures.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "client/scenario/scenario_session.h"
#include "client/base/text_table.h"
#include "client/drive/trace.h"

namespace sightline {
namespace {

double share(uint64_t part, uint64_t whole) {
  return whole == 0 ? 0.0 : static_cast<double>(part) / static_cast<double>(whole);
}

std::string percent(double value) {
  return formatted("%.2f %%", 100 * value);
}

uint64_t count_of(const std::map<int, uint64_t>& counts, int value) {
  const auto found = counts.find(value);
  return found == counts.end() ? 0 : found->second;
}

std::set<int> values_of(const std::map<int, uint64_t>& a, const std::map<int, uint64_t>& b) {
  std::set<int> values;
  for (const auto* counts : {&a, &b})
    for (const auto& [value, count] : *counts) values.insert(value);
  return values;
}

double rms_speed(const std::vector<CameraFrame>& frames) {
  double sum = 0.0;
  size_t count = 0;
  for (const MotionSample& sample : motion_of(frames)) {
    if (!sample.valid) continue;
    sum += sample.speed_mps * sample.speed_mps;
    ++count;
  }
  return count == 0 ? 0.0 : std::sqrt(sum / static_cast<double>(count));
}

}  // namespace

CameraFrame frame_of(const v1::CameraReply& reply, const Convention& convention, const Lens& told) {
  CameraFrame frame;
  frame.time_s = reply.pose_time_s();
  frame.camera = camera_from_client(convention, pose_from(reply.pose()));
  frame.lens = told;
  frame.lens.vertical_fov_rad = fov_from_client(convention, reply.field_of_view(), told.aspect);
  frame.jump = reply.cut() || reply.flags().dt_capped();
  return frame;
}

void ReplayFigures::add(const v1::CameraReply& reply) {
  frames_.push_back(frame_of(reply, convention_));
  bool all_seen = true;
  for (const auto& target : reply.targets()) {
    TargetSums& sums = targets_[target.id()];
    ++sums.replies;
    sums.visible += target.visible_share();
    sums.filtered += target.filtered_share();
    all_seen &= target.visible_share() > 0 && target.in_picture();
  }
  all_seen_ += all_seen && reply.targets_size() > 0;
  ++statuses_[reply.status()];
  ++reasons_[reply.reason()];
  cuts_ += reply.cut();
  merged_ticks_ += reply.merged_ticks();
  degraded_ += reply.flags().degraded();
  body_overlaps_ += reply.flags().body_overlap();
  const v1::StageTimes& times = reply.stage_times();
  const std::array<float, kStages.size()> us{times.queue_us(),  times.scene_us(),     times.bound_us(),
                                             times.sample_us(), times.aggregate_us(), times.move_us(),
                                             times.total_us()};
  for (size_t i = 0; i < us.size(); ++i) stage_us_[i].push_back(us[i]);
}

std::vector<FigureRow> side_by_side(const ReplayFigures& recorded, const ReplayFigures& replayed) {
  std::vector<FigureRow> rows;
  const auto row = [&](std::string label, const auto& cell) {
    rows.push_back({std::move(label), {cell(recorded), cell(replayed)}});
  };
  using Run = ReplayFigures;
  row("replies", [](const Run& run) { return std::to_string(run.replies()); });
  std::set<uint64_t> targets;
  for (const Run* run : {&recorded, &replayed})
    for (const auto& [id, sums] : run->targets_) targets.insert(id);
  for (const uint64_t id : targets) {
    const auto mean = [id](double Run::TargetSums::*sum) {
      return [id, sum](const Run& run) {
        const auto found = run.targets_.find(id);
        if (found == run.targets_.end()) return std::string("-");
        return formatted("%.4f", found->second.*sum / static_cast<double>(found->second.replies));
      };
    };
    row("mean visible share of target " + std::to_string(id), mean(&Run::TargetSums::visible));
    row("mean filtered share of target " + std::to_string(id), mean(&Run::TargetSums::filtered));
  }
  row("all targets seen", [](const Run& run) { return percent(share(run.all_seen_, run.replies())); });
  for (const int status : values_of(recorded.statuses_, replayed.statuses_))
    row("status " + name_of(static_cast<v1::TrackingStatus>(status)),
        [status](const Run& run) { return percent(share(count_of(run.statuses_, status), run.replies())); });
  for (const int reason : values_of(recorded.reasons_, replayed.reasons_))
    row("reason " + name_of(static_cast<v1::MoveReason>(reason)),
        [reason](const Run& run) { return percent(share(count_of(run.reasons_, reason), run.replies())); });

  const auto motion = [](const Run& run) {
    return summarize(std::vector<TargetMetrics>{}, run.frames_, {}, CameraLimits{});
  };
  const RunMetrics motions[] = {motion(recorded), motion(replayed)};
  const auto figure = [&](const char* label, const char* format, double RunMetrics::*value) {
    rows.push_back({label, {formatted(format, motions[0].*value), formatted(format, motions[1].*value)}});
  };
  figure("travel", "%.2f m", &RunMetrics::d_c_m);
  figure("peak speed", "%.2f m/s", &RunMetrics::peak_speed_mps);
  row("rms speed", [](const Run& run) { return formatted("%.2f m/s", rms_speed(run.frames_)); });
  figure("peak acceleration", "%.2f m/s2", &RunMetrics::peak_acceleration_mps2);
  figure("rms acceleration", "%.2f m/s2", &RunMetrics::rms_acceleration_mps2);
  figure("peak jerk", "%.1f m/s3", &RunMetrics::peak_jerk_mps3);
  figure("rms jerk", "%.1f m/s3", &RunMetrics::rms_jerk_mps3);
  figure("peak turn", "%.3f rad/s", &RunMetrics::peak_angular_speed_radps);

  const auto count = [&](const char* label, uint64_t Run::*value) {
    if (recorded.*value > 0 || replayed.*value > 0)
      row(label, [value](const Run& run) { return std::to_string(run.*value); });
  };
  count("cuts", &Run::cuts_);
  count("ticks merged into a later answer", &Run::merged_ticks_);
  count("degraded steps", &Run::degraded_);
  count("steps with the body in a collider", &Run::body_overlaps_);
  for (size_t i = 0; i < Run::kStages.size(); ++i)
    row(std::string(Run::kStages[i]).append(" p50 / p99, us"), [i](const Run& run) {
      return formatted("%.0f / %.0f", percentile(run.stage_us_[i], 0.5), percentile(run.stage_us_[i], 0.99));
    });
  return rows;
}

}  // namespace sightline
