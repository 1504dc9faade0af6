// What the service has done since its start, counted as cheaply as can be.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

namespace sightline {

// Durations by size: eight classes an octave from 1 us to over an hour, so that a quantile is exact to 9 %.
// Thread-safe, without locks: what is counted while a quantile is read may be in it or not.
class DurationCounts {
 public:
  void add(int64_t duration_ns);
  // The least duration that a share `quantile`, [0, 1], of those counted do not exceed, as the upper end of its class,
  // microseconds; 0 while there is none.
  double quantile_us(double quantile) const;
  uint64_t count() const;

 private:
  static constexpr int kClassesPerOctave = 8, kOctaves = 32;
  static size_t class_of(int64_t duration_ns);
  static double end_us(size_t index);

  std::array<std::atomic<uint64_t>, kClassesPerOctave * kOctaves> counts_{};
};

// Thread-safe.
struct StepStats {
  std::atomic<uint64_t> steps{0};
  std::atomic<uint64_t> degraded{0};  // with something left out
  std::atomic<uint64_t> late{0};      // done after their deadline
  DurationCounts queue;               // from the arrival of the tick to the start of the step
};

}  // namespace sightline
