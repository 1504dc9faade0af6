// What became of every tick of one session. Ticks are settled by what the server says, in whatever order they were sent late,
// merged or refused; each counts from the time at which it was due.
#pragma once

#include <cstdint>
#include <deque>
#include <vector>

namespace sightline {

// sent = answered + merged + rejected + lost + still pending.
struct TickCounts {
  uint64_t sent = 0;
  uint64_t answered = 0;  // the newest tick of a reply
  uint64_t merged = 0;    // an earlier one that a reply covers, by the reply's own count
  uint64_t rejected = 0;
  uint64_t lost = 0;  // the server went on without it, or never said anything

  TickCounts& operator+=(const TickCounts& other);
};

// A tick that a reply covers, answered or merged.
struct SettledTick {
  int64_t due_ns = 0;
  int window = -1;
};

// Not thread-safe. Holds what is pending: as many ticks as the server is behind.
class TickLedger {
 public:
  // Sequences increase.
  void sent(uint64_t sequence, int64_t due_ns, int window);
  // A reply whose newest tick is `sequence` and which says that it covers `merged` earlier ones. Appends every pending tick up
  // to `sequence`, the newest last; those beyond what the reply covers are lost. Nothing when the tick is not pending.
  void answered(uint64_t sequence, uint32_t merged, std::vector<SettledTick>& settled);
  void tick_error(uint64_t sequence);
  // Whatever is pending will not be answered any more.
  void give_up();

  // When the oldest pending tick was due; INT64_MAX when none is.
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
