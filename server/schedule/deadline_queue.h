// Who steps next: the policy of the scheduler, without threads and without a clock.
//
// Earliest deadline first, which meets all deadlines whenever that can be done (Liu & Layland, "Scheduling algorithms
// for multiprogramming in a hard-real-time environment", 1973; to within one step, since a step is not interrupted).
// Once one was missed they cannot all be met, and by deadlines alone whoever asks for most would get most. Then, for
// kFairForNs, the flow that was served least goes first: start-time fair queueing (Goyal, Vin & Cheng, 1996). A flow's
// start tag is the service that it has had, but no more than kClaimNs less than those that were served last: whoever
// asks for less than an equal share goes ahead of whoever asks for more, and nobody saves up a larger claim by asking
// for little. After that the deadlines are tried again: what fits may still be late by the order of service.
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>

namespace sightline {

// Times are nanoseconds of one monotonic clock. Not thread-safe. Deterministic: of equals, who was pushed first.
class DeadlineQueue {
 public:
  // What the queue keeps of one who asks for steps. Must not move while it waits.
  class Flow {
   public:
    bool waits() const { return waits_; }
    int64_t deadline_ns() const { return deadline_ns_; }  // of what it waits for, or last waited for

   private:
    friend class DeadlineQueue;
    int64_t deadline_ns_ = 0;
    int64_t popped_deadline_ns_ = 0;
    int64_t start_ns_ = 0;   // start tag of what it waits for
    int64_t served_ns_ = 0;  // finish tag: the start tag of its last step and what that has cost
    uint64_t number_ = 0;
    bool waits_ = false;
  };

  static constexpr int64_t kFairForNs = 1'000'000'000;
  // Some short steps. Whoever becomes dear goes ahead of whoever already was until it has used up its claim: with 100 ms, as
  // a hundred sessions walked to a corner together, those that came first waited for seconds and half as many ticks again were late.
  static constexpr int64_t kClaimNs = 3'000'000;

  // `flow` must not wait, and must live until it was popped.
  void push(Flow& flow, int64_t deadline_ns);
  // Whose turn it is; null when nobody waits.
  Flow* pop(int64_t now_ns);
  // The flow's step is done, and what it has cost; the flow may wait again meanwhile. A cost of 0 or less is none.
  void charge(Flow& flow, int64_t cost_ns, int64_t now_ns);

  size_t size() const { return by_deadline_.size(); }
  bool empty() const { return by_deadline_.empty(); }
  // A deadline was missed lately: turns go by service.
  bool overloaded(int64_t now_ns) const { return now_ns < fair_until_ns_; }

 private:
  struct Sooner {
    bool operator()(const Flow* a, const Flow* b) const;
  };
  struct LessServed {
    bool operator()(const Flow* a, const Flow* b) const;
  };
  void insert(Flow& flow);
  void take_out(Flow& flow);
  void look_at(int64_t deadline_ns, int64_t now_ns);

  std::set<Flow*, Sooner> by_deadline_;
  std::set<Flow*, LessServed> by_service_;
  int64_t virtual_ns_ = 0;  // the greatest start tag that was popped
  int64_t fair_until_ns_ = INT64_MIN;
  uint64_t pushes_ = 0;
};

}  // namespace sightline
