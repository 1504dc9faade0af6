// Lets events pass at a rate, and a burst of them at once.
#pragma once

#include <algorithm>

namespace sightline {

// Not thread-safe.
class TokenBucket {
 public:
  // `burst` events at once, `per_s` each second in the long run.
  TokenBucket(double burst, double per_s) : burst_(burst), per_s_(per_s), left_(burst) {}

  // True when one more event may pass now, or one that counts as `events`. Negative `events` make room for later ones.
  // `now_s` is a monotonic time in seconds.
  bool take(double now_s, double events = 1.0) {
    left_ = std::min(burst_, left_ + (now_s - last_s_) * per_s_);
    last_s_ = now_s;
    if (left_ < events) return false;
    left_ = std::min(burst_, left_ - events);
    return true;
  }

  // What has passed lately and is not made up for by the time since.
  double used(double now_s) const { return std::max(0.0, burst_ - left_ - (now_s - last_s_) * per_s_); }
  // True when the burst would pass: nothing has passed lately.
  bool full(double now_s) const { return used(now_s) <= 0.0; }

 private:
  const double burst_, per_s_;
  double left_;
  double last_s_ = 0.0;
};

}  // namespace sightline
