#include "server/schedule/step_stats.h"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

void count(std::atomic<uint64_t>& counter, uint64_t more = 1) {
  counter.fetch_add(more, std::memory_order_relaxed);
}

}  // namespace

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
  sum_ns_.fetch_add(std::clamp<int64_t>(duration_ns, 0, kLongestNs), std::memory_order_relaxed);
}

uint64_t DurationCounts::count() const {
  uint64_t count = 0;
  for (const auto& of_class : counts_) count += of_class.load(std::memory_order_relaxed);
  return count;
}

// Octave 0 is class 0 alone; octave k > 0 is the classes 8 (k - 1) + 1 to 8 k.
std::array<uint64_t, DurationCounts::kOctaves> DurationCounts::by_octave() const {
  std::array<uint64_t, kOctaves> counts{};
  for (size_t i = 0; i < counts_.size(); ++i) {
    const size_t octave = std::min<size_t>((i + kClassesPerOctave - 1) / kClassesPerOctave, kOctaves - 1);
    counts[octave] += counts_[i].load(std::memory_order_relaxed);
  }
  return counts;
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

void SessionCounters::opened() {
  count(service_.opened);
  at_level(0);
}

void SessionCounters::open_refused() {
  count(service_.open_refused);
}

void SessionCounters::closed(int status_code) {
  const auto last = static_cast<int>(service_.closed.size()) - 1;
  count(service_.closed[static_cast<size_t>(std::clamp(status_code, 0, last))]);
  at_level(-1);
}

void SessionCounters::tick() {
  ++ticks_;
  count(service_.ticks);
}

void SessionCounters::rejection() {
  ++rejections_;
  count(service_.refused);
}

void SessionCounters::step(const StepFigures& step) {
  ++steps_;
  degraded_ += step.degraded;
  count(service_.steps);
  count(service_.degraded, step.degraded);
  count(service_.merged, step.merged_ticks);
  count(service_.steps_at_level[static_cast<size_t>(std::clamp(step.quality_level, 0, kLowestQualityLevel))]);
  service_.queue.add(step.queue_ns);
  if (step.arrival_ns > 0) service_.tick_age.add(step.reply_ns - step.arrival_ns);
  service_.stages[0].add(step.scene_ns);
  int64_t whole_ns = step.scene_ns;
  for (size_t stage = 0; stage < kStageCount; ++stage) {
    service_.stages[stage + 1].add(step.stage_ns[stage]);
    whole_ns += step.stage_ns[stage];
  }
  service_.step.add(whole_ns);
}

void SessionCounters::deadline(bool missed) {
  late_ += missed;
  count(service_.late, missed);
}

void SessionCounters::at_level(int level) {
  if (level == level_) return;
  if (level_ >= 0) service_.sessions_at_level[static_cast<size_t>(level_)].fetch_sub(1, std::memory_order_relaxed);
  if (level >= 0) service_.sessions_at_level[static_cast<size_t>(level)].fetch_add(1, std::memory_order_relaxed);
  level_ = level;
}

}  // namespace sightline
