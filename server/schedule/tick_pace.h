// The interval between a session's ticks, and the deadline of the reply to the newest one.
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

namespace sightline {

// The interval is the longer of the time that passes in the game (as the ticks say) and of the observed spacing of
// the ticks. A paused game says 0, and a recording that is replayed as fast as possible shows almost no spacing:
// neither makes the deadlines closer than a running game's.
class TickPace {
 public:
  static constexpr int64_t kShortestNs = 1'000'000;  // 1 ms
  // 0.25 s: a client that ticks more rarely still wants a prompt reply
  static constexpr int64_t kLongestNs = 250'000'000;
  static constexpr int64_t kUnknownNs = 16'666'667;  // before the second tick of a client that sends no dt_s

  struct Tick {
    double time_s = 0.0;         // game time
    std::optional<double> dt_s;  // game time since the tick before, when the client sends it
    bool wants_reply = true;     // a tick that is merged into the next one sets no deadline
  };
  // A tick came at `arrival_ns`, which never goes back.
  void observe(int64_t arrival_ns, const Tick& tick) {
    const std::optional<double> dt_s = tick.dt_s ? tick.dt_s : since_last(tick.time_s);
    time_s_ = tick.time_s;
    if (!tick.wants_reply) return;
    if (dt_s && *dt_s > 0) game_ns_ = static_cast<int64_t>(std::min(*dt_s * 1e9, double{kLongestNs}));
    if (arrival_ns_) {
      const int64_t spacing_ns = std::clamp<int64_t>(arrival_ns - *arrival_ns_, 0, kLongestNs);
      seen_ns_ = seen_ns_ ? *seen_ns_ + (spacing_ns - *seen_ns_) / kSmoothing : spacing_ns;
    }
    arrival_ns_ = arrival_ns;
  }

  int64_t interval_ns() const {
    if (!game_ns_ && !seen_ns_) return kUnknownNs;
    return std::clamp(std::max(game_ns_.value_or(0), seen_ns_.value_or(0)), kShortestNs, kLongestNs);
  }
  // When the reply to the newest tick is due; 0 before any.
  int64_t deadline_ns() const { return arrival_ns_ ? *arrival_ns_ + interval_ns() : 0; }

 private:
  static constexpr int64_t kSmoothing = 16;  // ticks over which the spacing is averaged

  std::optional<double> since_last(double time_s) const {
    return time_s_ ? std::optional(time_s - *time_s_) : std::nullopt;
  }

  std::optional<double> time_s_;                           // of the newest tick
  std::optional<int64_t> arrival_ns_, game_ns_, seen_ns_;  // of the newest tick that wants a reply; intervals
};

}  // namespace sightline
