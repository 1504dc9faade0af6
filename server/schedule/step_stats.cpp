#include "server/schedule/step_stats.h"

#include <algorithm>
#include <cmath>

namespace sightline {

// The first class holds everything up to 1 us; class i > 0 ends at 2^(i / 8) us.
size_t DurationCounts::class_of(int64_t duration_ns) {
  if (duration_ns <= 1'000) return 0;
  const double octaves = std::log2(static_cast<double>(duration_ns) * 1e-3);
  const auto index = static_cast<size_t>(std::ceil(octaves * kClassesPerOctave));
  return std::min<size_t>(index, kClassesPerOctave * kOctaves - 1);
}

double DurationCounts::end_us(size_t index) {
  return std::exp2(static_cast<double>(index) / kClassesPerOctave);
}

void DurationCounts::add(int64_t duration_ns) {
  counts_[class_of(duration_ns)].fetch_add(1, std::memory_order_relaxed);
}

uint64_t DurationCounts::count() const {
  uint64_t count = 0;
  for (const auto& of_class : counts_) count += of_class.load(std::memory_order_relaxed);
  return count;
}

double DurationCounts::quantile_us(double quantile) const {
  const uint64_t all = count();
  if (all == 0) return 0.0;
  const double wanted = std::max(1.0, std::ceil(quantile * static_cast<double>(all)));
  uint64_t below = 0;
  for (size_t i = 0; i < counts_.size(); ++i) {
    below += counts_[i].load(std::memory_order_relaxed);
    if (static_cast<double>(below) >= wanted) return end_us(i);
  }
  return end_us(counts_.size() - 1);
}

void SessionCounters::step(bool degraded, int64_t queue_ns) {
  ++steps_;
  degraded_ += degraded;
  service_.steps.fetch_add(1, std::memory_order_relaxed);
  service_.degraded.fetch_add(degraded, std::memory_order_relaxed);
  service_.queue.add(queue_ns);
}

void SessionCounters::deadline(bool missed) {
  late_ += missed;
  service_.late.fetch_add(missed, std::memory_order_relaxed);
}

}  // namespace sightline
