// The order in which sessions step: the scheduler's policy, without threads and without a clock.
//
// As a rule the earliest deadline goes first. That order meets all deadlines whenever they can be met (Liu & Layland,
// "Scheduling algorithms for multiprogramming in a hard-real-time environment", 1973). It is exact to within one step,
// because a step is not interrupted.
//
// After a missed deadline the order changes for kFairForNs, since by deadlines alone those who ask for most would get
// most. The client that was served least goes first then, whatever the number of its sessions. Among the sessions of
// one client the earliest deadline still goes first, unless that client missed a deadline itself: then it is its
// session that was served least. Both orders are start-time fair queueing (Goyal, Vin & Cheng, 1996; the two levels are
// those of their section 3 for hierarchical sharing). A start tag is the service that a client or session has had, but
// at most kClaimNs less than the largest start tag served so far. One that asks for less than an equal share therefore
// goes ahead of those that ask for more. One that was silent cannot save up a claim. The deadlines are tried again
// afterwards, because a load that fits can still be late in the order of service.
//
// No order helps against steps that are under way, since they are not interrupted. So clients with long steps never
// take all threads together while a client with short ones steps: one thread is left for those. Where all have long
// steps, none of them takes all threads while another steps. How long a step takes is known only afterwards. So a
// client counts as one with long steps for kLongForNs after each, or kLongTimes as long as the step took, and until its
// first step is done. So does one with a step that may be far longer than those before.
//
// A thread that also does other work (Scheduler::try_run_now) must not be held up by a long step. A client that held
// one up steps only on threads of the scheduler for kApart times as long as that step took.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace sightline {

// Times are nanoseconds of one monotonic clock. Not thread-safe. Deterministic: ties go to the flow that was pushed
// first.
class DeadlineQueue {
  class Client;

 public:
  // A tick at 60 Hz: nobody waits longer for a shorter step.
  static constexpr int64_t kLongStepNs = 16'666'667;

  // The queue's record of one session. It must not move while it waits.
  class Flow {
   public:
    bool waits() const { return waits_; }

   private:
    friend class DeadlineQueue;
    std::shared_ptr<Client> client_;  // null until it joined or was pushed
    int64_t deadline_ns_ = 0;         // of the step that it waits for
    int64_t popped_deadline_ns_ = 0;  // of the step that was popped last
    bool may_be_long_ = false;        // the step that it waits for
    int64_t start_ns_ = 0;            // start tag of the step that it waits for
    int64_t served_ns_ = 0;           // finish tag: start tag of its last step and the cost of that step
    uint64_t number_ = 0;
    bool waits_ = false;
  };

  // Without the order of service, five times as many ticks are late in a steady overload. Without the order of
  // deadlines, loads that just fit are late.
  static constexpr int64_t kFairForNs = 1'000'000'000;
  // The time of several short steps. With 0, a third more replies of an overloaded hundred sessions are degraded
  // (tests/schedule/overload_model_test.cpp). With 100 ms, sessions whose steps became expensive went ahead of those
  // whose steps already were. When a hundred sessions walked to a corner together, half as many ticks again were late.
  static constexpr int64_t kClaimNs = 3'000'000;

  // A client counts as stepping for this time after its last step.
  static constexpr int64_t kActiveForNs = 1'000'000'000;
  // Then one that has a long step whenever it no longer counts delays less than a hundredth of the ticks of others.
  static constexpr int64_t kLongForNs = 5'000'000'000, kLongTimes = 200;
  // With 100, a client whose steps hold up an event loop would delay every hundredth tick of the others.
  static constexpr int64_t kApart = 500;

  // `threads` pop at the same time, each one flow. With one thread nothing is held, since none can be left to the
  // others.
  explicit DeadlineQueue(size_t threads = 1) : most_long_(threads > 1 ? threads - 1 : SIZE_MAX) {}

  // Names the client of a flow, once and before its first push. Flows that never join belong to one client without a
  // name. A client is remembered after its last flow for as long as its long steps count.
  void join(Flow& flow, const std::string& client);
  // `flow` must not be waiting, and must live until it was popped. `may_be_long`: the steps before say nothing of this
  // one.
  void push(Flow& flow, int64_t deadline_ns, bool may_be_long = false);
  // Removes and returns the flow that steps next; null when the queue is empty, or when all that wait are held: their
  // clients have long steps, and they would take the last thread.
  Flow* pop(int64_t now_ns);
  // Removes a flow that waits, whatever the order.
  void take(Flow& flow, int64_t now_ns);
  // `pop` would return a flow.
  bool ready(int64_t now_ns) const { return !empty() && next(now_ns) != nullptr; }
  // Reports the processor time of a flow's step on a thread with other work.
  void note_elsewhere(Flow& flow, int64_t busy_ns, int64_t now_ns);
  // The flow may not step on a thread with other work.
  bool apart(const Flow& flow, int64_t now_ns) const { return flow.client_ && now_ns < flow.client_->apart_until_ns; }
  // No flow is held from now on.
  void hold_none() { most_long_ = SIZE_MAX; }
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
    int64_t long_until_ns = INT64_MAX;    // it counts as a client with long steps; INT64_MAX before its first step
    size_t may_be_long = 0;               // of its flows that wait
    int64_t apart_until_ns = INT64_MIN;   // it steps on threads of the scheduler only
    uint64_t number = 0;                  // of the push since which it waits

    bool has_long_steps(int64_t now_ns) const {
      return (long_until_ns != INT64_MAX && now_ns < long_until_ns) || now_ns < apart_until_ns;
    }
  };
  // When steps were popped last.
  class Newest {
   public:
    void note(const Client& client, int64_t now_ns) {
      if (client_ != &client) others_ns_ = ns_;
      client_ = &client;
      ns_ = now_ns;
    }
    // Whether a client beside this one counts as stepping.
    bool beside(const Client& client, int64_t now_ns) const {
      return now_ns - (client_ == &client ? others_ns_ : ns_) < kActiveForNs;
    }

   private:
    const Client* client_ = nullptr;  // of the newest step; it may be gone
    int64_t ns_ = INT64_MIN / 2;
    int64_t others_ns_ = INT64_MIN / 2;  // of the newest step of any other client
  };
  void insert(Flow& flow);
  void remove(Flow& flow);
  void charge(Client& client, int64_t cost_ns);
  Flow* next(int64_t now_ns) const;
  bool held(const Client& client, int64_t now_ns) const;
  void note_step(Client& client, bool may_be_long, int64_t now_ns);
  void note_cost(Client& client, int64_t cost_ns, int64_t now_ns);
  void check_deadline(const Flow& flow, int64_t deadline_ns, int64_t now_ns);

  std::map<std::string, std::shared_ptr<Client>> clients_;
  std::set<Flow*, EarlierDeadline> by_deadline_;
  std::set<Client*, LessServedClient> by_service_;
  int64_t virtual_ns_ = 0;  // the largest start tag of a client that was popped
  int64_t fair_until_ns_ = INT64_MIN;
  uint64_t pushes_ = 0;
  int64_t charged_ns_ = INT64_MIN;  // when a step was charged last
  size_t most_long_;                // steps of clients with long ones at the same time, while others step
  // Each step that was popped and not charged so far. One of a client with long steps counts as long until it is done.
  struct Stepping {
    const Client* client = nullptr;
    bool is_long = false;
  };
  std::vector<Stepping> stepping_;
  Newest step_, short_step_;  // of all clients, and of those with short steps
};

}  // namespace sightline
