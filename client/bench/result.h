// What a load measured, and what it comes to.
#pragma once

#include <array>
#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "client/bench/request_log.h"
#include "client/bench/statistics.h"
#include "client/bench/window.h"

namespace sightline {

// One window, all sessions together.
struct MeasuredWindow {
  BenchWindow daemon;
  std::optional<BenchWindow> echo;
  std::vector<uint64_t> replies_by_session;
  std::optional<double> daemon_cpu_us;                    // a tick; when the daemon can be watched
  double generator_cpu_us = 0.0;                          // a tick, of the whole process that sends the load
  double echo_cpu_us = 0.0, echo_generator_cpu_us = 0.0;  // a tick, with `echo`
};

// Of each window its percentile, and of those the median, the least and the most. Microseconds.
struct MetricFigures {
  uint64_t count = 0;  // in all windows
  Spread p50, p90, p99, p999, max;
};

// Resident memory of the daemon, bytes.
struct BenchMemory {
  size_t start = 0;                           // before the scene came
  size_t scene = 0;                           // with the scene and one session that has run
  size_t sessions = 0;                        // with all of them, at the end of the load
  size_t after = 0;                           // once they are closed
  std::optional<double> per_session() const;  // of each beyond the first; none with one
  size_t session_count = 1;
};

// One window's own figures, as the load went on: microseconds, shares in [0, 1].
struct WindowFigures {
  double round_trip_p50_us = 0.0, round_trip_p99_us = 0.0, step_p50_us = 0.0;
  double late_share = 0.0, degraded_share = 0.0;
  std::optional<double> daemon_cpu_us;  // a tick
};

// Round trip against what it cannot be less than: echo p50 + step p50, each of the same window.
struct EchoComparison {
  MetricFigures round_trip, send;
  Spread floor_us;                         // echo p50 + step p50
  Spread share;                            // round trip p50 / floor
  Spread server_cpu_us, generator_cpu_us;  // a tick
};
// What a round trip may be over that floor.
inline constexpr double kAllowedOverFloor = 1.2;

struct BenchResult {
  // What ran.
  std::string address, sampler;
  uint64_t instances = 0, triangles = 0;  // of one session
  size_t sessions = 0, targets = 0, moving = 0, channels = 0;
  double rate_hz = 0.0, window_s = 0.0;

  bool stable = false;
  size_t windows = 0;                       // that are reported: those that agree, or all when none do
  size_t windows_seen = 0;                  // after the warm-up
  double p50_range = 0.0, p99_range = 0.0;  // (greatest - least) / least of the reported windows' round trips

  std::vector<WindowFigures> course;        // of the reported windows, in order

  std::array<MetricFigures, kBenchMetrics> metrics;
  const MetricFigures& of(BenchMetric metric) const { return metrics[static_cast<size_t>(metric)]; }

  TickCounts totals;  // of the whole run, warm-up included
  // In the reported windows.
  uint64_t ticks = 0, replies = 0, late = 0, degraded = 0;
  double achieved_hz = 0.0;  // replies a second and session
  double least_served_hz = 0.0, most_served_hz = 0.0;
  double tick_bytes = 0.0, reply_bytes = 0.0;  // means
  std::optional<Spread> daemon_cpu_us;         // a tick
  Spread generator_cpu_us;                     // a tick
  std::optional<BenchMemory> memory;
  std::optional<EchoComparison> echo;
  std::string trouble;  // the first rejection, or whatever else no load expects; empty: none
};

// The figures of the windows that are reported; the fields that windows do not tell are left.
void summarize(const std::vector<MeasuredWindow>& windows, BenchResult& result);

// For a person.
void print_bench(const BenchResult& result, std::ostream& out);
// For a program; fields in client/README.md.
std::string bench_json(const BenchResult& result);

}  // namespace sightline
