#include "server/schedule/fair_shares.h"

#include <algorithm>

namespace sightline {

double fair_share(std::span<double> demands, double capacity) {
  std::sort(demands.begin(), demands.end());
  double left = capacity;
  for (size_t i = 0; i < demands.size(); ++i) {
    const double equal = left / static_cast<double>(demands.size() - i);
    if (demands[i] > equal) return std::max(equal, 0.0);
    left -= demands[i];
  }
  return std::numeric_limits<double>::infinity();
}

FairShares::Slot FairShares::join() {
  const std::lock_guard lock(mutex_);
  if (free_.empty()) {
    demands_.emplace_back().taken = true;
    return demands_.size() - 1;
  }
  const Slot slot = free_.back();
  free_.pop_back();
  demands_[slot] = {.taken = true};
  return slot;
}

void FairShares::leave(Slot slot) {
  const std::lock_guard lock(mutex_);
  demands_[slot].taken = false;
  free_.push_back(slot);
}

double FairShares::report(Slot slot, double demand, bool late, int64_t now_ns) {
  const std::lock_guard lock(mutex_);
  ++steps_;
  late_ += late;
  demands_[slot].threads = demand;
  demands_[slot].reported_ns = now_ns;
  if (now_ns - renewed_ns_ >= kRenewedEveryNs) renew(now_ns);
  return share_;
}

void FairShares::renew_estimate() {
  const bool many = late_ >= kLeastLate && late_ > kLateShare * steps_;
  estimate_ = many ? kDecrease * estimate_ : std::min(estimate_ + kIncrease, 1.0);
  steps_ = late_ = 0;
}

void FairShares::renew(int64_t now_ns) {
  renew_estimate();
  scratch_.clear();
  for (const Demand& demand : demands_)
    if (demand.taken && demand.threads > 0 && now_ns - demand.reported_ns < kForgottenAfterNs)
      scratch_.push_back(demand.threads);
  share_ = fair_share(scratch_, estimate_ * capacity_);
  renewed_ns_ = now_ns;
}

}  // namespace sightline
