// Counters of the service since its start, and of one session. Counting takes no locks.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "server/schedule/limit_counts.h"
#include "server/step/quality_level.h"
#include "server/step/step.h"

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
  // Sum of all durations, in seconds. What is longer than an hour counts as an hour.
  double sum_s() const { return static_cast<double>(sum_ns_.load(std::memory_order_relaxed)) * 1e-9; }

  static constexpr int kOctaves = 32;
  // Element k: the number of durations of at most 2^k us that are longer than 2^(k - 1) us. Element 0 counts all up to
  // 1 us, and the last element also everything longer.
  std::array<uint64_t, kOctaves> by_octave() const;

 private:
  static constexpr int kClassesPerOctave = 8;
  static constexpr int64_t kLongestNs = 3'600'000'000'000;
  static size_t class_of(int64_t duration_ns);
  static double end_us(size_t index);

  std::array<std::atomic<uint64_t>, kClassesPerOctave * kOctaves> counts_{};
  std::atomic<int64_t> sum_ns_{0};
};

inline constexpr size_t kQualityLevels = static_cast<size_t>(kLowestQualityLevel) + 1;
// The stages whose times are counted: the update of the mirror, then those of the step (enum Stage).
inline constexpr std::array<const char*, kStageCount + 1> kStageNames{"scene", "bound", "sample", "aggregate", "move"};

// The counters of all sessions together. Thread-safe.
struct StepStats {
  std::atomic<uint64_t> steps{0};
  std::atomic<uint64_t> degraded{0};  // steps with something left out
  std::atomic<uint64_t> late{0};      // steps done after their deadline
  DurationCounts queue;               // from the arrival of the tick to the start of the step
  DurationCounts tick_age;            // from the arrival of the tick to its reply
  DurationCounts step;                // the sum of the stages
  std::array<DurationCounts, kStageNames.size()> stages;
  std::array<std::atomic<uint64_t>, kQualityLevels> steps_at_level{};
  // A tick is answered by a step, merged into the step of a later one, or refused.
  std::atomic<uint64_t> ticks{0}, merged{0}, refused{0};
  std::atomic<uint64_t> opened{0};  // sessions
  std::atomic<uint64_t> open_refused{0};
  std::array<std::atomic<uint64_t>, 17> closed{};  // sessions, by the code of their status in gRPC
  std::array<std::atomic<int64_t>, kQualityLevels> sessions_at_level{};  // now
  std::atomic<uint64_t> kept{0};  // sessions now that have no stream and wait for another one
  // Kept sessions that went on in another stream, and those that ended because none came in time. Streams that wanted a
  // session which was not kept, or not their client's.
  std::atomic<uint64_t> resumed{0}, resume_expired{0}, resume_refused{0};
  LimitCounts limits;
};

// The figures of one step.
struct StepFigures {
  bool degraded = false;  // something was left out
  int quality_level = 0;
  uint64_t merged_ticks = 0;             // that it answers in addition to its own
  int64_t arrival_ns = 0, reply_ns = 0;  // of its tick and of its reply, by the same clock; arrival 0: not known
  int64_t queue_ns = 0, scene_ns = 0;
  std::array<int64_t, kStageCount> stage_ns{};
};

// The counters of one session, which count for the service as well. Not thread-safe.
class SessionCounters {
 public:
  explicit SessionCounters(StepStats& service) : service_(service) {}
  // The session is over if it was opened.
  ~SessionCounters() { at_level(-1); }
  SessionCounters(const SessionCounters&) = delete;
  SessionCounters& operator=(const SessionCounters&) = delete;

  void opened();
  void open_refused();
  // `status_code` is gRPC's.
  void closed(int status_code);
  void tick();
  void rejection();
  void step(const StepFigures& step);
  // Called after `step`, when the reply is on its way.
  void deadline(bool missed);
  // The quality level of the session's next step; -1: there is none.
  void at_level(int level);
  // A limit refused something of this session, or ended it.
  void hit(Limit limit) { service_.limits.hit(limit); }

  uint64_t ticks() const { return ticks_; }
  uint64_t rejections() const { return rejections_; }
  uint64_t steps() const { return steps_; }
  uint64_t degraded() const { return degraded_; }
  uint64_t late() const { return late_; }

 private:
  StepStats& service_;
  int level_ = -1;
  uint64_t ticks_ = 0, rejections_ = 0, steps_ = 0, degraded_ = 0, late_ = 0;
};

}  // namespace sightline
