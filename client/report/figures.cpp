#include "client/report/figures.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <set>

#include "client/base/text_table.h"
#include "client/scenario/scenario_session.h"
#include "server/wire/short_name.h"

namespace sightline {
namespace {

std::string percent(double part, double whole = 1.0) {
  return formatted("%.1f %%", whole > 0 ? 100 * part / whole : 0.0);
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

// "LIMITED_BY_SPEED" -> "limited by speed"
std::string plain(std::string word) {
  for (char& c : word) c = c == '_' ? ' ' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return word;
}

}  // namespace

void print_rows(std::ostream& out, std::span<const std::string> columns, std::span<const FigureRow> rows) {
  constexpr int kLabelWidth = 44;
  size_t width = 14;
  for (const FigureRow& row : rows)
    for (const std::string& value : row.values) width = std::max(width, value.size() + 2);
  const auto print = [&](const std::string& label, std::span<const std::string> values) {
    out << "  " << std::left << std::setw(kLabelWidth) << label << std::right;
    for (const std::string& value : values) out << std::setw(static_cast<int>(width)) << value;
    out << '\n';
  };
  if (!columns.empty()) print("", columns);
  for (const FigureRow& row : rows) print(row.label, row.values);
}

std::vector<FigureRow> truth_rows(const RunMetrics& run, const std::optional<RunMetrics>& other) {
  std::vector<FigureRow> rows;
  const auto row = [&](const std::string& label, auto cell) {
    rows.push_back({label, {cell(run)}});
    if (other) rows.back().values.push_back(cell(*other));
  };
  using Run = RunMetrics;
  for (size_t k = 0; run.pictures > 0 && k < run.targets.size(); ++k) {
    const std::string& name = run.targets[k].name;
    row("mean visible share: " + name, [k](const Run& m) { return percent(m.targets[k].mean_visible_share); });
    row("mean share of the whole body: " + name, [k](const Run& m) { return percent(m.targets[k].mean_whole_share); });
    row("in frame: " + name, [k](const Run& m) { return percent(m.targets[k].in_frame_share); });
  }
  if (run.pictures > 0) {
    row("r_N (no target visible)", [](const Run& m) { return percent(m.r_n); });
    row("r_P (partly hidden)", [](const Run& m) { return percent(m.r_p); });
    row("r_P with 5 % tolerance", [](const Run& m) { return percent(m.r_p_tolerant); });
    row("all targets seen (a pixel of each)", [](const Run& m) { return percent(m.all_seen); });
    row("all targets whole (95 % of each seen in the picture)",
        [](const Run& m) { return percent(m.joint_whole_share); });
    row("all targets clear (95 % of the part inside)", [](const Run& m) { return percent(m.joint_visible_share()); });
  }
  row("body collisions (frames)", [](const Run& m) { return std::to_string(m.body_collisions); });
  row("least clearance", [](const Run& m) { return formatted("%.2f m", m.least_clearance_m); });
  row("motion limit violations (frames)", [](const Run& m) { return std::to_string(m.limit_violations); });
  row("path length d_c", [](const Run& m) { return formatted("%.1f m", m.d_c_m); });
  return rows;
}

CameraFrame frame_of(const v1::CameraReply& reply, const Convention& convention, const Lens& told) {
  CameraFrame frame;
  frame.time_s = reply.pose_time_s();
  frame.camera = camera_from_client(convention, pose_from(reply.pose()));
  frame.lens = told;
  frame.lens.vertical_fov_rad = fov_from_client(convention, reply.field_of_view(), told.aspect);
  frame.jump = reply.cut() || reply.flags().dt_capped();
  return frame;
}

void ReplyFigures::take(const v1::Tick& tick) {
  const v1::Vec3& shift = tick.world_shift();
  convention_.origin_m += vector_from_client(convention_, {shift.x(), shift.y(), shift.z()});
}

void ReplyFigures::add(const v1::CameraReply& reply) {
  CameraFrame frame = frame_of(reply, convention_);
  if (!frames_.empty() && !reply.cut())
    travel_m_ += glm::distance(frames_.back().camera.position_m, frame.camera.position_m);
  frames_.push_back(std::move(frame));
  bool all_visible = true, all_seen = true;
  for (const v1::TargetVisibility& target : reply.targets()) {
    TargetSums& sums = targets_[target.id()];
    ++sums.replies;
    sums.visible += target.visible_share();
    sums.filtered += target.filtered_share();
    sums.distance_m += target.distance() * convention_.metres_per_unit;
    all_visible &= target.state() == v1::TARGET_STATE_VISIBLE;
    all_seen &= target.visible_share() > 0 && target.in_picture();
  }
  if (!reply.targets().empty()) {
    ++with_targets_;
    all_visible_ += all_visible;
    all_seen_ += all_seen;
  }
  ++states_["status " + plain(short_name(reply.status()))];
  ++states_["reason " + plain(short_name(reply.reason()))];
  cuts_ += reply.cut();
  merged_ticks_ += reply.merged_ticks();
  degraded_ += reply.flags().degraded();
  recording_degraded_ += reply.flags().recording_degraded();
  body_overlaps_ += reply.flags().body_overlap();
  const v1::StageTimes& times = reply.stage_times();
  const float us[] = {times.queue_us(),     times.scene_us(), times.bound_us(), times.sample_us(),
                      times.aggregate_us(), times.move_us(),  times.total_us()};
  for (size_t i = 0; i < kStages.size(); ++i) stage_us_[i].push_back(us[i]);
}

std::string spread_text(const std::vector<double>& values, double per_ms) {
  if (values.empty()) return "not known";
  return formatted("p50 %.3f  p99 %.3f ms", percentile(values, 0.5) / per_ms, percentile(values, 0.99) / per_ms);
}

class ReplyTable {
 public:
  ReplyTable(std::span<const ReplyFigures* const> runs, const std::map<uint64_t, std::string>& names)
      : runs_(runs), names_(names) {}

