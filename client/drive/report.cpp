#include "client/drive/report.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "client/base/text_table.h"
#include "server/wire/short_name.h"

namespace sightline {

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
  return line + short_name(reply.status()) + " " + short_name(reply.reason()) +
         formatted("  %.2f ms", frame.latency_ms);
}

namespace {

struct Latencies {
  std::vector<double> reply_ms, step_ms;
  size_t merged = 0;
};

Latencies latencies_of(std::span<const PlayedFrame> frames) {
  Latencies found;
  for (const PlayedFrame& frame : frames) {
    found.reply_ms.push_back(frame.latency_ms);
    found.step_ms.push_back(frame.reply.stage_times().total_us() / 1000.0);
    found.merged += frame.reply.merged_ticks();
  }
  return found;
}

}  // namespace

nlohmann::ordered_json latency_json(std::span<const PlayedFrame> frames) {
  const auto [reply_ms, step_ms, merged] = latencies_of(frames);
  const auto spread = [](const std::vector<double>& values) {
    return nlohmann::ordered_json{
        {"p50", percentile(values, 0.50)}, {"p95", percentile(values, 0.95)}, {"p99", percentile(values, 0.99)}};
  };
  return {{"reply_ms", spread(reply_ms)}, {"step_ms", spread(step_ms)}, {"merged_ticks", merged}};
}

std::vector<FigureRow> latency_rows(std::span<const PlayedFrame> frames) {
  const auto [latencies, steps, merged] = latencies_of(frames);
  const auto spread = [](const std::vector<double>& values) {
    return formatted("p50 %.2f  p95 %.2f  p99 %.2f ms", percentile(values, 0.50), percentile(values, 0.95),
                     percentile(values, 0.99));
  };
  return {{"latency (tick sent to reply received)", {spread(latencies)}},
          {"of which the step itself", {spread(steps)}},
          {"ticks merged into a later answer", {std::to_string(merged)}}};
}

void print_table(std::ostream& out, const RunMetrics& run, const std::optional<RunMetrics>& follow,
                 std::span<const PlayedFrame> frames) {
  out << formatted("%zu frames, %zu of them judged by a %d x %d re-render\n", run.frames, run.pictures, kTruthSize,
                   kTruthSize);
  std::vector<std::string> columns{"sightline"};
  if (follow) columns.emplace_back("follow");
  print_rows(out, columns, truth_rows(run, follow));
  print_rows(out, {}, latency_rows(frames));
}

}  // namespace sightline
