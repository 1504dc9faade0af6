// The order in which sessions step: the scheduler's policy, without threads and without a clock.
//
// As a rule the earliest deadline goes first. That order meets all deadlines whenever they can be met (Liu & Layland,
// "Scheduling algorithms for multiprogramming in a hard-real-time environment", 1973). It is exact to within one step, because
// a step is not interrupted.
//
// After a missed deadline the order changes for kFairForNs, since by deadlines alone the session that asks for most
// would get most. The session that was served least goes first then: start-time fair queueing (Goyal, Vin & Cheng,
// 1996). A session's start tag is the service that it has had, but at most kClaimNs less than the largest start tag
// served so far. A session that asks for less than an equal share therefore goes ahead of those that ask for more. A
// session that was silent cannot save up a claim. The deadlines are tried again afterwards, because a load that fits
// can still be late in the order of service.
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>

namespace sightline {

// Times are nanoseconds of one monotonic clock. Not thread-safe. Deterministic: ties go to the flow that was pushed
// first.
class DeadlineQueue {
 public:
  // The queue's record of one session. It must not move while it waits.
  class Flow {
   public:
    bool waits() const { return waits_; }

   private:
    friend class DeadlineQueue;
    int64_t deadline_ns_ = 0;         // of the step that it waits for
    int64_t popped_deadline_ns_ = 0;  // of the step that was popped last
    int64_t start_ns_ = 0;            // start tag of the step that it waits for
    int64_t served_ns_ = 0;           // finish tag: start tag of its last step and the cost of that step
    uint64_t number_ = 0;
    bool waits_ = false;
  };

  // Without the order of service, five times as many ticks are late in a steady overload. Without the order of deadlines,
  // loads that just fit are late.
  static constexpr int64_t kFairForNs = 1'000'000'000;
  // The time of several short steps. With 0, a third more replies of an overloaded hundred sessions are degraded
  // (tests/schedule/overload_model_test.cpp). With 100 ms, sessions whose steps became expensive went ahead of those whose
  // steps already were. When a hundred sessions walked to a corner together, half as many ticks again were late.
  static constexpr int64_t kClaimNs = 3'000'000;

  // `flow` must not be waiting, and must live until it was popped.
  void push(Flow& flow, int64_t deadline_ns);
  // Removes and returns the flow that steps next; null when the queue is empty.
  Flow* pop(int64_t now_ns);
  // Reports the cost of a flow's step that is done; a cost <= 0 counts as none. The flow may be waiting again already.
  void charge(Flow& flow, int64_t cost_ns, int64_t now_ns);

  size_t size() const { return by_deadline_.size(); }
  bool empty() const { return by_deadline_.empty(); }
  // A deadline was missed less than kFairForNs ago: the order is that of service.
  bool overloaded(int64_t now_ns) const { return now_ns < fair_until_ns_; }

 private:
  struct EarlierDeadline {
    bool operator()(const Flow* a, const Flow* b) const;
  };
  struct LessServed {
    bool operator()(const Flow* a, const Flow* b) const;
  };
  void insert(Flow& flow);
  void remove(Flow& flow);
  void check_deadline(int64_t deadline_ns, int64_t now_ns);

  std::set<Flow*, EarlierDeadline> by_deadline_;
  std::set<Flow*, LessServed> by_service_;
  int64_t virtual_ns_ = 0;  // the largest start tag that was popped
  int64_t fair_until_ns_ = INT64_MIN;
  uint64_t pushes_ = 0;
};

}  // namespace sightline
