#include "client/bench/request_log.h"

#include <algorithm>
#include <limits>

namespace sightline {

TickCounts& TickCounts::operator+=(const TickCounts& other) {
  sent += other.sent;
  answered += other.answered;
  merged += other.merged;
  rejected += other.rejected;
  lost += other.lost;
  return *this;
}

void RequestLog::sent(uint64_t sequence, int64_t due_ns, int window) {
  ++counts_.sent;
  pending_.push_back({sequence, {due_ns, window}});
}

void RequestLog::answered(uint64_t sequence, uint32_t merged, std::vector<SettledTick>& settled) {
  const auto newest = std::lower_bound(pending_.begin(), pending_.end(), sequence,
                                       [](const Pending& tick, uint64_t s) { return tick.sequence < s; });
  if (newest == pending_.end() || newest->sequence != sequence) return;
  const auto earlier = static_cast<uint64_t>(newest - pending_.begin());
  const uint64_t covered = std::min<uint64_t>(earlier, merged);
  ++counts_.answered;
  counts_.merged += covered;
  counts_.lost += earlier - covered;
  for (auto tick = pending_.begin(); tick <= newest; ++tick) settled.push_back(tick->tick);
  pending_.erase(pending_.begin(), newest + 1);
}

void RequestLog::tick_error(uint64_t sequence) {
  const auto found = std::find_if(pending_.begin(), pending_.end(),
                                  [&](const Pending& tick) { return tick.sequence == sequence; });
  if (found == pending_.end()) return;
  ++counts_.rejected;
  pending_.erase(found);
}

void RequestLog::give_up() {
  counts_.lost += pending_.size();
  pending_.clear();
}

int64_t RequestLog::oldest_pending_ns() const {
  return pending_.empty() ? std::numeric_limits<int64_t>::max() : pending_.front().tick.due_ns;
}

}  // namespace sightline
