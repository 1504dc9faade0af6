// How much of the threads' time each session may use: all that it asks for while everybody's fits, else an equal share, of which
// whoever asks for less leaves the rest to the others (max-min fairness; Bertsekas & Gallager, "Data Networks", 1992, 6.5.2).
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <mutex>
#include <span>
#include <vector>

namespace sightline {

// The level s at which the sum of min(demand, s) is `capacity`; infinity when the demands, none negative, fit. Reorders them.
double fair_share(std::span<double> demands, double capacity);

// Demands and shares are in threads: 0.25 is a quarter of one thread's time. Thread-safe.
class FairShares {
 public:
  using Slot = size_t;
  static constexpr int64_t kRenewedEveryNs = 100'000'000;  // the share
  static constexpr int64_t kForgottenAfterNs = 1'000'000'000;  // a demand that is not told again

  explicit FairShares(double capacity) : capacity_(capacity) {}

  Slot join();
  void leave(Slot slot);
  // What the one at `slot` would use with nothing left out, and in return the share. Times never go back by much.
  double tell(Slot slot, double demand, int64_t now_ns);

 private:
  struct Demand {
    double threads = 0.0;
    int64_t told_ns = 0;
    bool taken = false;
  };
  void renew(int64_t now_ns);

  const double capacity_;
  std::mutex mutex_;
  // Guarded by mutex_.
  std::vector<Demand> demands_;
  std::vector<Slot> free_;
  std::vector<double> scratch_;
  double share_ = std::numeric_limits<double>::infinity();
  int64_t renewed_ns_ = std::numeric_limits<int64_t>::min() / 2;
};

}  // namespace sightline
