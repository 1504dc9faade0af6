#include "server/schedule/fair_shares.h"

#include <algorithm>
#include <cmath>

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

void FairShares::Estimate::renew() {
  const bool many = late >= kLeastLate && late > kLateShare * steps;
  share = many ? kDecrease * share : std::min(share + kIncrease, 1.0);
  steps = late = 0;
}

size_t FairShares::place_of(const std::string& client) {
  size_t free = clients_.size();
  for (size_t i = 0; i < clients_.size(); ++i) {
    if (clients_[i].sessions == 0)
      free = i;
    else if (clients_[i].name == client)
      return i;
  }
  if (free == clients_.size()) clients_.emplace_back();
  clients_[free] = Client();
  clients_[free].name = client;
  return free;
}

FairShares::Slot FairShares::join(const std::string& client) {
  const MutexLock lock(mutex_);
  const size_t place = place_of(client);
  ++clients_[place].sessions;
  if (free_.empty()) {
    demands_.push_back({.client = place, .taken = true});
    return demands_.size() - 1;
  }
  const Slot slot = free_.back();
  free_.pop_back();
  demands_[slot] = {.client = place, .taken = true};
  return slot;
}

void FairShares::leave(Slot slot) {
  const MutexLock lock(mutex_);
  demands_[slot].taken = false;
  --clients_[demands_[slot].client].sessions;
  free_.push_back(slot);
}

double FairShares::report(Slot slot, double demand, bool late, int64_t now_ns) {
  const MutexLock lock(mutex_);
  Client& client = clients_[demands_[slot].client];
  (client.greedy ? client.estimate : estimate_).count(late);
  demands_[slot].threads = demand;
  demands_[slot].reported_ns = now_ns;
  if (now_ns - renewed_ns_ >= kRenewedEveryNs) renew(now_ns);
  return client.share;
}

bool FairShares::counts(const Demand& demand, int64_t now_ns) const {
  return demand.taken && demand.threads > 0 && now_ns - demand.reported_ns < kForgottenAfterNs;
}

void FairShares::renew(int64_t now_ns) {
  estimate_.renew();
  const double sum = sum_demands(now_ns);
  scratch_.clear();
  for (const Client& client : clients_)
    if (client.threads > 0) scratch_.push_back(client.threads);
  const double level = fair_share(scratch_, capacity_);
  for (size_t i = 0; i < clients_.size(); ++i) {
    Client& client = clients_[i];
    client.estimate.renew();
    const double most = std::isinf(level) ? capacity_ - sum + client.threads : level;
    const double room = most * (client.greedy ? client.estimate : estimate_).share;
    client.share = client.threads > room ? share_within(i, room, now_ns) : std::numeric_limits<double>::infinity();
  }
  renewed_ns_ = now_ns;
}

double FairShares::sum_demands(int64_t now_ns) {
  for (Client& client : clients_) client.threads = 0.0;
  double sum = 0.0;
  for (const Demand& demand : demands_) {
    if (!counts(demand, now_ns)) continue;
    clients_[demand.client].threads += demand.threads;
    sum += demand.threads;
  }
  const auto active = std::count_if(clients_.begin(), clients_.end(),
                                    [](const Client& client) { return client.threads > 0; });
  for (Client& client : clients_)
    client.greedy = active > 1 && client.threads > capacity_ / static_cast<double>(active);
  return sum;
}

double FairShares::share_within(size_t client, double room, int64_t now_ns) {
  scratch_.clear();
  for (const Demand& demand : demands_)
    if (demand.client == client && counts(demand, now_ns)) scratch_.push_back(demand.threads);
  return fair_share(scratch_, room);
}

}  // namespace sightline
