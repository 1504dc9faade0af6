// The order in which sessions step: the scheduler's policy, without threads and without a clock.
//
// As a rule the earliest deadline goes first. That order meets all deadlines whenever they can be met (Liu & Layland,
// "Scheduling algorithms for multiprogramming in a hard-real-time environment", 1973). It is exact to within one step, because
// a step is not interrupted.
//
// After a missed deadline the order changes for kFairForNs, since by deadlines alone those who ask for most would get most.
// The client that was served least goes first then, whatever the number of its sessions. Among the sessions of one client the
// earliest deadline still goes first, unless that client missed a deadline itself: then it is its session that was served
// least. Both orders are start-time fair queueing (Goyal, Vin & Cheng, 1996; the two levels are those of their section 3 for
// hierarchical sharing). A start tag is the service that a client or session has had, but at most kClaimNs less than the largest
// start tag served so far. One that asks for less than an equal share therefore goes ahead of those that ask for more. One
// that was silent cannot save up a claim. The deadlines are tried again afterwards, because a load that fits can still be
// late in the order of service.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>

namespace sightline {

// Times are nanoseconds of one monotonic clock. Not thread-safe. Deterministic: ties go to the flow that was pushed
// first.
class DeadlineQueue {
  class Client;

 public:
  // The queue's record of one session. It must not move while it waits.
  class Flow {
   public:
    bool waits() const { return waits_; }

   private:
    friend class DeadlineQueue;
    std::shared_ptr<Client> client_;  // null until it joined or was pushed
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

  // Names the client of a flow, once and before its first push. Flows that never join belong to one client without a name.
  void join(Flow& flow, const std::string& client);
  // `flow` must not be waiting, and must live until it was popped.
  void push(Flow& flow, int64_t deadline_ns);
  // Removes and returns the flow that steps next; null when the queue is empty.
  Flow* pop(int64_t now_ns);
  // Reports the cost of a flow's step that is done; a cost <= 0 counts as none. The flow may be waiting again already.
  void charge(Flow& flow, int64_t cost_ns, int64_t now_ns);

  size_t size() const { return by_deadline_.size(); }
  bool empty() const { return by_deadline_.empty(); }
  // A deadline was missed less than kFairForNs ago: the order between clients is that of service.
  bool overloaded(int64_t now_ns) const { return now_ns < fair_until_ns_; }

 private:
  struct EarlierDeadline {
    bool operator()(const Flow* a, const Flow* b) const;
  };
  struct LessServed {
    bool operator()(const Flow* a, const Flow* b) const;
  };
  struct LessServedClient {
    bool operator()(const Client* a, const Client* b) const;
  };
  // The sessions of one client. It is in by_service_ while one of them waits.
  class Client {
   public:
    std::set<Flow*, EarlierDeadline> by_deadline;
    std::set<Flow*, LessServed> by_service;
    int64_t virtual_ns = 0;  // the largest start tag of its flows that was popped
    int64_t fair_until_ns = INT64_MIN;
    int64_t start_ns = 0, served_ns = 0;  // tags as those of a flow
    uint64_t number = 0;                  // of the push since which it waits
  };
  void insert(Flow& flow);
  void remove(Flow& flow);
  void charge(Client& client, int64_t cost_ns);
  Flow& next(int64_t now_ns) const;
  void check_deadline(const Flow& flow, int64_t deadline_ns, int64_t now_ns);

  std::map<std::string, std::weak_ptr<Client>> clients_;
  std::set<Flow*, EarlierDeadline> by_deadline_;
  std::set<Client*, LessServedClient> by_service_;
  int64_t virtual_ns_ = 0;  // the largest start tag of a client that was popped
  int64_t fair_until_ns_ = INT64_MIN;
  uint64_t pushes_ = 0;
};

}  // namespace sightline
