// What was measured in one window of a load, of one session or of all together.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

namespace sightline {

// One latency each, microseconds.
enum class BenchMetric {
  kRoundTrip,  // from when a tick was due to the reply that covers it; merged ticks count as well
  kTransport,  // of a reply: round trip - queue - step; the generator's own delay (kSend) is in it
  kSend,       // from when a tick was due to handing it to gRPC: the generator's own delay
  kQueue,      // from here on as the server says, once a reply
  kScene,
  kBound,
  kSample,
  kAggregate,
  kMove,
  kStep  // scene to move
};
inline constexpr size_t kBenchMetrics = 10;
inline constexpr std::array<std::string_view, kBenchMetrics> kBenchMetricNames{
    "round_trip", "transport", "send", "queue", "scene", "bound", "sample", "aggregate", "move", "step"};

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

}  // namespace sightline
