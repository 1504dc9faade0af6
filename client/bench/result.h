// The measurements of a load: latencies by window, and their figures, as JSON for programs and as a table for people.
#pragma once

#include <array>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <ostream>
#include <span>
#include <string_view>
#include <vector>

namespace sightline {

// One kind of latency, in microseconds.
enum class BenchMetric {
  kRoundTrip,  // from when a tick was due to the reply that covers it; merged ticks count as well
  kTransport,  // of a reply: round trip - queue - step; includes the generator's own delay (kSend)
  kSend,       // from when a tick was due until it was handed to gRPC: the generator's own delay
  kQueue,      // this one and the following are reported by the server, once a reply
  kScene,
  kBound,
  kSample,
  kAggregate,
  kMove,
  kStep  // kScene to kMove together
};
inline constexpr size_t kBenchMetrics = 10;
inline constexpr std::array<std::string_view, kBenchMetrics> kBenchMetricNames{
    "round_trip", "transport", "send", "queue", "scene", "bound", "sample", "aggregate", "move", "step"};

// The measurements in one window, of one session or of all sessions together.
struct BenchWindow {
  std::array<std::vector<double>, kBenchMetrics> us;
  uint64_t replies = 0;
  uint64_t late = 0;      // ticks whose round trip took longer than the tick interval
  uint64_t degraded = 0;  // replies with StepFlags.degraded
  uint64_t tick_bytes = 0, reply_bytes = 0;

  const std::vector<double>& of(BenchMetric metric) const { return us[static_cast<size_t>(metric)]; }
  void add(BenchMetric metric, double value_us) { us[static_cast<size_t>(metric)].push_back(value_us); }
  void add(const BenchWindow& other);
  uint64_t ticks() const { return of(BenchMetric::kRoundTrip).size(); }
};

// One window, all sessions together. CPU times are microseconds a tick.
struct MeasuredWindow {
  BenchWindow daemon;
  std::optional<BenchWindow> echo;
  std::vector<uint64_t> replies_by_session;
  std::optional<double> daemon_cpu_us;  // only when the daemon's process is known
  double generator_cpu_us = 0.0;        // of this process
};

// Exact percentiles by nearest rank; all 0 without values.
struct Quantiles {
  size_t count = 0;
  double p50 = 0.0, p90 = 0.0, p99 = 0.0, p999 = 0.0, max = 0.0;
};
Quantiles quantiles_of(const std::vector<double>& values);

// (greatest - least) / least; infinite when only the least is 0, 0 without values.
double relative_range(const std::vector<double>& values);

// Windows are stable when the last kStableWindows agree: their p50 lie within 10 % and their p99 within 30 %
// (relative_range). Fewer windows, or one without any value, are not stable.
inline constexpr size_t kStableWindows = 3;
bool are_stable(std::span<const Quantiles> round_trips);

// A round trip should take at most this many times the echo's round trip and the step together.
inline constexpr double kAllowedOverFloor = 1.2;

// The figures of the reported windows; client/README.md lists the fields. `load` says what ran and has the fields
// `sessions`, `rate_hz` and `window_s`, among others.
using BenchJson = nlohmann::ordered_json;
BenchJson summarize(std::span<const MeasuredWindow> windows, const BenchJson& load);

// Prints a result of run_bench (command.h).
void print_bench(const BenchJson& result, std::ostream& out);

}  // namespace sightline
