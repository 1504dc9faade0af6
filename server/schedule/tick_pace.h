// How far apart a session's ticks are: until when a reply is of use.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

namespace sightline {

// The interval is the longer of what the client says and of what is seen. A client that pauses says 0, and one that
// plays a recording as fast as it is answered shows next to none: neither makes its deadlines closer than a game's.
class TickPace {
 public:
  static constexpr int64_t kShortestNs = 1'000'000;  // 1 ms
  static constexpr int64_t kLongestNs =
      250'000'000;  // 0.25 s; whoever ticks more rarely does not want to wait longer
  static constexpr int64_t kUnknownNs = 16'666'667;  // before the second tick, of one that says nothing

  // A tick came; `dt_s` as it says, if it does. `arrival_ns` never goes back.
  void observe(int64_t arrival_ns, std::optional<double> dt_s) {
    if (dt_s && *dt_s > 0) told_ns_ = static_cast<int64_t>(std::min(*dt_s, 1.0) * 1e9);
    if (arrival_ns_) {
      const int64_t spacing_ns = std::clamp<int64_t>(arrival_ns - *arrival_ns_, 0, kLongestNs);
      seen_ns_ = seen_ns_ ? *seen_ns_ + (spacing_ns - *seen_ns_) / kSmoothing : spacing_ns;
    }
    arrival_ns_ = arrival_ns;
  }

  int64_t interval_ns() const {
    if (!told_ns_ && !seen_ns_) return kUnknownNs;
    return std::clamp(std::max(told_ns_.value_or(0), seen_ns_.value_or(0)), kShortestNs, kLongestNs);
  }
  // When the answer to the newest tick is due; 0 before any.
  int64_t deadline_ns() const { return arrival_ns_ ? *arrival_ns_ + interval_ns() : 0; }

 private:
  static constexpr int64_t kSmoothing = 16;  // ticks, of the mean spacing

  std::optional<int64_t> arrival_ns_, told_ns_, seen_ns_;
};

}  // namespace sightline
