// The text output of a drive: a line a second, and the table at the end.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <ostream>
#include <span>
#include <string>
#include <vector>

#include "client/drive/player.h"
#include "client/report/figures.h"

namespace sightline {

// "   3.0 s  (1.20, 2.00, 5.31)  guard 1.00  thief 0.87  S_N 10  S_P 40  S_V 293  TRACKING ...  0.52 ms"
std::string summary_line(const Scenario& scenario, const PlayedFrame& frame);

// Latencies of the run itself, without the baseline.
std::vector<FigureRow> latency_rows(std::span<const PlayedFrame> frames);

// The same figures in milliseconds: `reply_ms` (tick sent to reply received) and `step_ms`, each with p50, p95 and p99;
// and `merged_ticks`.
nlohmann::ordered_json latency_json(std::span<const PlayedFrame> frames);

// One column for the run and, where it was judged, one for `follow`; then latencies.
void print_table(std::ostream& out, const RunMetrics& run, const std::optional<RunMetrics>& follow,
                 std::span<const PlayedFrame> frames);

}  // namespace sightline
