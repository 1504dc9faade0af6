// How much of the threads' time each session may use: all that it asks for while everybody's fits, else an equal share,
// of which whoever asks for less leaves the rest to the others (max-min fairness; Bertsekas & Gallager, "Data
// Networks", 1992, 6.5.2).
//
// How much there is to share is found out: what moves messages and whatever else runs on the machine takes its part of the CPUs too.
// While steps come late there is less than was thought; once none does, a little more is tried (additive increase, multiplicative
// decrease; Chiu & Jain, "Analysis of the increase and decrease algorithms for congestion avoidance in computer networks", 1989).
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <mutex>
#include <span>
#include <vector>

namespace sightline {

// The level s at which the sum of min(demand, s) is `capacity`; infinity when the demands, none negative, fit. Reorders
// them.
double fair_share(std::span<double> demands, double capacity);

// Demands and shares are in threads: 0.25 is a quarter of one thread's time. Thread-safe.
class FairShares {
 public:
  using Slot = size_t;
  static constexpr int64_t kRenewedEveryNs = 100'000'000;      // the share
  static constexpr int64_t kForgottenAfterNs = 1'000'000'000;  // a demand that is not told again
  // Each renewal, with this share of the steps late since the last one (and no fewer than kLeastLate), what there is counts for so
  // much less; with fewer, for so much of the capacity more. It is never less than kLeastThere of the capacity.
  static constexpr double kLateShare = 0.01, kLess = 0.9, kMore = 0.004, kLeastThere = 0.2;
  static constexpr int kLeastLate = 3;

  // `capacity`, in threads: what there is when nothing else runs.
  explicit FairShares(double capacity) : capacity_(capacity) {}

  Slot join();
  void leave(Slot slot);
  // After a step: what the one at `slot` would use with nothing left out, whether the step came late, and in return the share. Times
  // never go back by much.
  double tell(Slot slot, double demand, bool late, int64_t now_ns);

 private:
  struct Demand {
    double threads = 0.0;
    int64_t told_ns = 0;
    bool taken = false;
  };
  void renew(int64_t now_ns);

  void find_out();

  const double capacity_;
  std::mutex mutex_;
  // Guarded by mutex_.
  double there_ = 1.0;      // of capacity_
  int steps_ = 0, late_ = 0;  // since the last renewal
  std::vector<Demand> demands_;
  std::vector<Slot> free_;
  std::vector<double> scratch_;
  double share_ = std::numeric_limits<double>::infinity();
  int64_t renewed_ns_ = std::numeric_limits<int64_t>::min() / 2;
};

}  // namespace sightline
