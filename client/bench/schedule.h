// When every tick of a load is due: fixed before the first is sent, so that a slow server slows nothing down and hides nothing
// (no "coordinated omission"). A tick that cannot be sent when it is due still counts from when it was.
//
// Each session sends at the same rate; their phases are spread evenly over the tick. Time is cut into segments of a lead-in,
// which is not counted, and a window. With an echo to compare with, segments of daemon and echo take turns, and the clock of
// each stands still while the other's runs: neither ever works beside the other. Without one there is no lead-in, and windows
// follow each other without a gap.
//
// Immutable; any thread. Times are nanoseconds since the start of the load.
#pragma once

#include <cstddef>
#include <cstdint>

namespace sightline {

enum class BenchPeer { kDaemon, kEcho };

class BenchSchedule {
 public:
  struct Options {
    size_t sessions = 1;     // >= 1
    double rate_hz = 60.0;   // of each session, > 0
    double window_s = 2.0;   // > 0
    double warm_up_s = 2.0;  // >= 0; rounded up to whole windows
    bool echo = false;
  };
  explicit BenchSchedule(const Options& options);

  size_t sessions() const { return options_.sessions; }
  // Between two ticks of a session, unless the other peer's turn lies between them.
  double interval_s() const { return 1.0 / options_.rate_hz; }

  // Tick k = 0, 1, ... of a session in [0, sessions).
  int64_t due_ns(BenchPeer peer, uint64_t k, size_t session) const;
  // The window in which that tick is counted, 0 for the first after the warm-up; -1: none (warm-up or lead-in).
  int window_of(uint64_t k, size_t session) const;

  // What is counted of a window, window >= 0: ticks due in [begin, end).
  int64_t begin_ns(BenchPeer peer, int window) const;
  int64_t end_ns(BenchPeer peer, int window) const;

 private:
  struct Place {
    int64_t segment;
    int64_t ns;  // since the segment's start
  };
  Place place_of(uint64_t k, size_t session) const;
  int64_t start_ns(BenchPeer peer, int64_t segment) const;

  const Options options_;
  const int64_t lead_in_ns_, window_ns_, warm_up_segments_;
};

}  // namespace sightline
