// Records the outcome of every tick of one session. A reply settles the ticks that it covers; each tick counts from the
// time at which it was due.
#pragma once

#include <cstdint>
#include <deque>
#include <vector>

namespace sightline {

// sent = answered + merged + rejected + lost + still pending.
struct TickCounts {
  uint64_t sent = 0;
  uint64_t answered = 0;  // the newest tick of a reply
  uint64_t merged = 0;    // an earlier tick that a reply covers, by the reply's own count
  uint64_t rejected = 0;
  uint64_t lost = 0;  // skipped by the server, or never answered

  TickCounts& operator+=(const TickCounts& other);
};

// A tick that a reply settled.
struct SettledTick {
  int64_t due_ns = 0;
  int window = -1;  // the window in which it counts; -1: none
};

// Not thread-safe. Holds the pending ticks: as many as the server is behind.
class RequestLog {
 public:
  // Sequences must increase.
  void sent(uint64_t sequence, int64_t due_ns, int window);
  // A reply whose newest tick is `sequence`, and which covers `merged` earlier ticks. Appends every pending tick up to
  // `sequence` to `settled`, the newest last; those beyond what the reply covers count as lost. Does nothing when the
  // tick is not pending.
  void answered(uint64_t sequence, uint32_t merged, std::vector<SettledTick>& settled);
  void tick_error(uint64_t sequence);
  // Counts all pending ticks as lost.
  void give_up();

  // The due time of the oldest pending tick; INT64_MAX when none is pending.
  int64_t oldest_pending_ns() const;
  const TickCounts& counts() const { return counts_; }

 private:
  struct Pending {
    uint64_t sequence;
    SettledTick tick;
  };
  std::deque<Pending> pending_;
  TickCounts counts_;
};

}  // namespace sightline
