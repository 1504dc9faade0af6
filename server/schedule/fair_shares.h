// How much of the threads' time each session may use.
//
// While all demands fit, there is no limit. Otherwise every client gets an equal share, and what a client with a
// smaller demand leaves over goes to the others (max-min fairness; Bertsekas & Gallager, "Data Networks", 1992, 6.5.2).
// The share of a client is divided among its sessions in the same way. More sessions do not give a client more time.
//
// The time that can be shared out is not known in advance, because the transport and other processes use the same CPUs.
// It is estimated: while steps are late the estimate shrinks by a factor, otherwise it grows by a constant (additive
// increase, multiplicative decrease; Chiu & Jain, "Analysis of the increase and decrease algorithms for congestion
// avoidance in computer networks", 1989). A client that asks for more than an equal part of all time, beside others,
// has an estimate of its own: its late steps are no reason to give others less.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "server/base/mutex.h"

namespace sightline {

// The limit s at which the sum of min(demand, s) equals `capacity`; infinity when the demands fit. No demand may be
// negative. Sorts the demands.
double fair_share(std::span<double> demands, double capacity);

// Demands and shares are in threads: 0.25 is a quarter of one thread's time. Thread-safe.
class FairShares {
 public:
  using Slot = size_t;
  static constexpr int64_t kRenewedEveryNs = 100'000'000;      // period of the estimate and of the share
  static constexpr int64_t kForgottenAfterNs = 1'000'000'000;  // a demand that is not reported again counts for so long
  // A renewal shrinks an estimate to kDecrease of itself when more than kLateShare of the steps since the last one were
  // late, and at least kLeastLate of them. Otherwise the estimate grows by kIncrease of the capacity, up to all of it.
  // Without an estimate, a hundred sessions whose steps alone fit the threads are late in one tick of ten
  // (tests/schedule/overload_model_test.cpp). With kLeastLate = 1, a stall of the machine each second degrades a sixth
  // of the steps of twenty sessions. kLateShare makes no difference on two CPUs. With many CPUs there are thousands of
  // steps in a renewal, and three late ones must not shrink the estimate.
  static constexpr double kLateShare = 0.01, kDecrease = 0.9, kIncrease = 0.004;
  static constexpr int kLeastLate = 3;

  // `capacity`, in threads, is the time to share out when nothing else runs.
  explicit FairShares(double capacity) : capacity_(capacity) {}

  // Adds a session of this client.
  Slot join(const std::string& client);
  void leave(Slot slot);
  // Called after each step with the demand of the session at `slot` (what it would use at quality level 0), and
  // whether the step was late. Returns the session's share. `now_ns` never goes back by much.
  double report(Slot slot, double demand, bool late, int64_t now_ns);

 private:
  // A share of capacity_, and the steps since the last renewal that it is renewed by.
  struct Estimate {
    double share = 1.0;
    int steps = 0, late = 0;
    void count(bool was_late) { ++steps, late += was_late; }
    void renew();
  };
  struct Demand {
    size_t client = 0;  // in clients_
    double threads = 0.0;
    int64_t reported_ns = 0;
    bool taken = false;
  };
  struct Client {
    std::string name;
    size_t sessions = 0;   // 0: the place is free
    double threads = 0.0;  // demand of its sessions together, at the last renewal
    bool greedy = false;   // it asked for more than an equal part of the capacity, beside others
    Estimate estimate;     // used while it is greedy
    double share = std::numeric_limits<double>::infinity();  // of each of its sessions
  };
  size_t place_of(const std::string& client) NEEDS(mutex_);
  bool counts(const Demand& demand, int64_t now_ns) const NEEDS(mutex_);
  void renew(int64_t now_ns) NEEDS(mutex_);
  double sum_demands(int64_t now_ns) NEEDS(mutex_);
  double share_within(size_t client, double room, int64_t now_ns) NEEDS(mutex_);

  const double capacity_;
  Mutex mutex_;
  Estimate estimate_ GUARDED(mutex_);  // of all clients that are not greedy
  std::vector<Demand> demands_ GUARDED(mutex_);
  std::vector<Slot> free_ GUARDED(mutex_);
  std::vector<Client> clients_ GUARDED(mutex_);
  std::vector<double> scratch_ GUARDED(mutex_);
  int64_t renewed_ns_ GUARDED(mutex_) = std::numeric_limits<int64_t>::min() / 2;
};

}  // namespace sightline