  std::vector<FigureRow> rows() {
    row("replies", [](const Run& run) { return std::to_string(run.replies()); });
    add_targets();
    row("every target wholly seen", [](const Run& run) {
      return percent(static_cast<double>(run.all_visible_), static_cast<double>(run.with_targets_));
    });
    row("all targets seen", [](const Run& run) {
      return percent(static_cast<double>(run.all_seen_), static_cast<double>(run.with_targets_));
    });
    add_states();
    add_motion();
    row("cuts", [](const Run& run) { return std::to_string(run.cuts_); });
    row("ticks merged into a later reply", [](const Run& run) { return std::to_string(run.merged_ticks_); });
    row("degraded steps", [](const Run& run) { return std::to_string(run.degraded_); });
    row("steps with a degraded recording", [](const Run& run) { return std::to_string(run.recording_degraded_); });
    row("steps with the body in a collider", [](const Run& run) { return std::to_string(run.body_overlaps_); });
    for (size_t i = 0; i < Run::kStages.size(); ++i)
      row(std::string("stage ").append(Run::kStages[i]),
          [i](const Run& run) { return spread_text(run.stage_us_[i], 1000.0); });
    return std::move(rows_);
  }

 private:
  using Run = ReplyFigures;

  template <typename Cell>
  void row(std::string label, Cell cell) {
    FigureRow& row = rows_.emplace_back(FigureRow{std::move(label), {}});
    for (const Run* run : runs_) row.values.push_back(cell(*run));
  }

  void add_targets() {
    std::set<uint64_t> ids;
    for (const Run* run : runs_)
      for (const auto& [id, sums] : run->targets_) ids.insert(id);
    for (const uint64_t id : ids) {
      const auto named = names_.find(id);
      const std::string name = named == names_.end() ? "target " + std::to_string(id) : named->second;
      const auto mean = [id](const char* format, double Run::TargetSums::*sum, double scale) {
        return [=](const Run& run) {
          const auto found = run.targets_.find(id);
          if (found == run.targets_.end()) return std::string("-");
          return formatted(format, scale * found->second.*sum / static_cast<double>(found->second.replies));
        };
      };
      row("visible share: " + name, mean("%.2f %%", &Run::TargetSums::visible, 100));
      row("filtered share: " + name, mean("%.2f %%", &Run::TargetSums::filtered, 100));
      row("distance: " + name, mean("%.2f m", &Run::TargetSums::distance_m, 1));
    }
  }

  void add_states() {
    std::set<std::string> states;
    for (const Run* run : runs_)
      for (const auto& [state, count] : run->states_) states.insert(state);
    for (const std::string& state : states)
      row(state, [&](const Run& run) {
        const auto found = run.states_.find(state);
        return percent(found == run.states_.end() ? 0.0 : static_cast<double>(found->second),
                       static_cast<double>(run.replies()));
      });
  }

  void add_motion() {
    std::vector<RunMetrics> motions;
    for (const Run* run : runs_)
      motions.push_back(summarize(std::vector<TargetMetrics>{}, run->frames_, {}, CameraLimits{}));
    const auto motion = [&](const char* label, const char* format, double RunMetrics::*value) {
      FigureRow& row = rows_.emplace_back(FigureRow{label, {}});
      for (const RunMetrics& run : motions) row.values.push_back(formatted(format, run.*value));
    };
    row("camera travel", [](const Run& run) { return formatted("%.2f m", run.travel_m_); });
    motion("peak speed", "%.2f m/s", &RunMetrics::peak_speed_mps);
    row("rms speed", [](const Run& run) { return formatted("%.2f m/s", rms_speed(run.frames_)); });
    motion("peak acceleration", "%.2f m/s2", &RunMetrics::peak_acceleration_mps2);
    motion("rms acceleration", "%.2f m/s2", &RunMetrics::rms_acceleration_mps2);
    motion("peak jerk", "%.1f m/s3", &RunMetrics::peak_jerk_mps3);
    motion("rms jerk", "%.1f m/s3", &RunMetrics::rms_jerk_mps3);
    motion("peak turn", "%.3f rad/s", &RunMetrics::peak_angular_speed_radps);
  }

  const std::span<const ReplyFigures* const> runs_;
  const std::map<uint64_t, std::string>& names_;
  std::vector<FigureRow> rows_;
};

std::vector<FigureRow> reply_rows(std::span<const ReplyFigures* const> runs,
                                  const std::map<uint64_t, std::string>& names) {
  return ReplyTable(runs, names).rows();
}

}  // namespace sightline
