#include "client/drive/report.h"

#include <algorithm>
#include <iomanip>

#include "client/base/text_table.h"
#include "client/drive/trace.h"

namespace sightline {
namespace {

std::string percent(double share) {
  return formatted("%.1f %%", 100 * share);
}

class Rows {
 public:
  Rows(const RunMetrics& run, const std::optional<RunMetrics>& follow) : run_(run), follow_(follow) {}

  // `cell` gives the text of one column from its metrics.
  template <typename Cell>
  void row(const std::string& label, Cell cell) {
    rows_.push_back({label, {cell(run_)}});
    if (follow_) rows_.back().values.push_back(cell(*follow_));
  }
  std::vector<FigureRow> take() { return std::move(rows_); }

 private:
  const RunMetrics& run_;
  const std::optional<RunMetrics>& follow_;
  std::vector<FigureRow> rows_;
};

void add_sight(Rows& rows, const RunMetrics& run) {
  for (size_t k = 0; k < run.targets.size(); ++k) {
    const std::string& name = run.targets[k].name;
    rows.row("mean visible share: " + name,
             [k](const RunMetrics& m) { return percent(m.targets[k].mean_visible_share); });
    rows.row("in frame: " + name, [k](const RunMetrics& m) { return percent(m.targets[k].in_frame_share); });
  }
  rows.row("r_N (no target visible)", [](const RunMetrics& m) { return percent(m.r_n); });
  rows.row("r_P (partly hidden)", [](const RunMetrics& m) { return percent(m.r_p); });
  rows.row("r_P with 5 % tolerance", [](const RunMetrics& m) { return percent(m.r_p_tolerant); });
  rows.row("all targets seen (a pixel of each)", [](const RunMetrics& m) { return percent(m.all_seen); });
  rows.row("all targets clear (95 % of each)", [](const RunMetrics& m) { return percent(m.joint_visible_share()); });
}

void add_body(Rows& rows) {
  rows.row("body collisions (frames)", [](const RunMetrics& m) { return std::to_string(m.body_collisions); });
  rows.row("least clearance", [](const RunMetrics& m) { return formatted("%.2f m", m.least_clearance_m); });
  rows.row("motion limit violations (frames)",
           [](const RunMetrics& m) { return std::to_string(m.limit_violations); });
  rows.row("path length d_c", [](const RunMetrics& m) { return formatted("%.1f m", m.d_c_m); });
}

constexpr int kLabelWidth = 44, kCellWidth = 14;

void print_row(std::ostream& out, const std::string& label, std::span<const std::string> values) {
  out << "  " << std::left << std::setw(kLabelWidth) << label << std::right;
  for (const std::string& value : values) out << std::setw(kCellWidth) << value;
  out << '\n';
}

}  // namespace

std::string summary_line(const Scenario& scenario, const PlayedFrame& frame) {
  const v1::CameraReply& reply = frame.reply;
  const glm::dvec3& p = frame.frame.camera.position_m;
  std::string line = formatted("%7.1f s  (%.2f, %.2f, %.2f)", frame.frame.time_s, p.x, p.y, p.z);
  const std::vector<ScenarioActor> targets = scenario.targets();
  for (const auto& sight : reply.targets()) {
    const auto named = std::find_if(targets.begin(), targets.end(),
                                    [&](const ScenarioActor& target) { return target.id == sight.id(); });
    const std::string name = named == targets.end() ? std::to_string(sight.id()) : named->name;
    line += "  " + name + formatted(" %.2f", sight.visible_share());
    if (!sight.in_picture()) line += " (off screen)";
  }
  line += formatted("  S_N %u  S_P %u  S_V %u  ", reply.candidate_counts().none_visible(),
                    reply.candidate_counts().some_visible(), reply.candidate_counts().all_visible());
  return line + name_of(reply.status()) + " " + name_of(reply.reason()) +
         formatted("  %.2f ms", frame.latency_ms);
}

std::vector<FigureRow> figure_rows(const RunMetrics& run, const std::optional<RunMetrics>& follow) {
  Rows rows(run, follow);
  if (run.pictures > 0) add_sight(rows, run);
  add_body(rows);
  return rows.take();
}

std::vector<FigureRow> latency_rows(std::span<const PlayedFrame> frames) {
  std::vector<double> latencies, steps;
  size_t merged = 0;
  for (const PlayedFrame& frame : frames) {
    latencies.push_back(frame.latency_ms);
    steps.push_back(frame.reply.stage_times().total_us() / 1000.0);
    merged += frame.reply.merged_ticks();
  }
  const auto spread = [](const std::vector<double>& values) {
    return formatted("p50 %.2f  p95 %.2f  p99 %.2f ms", percentile(values, 0.50), percentile(values, 0.95),
                     percentile(values, 0.99));
  };
  return {{"latency (tick sent to reply received)", {spread(latencies)}},
          {"of which the step itself", {spread(steps)}},
          {"ticks merged into a later answer", {std::to_string(merged)}}};
}

void print_rows(std::ostream& out, std::span<const std::string> columns, std::span<const FigureRow> rows) {
  print_row(out, "", columns);
  for (const FigureRow& row : rows) print_row(out, row.label, row.values);
}

void print_table(std::ostream& out, const RunMetrics& run, const std::optional<RunMetrics>& follow,
                 std::span<const PlayedFrame> frames) {
  out << formatted("%zu frames, %zu of them judged by a %d x %d re-render\n", run.frames, run.pictures,
                   kTruthSize, kTruthSize);
  std::vector<std::string> columns{"sightline"};
  if (follow) columns.emplace_back("follow");
  print_rows(out, columns, figure_rows(run, follow));
  for (const FigureRow& row : latency_rows(frames))
    out << "  " << std::left << std::setw(kLabelWidth) << row.label << std::right << row.values.front()
        << '\n';
}

}  // namespace sightline
