// Counters of the service since its start, and of one session. Counting takes no locks.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace sightline {

// A histogram of durations: eight classes an octave from 1 us to over an hour, so a quantile is exact to 9 %.
// Thread-safe. A duration that is added while a quantile is read may be missing from it.
class DurationCounts {
 public:
  void add(int64_t duration_ns);
  // The duration that a share `quantile`, [0, 1], of all durations do not exceed, in microseconds: the upper end of its
  // class. 0 while nothing is counted.
  double quantile_us(double quantile) const;
  uint64_t count() const;

 private:
  static constexpr int kClassesPerOctave = 8, kOctaves = 32;
  static size_t class_of(int64_t duration_ns);
  static double end_us(size_t index);

  std::array<std::atomic<uint64_t>, kClassesPerOctave * kOctaves> counts_{};
};

// The counters of all sessions together. Thread-safe.
struct StepStats {
  std::atomic<uint64_t> steps{0};
  std::atomic<uint64_t> degraded{0};  // steps with something left out
  std::atomic<uint64_t> late{0};      // steps done after their deadline
  DurationCounts queue;               // from the arrival of the tick to the start of the step
};

// The counters of one session; its steps count for the service as well. Not thread-safe.
class SessionCounters {
 public:
  explicit SessionCounters(StepStats& service) : service_(service) {}

  void tick() { ++ticks_; }
  void rejection() { ++rejections_; }
  void step(bool degraded, int64_t queue_ns);
  // Called after `step`, when the reply is on its way.
  void deadline(bool missed);

  uint64_t ticks() const { return ticks_; }
  uint64_t rejections() const { return rejections_; }
  uint64_t steps() const { return steps_; }
  uint64_t degraded() const { return degraded_; }
  uint64_t late() const { return late_; }

 private:
  StepStats& service_;
  uint64_t ticks_ = 0, rejections_ = 0, steps_ = 0, degraded_ = 0, late_ = 0;
};

}  // namespace sightline
