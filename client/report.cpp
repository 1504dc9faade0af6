#include "client/report.h"

#include <algorithm>
#include <cstdio>
#include <iomanip>

#include "client/trace.h"

namespace sightline {
namespace {

template <typename... Values>
std::string formatted(const char* format, Values... values) {
  char text[256];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

std::string percent(double share) {
  return formatted("%.1f %%", 100 * share);
}

class Table {
 public:
  Table(std::ostream& out, const RunMetrics& run, const std::optional<RunMetrics>& follow)
      : out_(out), run_(run), follow_(follow) {}

  // `cell` gives the text of one column from its metrics.
  template <typename Cell>
  void row(const std::string& label, Cell cell) {
    out_ << "  " << std::left << std::setw(kLabelWidth) << label << std::right << std::setw(kCellWidth)
         << cell(run_);
    if (follow_) out_ << std::setw(kCellWidth) << cell(*follow_);
    out_ << '\n';
  }
  void header() {
    out_ << "  " << std::left << std::setw(kLabelWidth) << "" << std::right << std::setw(kCellWidth)
         << "sightline";
    if (follow_) out_ << std::setw(kCellWidth) << "follow";
    out_ << '\n';
  }

 private:
  static constexpr int kLabelWidth = 44, kCellWidth = 14;
  std::ostream& out_;
  const RunMetrics& run_;
  const std::optional<RunMetrics>& follow_;
};

void print_sight(Table& table, const RunMetrics& run) {
  for (size_t k = 0; k < run.targets.size(); ++k) {
    const std::string& name = run.targets[k].name;
    table.row("mean visible share: " + name,
              [k](const RunMetrics& m) { return percent(m.targets[k].mean_visible_share); });
    table.row("in frame: " + name, [k](const RunMetrics& m) { return percent(m.targets[k].in_frame_share); });
  }
  table.row("r_N (no target visible)", [](const RunMetrics& m) { return percent(m.r_n); });
  table.row("r_P (partly hidden)", [](const RunMetrics& m) { return percent(m.r_p); });
  table.row("r_P with 5 % tolerance", [](const RunMetrics& m) { return percent(m.r_p_tolerant); });
  table.row("all targets seen (a pixel of each)", [](const RunMetrics& m) { return percent(m.all_seen); });
  table.row("all targets clear (95 % of each)", [](const RunMetrics& m) { return percent(m.all_clear()); });
}

void print_body(Table& table) {
  table.row("body collisions (frames)",
            [](const RunMetrics& m) { return std::to_string(m.body_collisions); });
  table.row("least clearance", [](const RunMetrics& m) { return formatted("%.2f m", m.least_clearance_m); });
  table.row("motion limit violations (frames)",
            [](const RunMetrics& m) { return std::to_string(m.limit_violations); });
  table.row("path length d_c", [](const RunMetrics& m) { return formatted("%.1f m", m.d_c_m); });
}

void print_latency(std::ostream& out, std::span<const PlayedFrame> frames) {
  std::vector<double> latencies, steps;
  size_t merged = 0;
  for (const PlayedFrame& frame : frames) {
    latencies.push_back(frame.latency_ms);
    steps.push_back(frame.reply.stage_times().total_us() / 1000.0);
    merged += frame.reply.merged_ticks();
  }
  const auto line = [&](const char* what, const std::vector<double>& values) {
    out << formatted("  %-44sp50 %.2f  p95 %.2f  p99 %.2f ms\n", what, percentile(values, 0.50),
                     percentile(values, 0.95), percentile(values, 0.99));
  };
  line("latency (tick sent to reply received)", latencies);
  line("of which the step itself", steps);
  out << formatted("  %-44s%zu\n", "ticks merged into a later answer", merged);
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
  line += formatted("  S_N %u  S_P %u  S_V %u  ", reply.counts().none_visible(),
                    reply.counts().some_visible(), reply.counts().all_visible());
  return line + name_of(reply.status()) + " " + name_of(reply.reason()) +
         formatted("  %.2f ms", frame.latency_ms);
}

void print_table(std::ostream& out, const RunMetrics& run, const std::optional<RunMetrics>& follow,
                 std::span<const PlayedFrame> frames) {
  Table table(out, run, follow);
  out << formatted("%zu frames, %zu of them judged by a %d x %d re-render\n", run.frames, run.pictures,
                   kTruthSize, kTruthSize);
  table.header();
  if (run.pictures > 0) print_sight(table, run);
  print_body(table);
  print_latency(out, frames);
}

}  // namespace sightline
