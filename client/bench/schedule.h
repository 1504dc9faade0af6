// When every tick of a load is due. All due times are fixed before the first tick is sent, so a slow server neither
// slows the load down nor hides its delay (no "coordinated omission"). A tick that cannot be sent in time still counts
// from its due time.
//
// Every session sends at the same rate; the phases of the sessions are spread evenly over the tick. Time is cut into
// segments: a lead-in, which is not counted, and a window. When an echo is measured too, segments of daemon and echo
// alternate, and the clock of each stands still during the other's turn. The two never work at the same time. Without
// an echo there is no lead-in and windows follow each other without a gap.
//
// Immutable; may be used by any thread. Times are nanoseconds since the start of the load.
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

  // Time between two ticks of a session, apart from the other peer's turns.
  double interval_s() const { return 1.0 / options_.rate_hz; }

  // When tick k = 0, 1, ... of a session in [0, sessions) is due.
  int64_t due_ns(BenchPeer peer, uint64_t k, size_t session) const;
  // The window in which that tick counts: 0 is the first after the warm-up, -1 means none (warm-up or lead-in).
  int window_of(uint64_t k, size_t session) const;

  // A window counts the ticks that are due in [begin, end).
  int64_t begin_ns(BenchPeer peer, int window) const;
  int64_t end_ns(BenchPeer peer, int window) const;

 private:
  struct Position {
    int64_t segment;
    int64_t ns;  // since the segment's start
  };
  Position position_of(uint64_t k, size_t session) const;
  int64_t start_ns(BenchPeer peer, int64_t segment) const;

  const Options options_;
  const int64_t lead_in_ns_, window_ns_, warm_up_segments_;
};

}  // namespace sightline
