#include "client/bench/schedule.h"

#include <cmath>

namespace sightline {
namespace {

// Long enough for the last answers of the other peer, for caches and for threads that slept.
constexpr int64_t kLeadInNs = 250'000'000;

int64_t to_ns(double seconds) {
  return std::llround(seconds * 1e9);
}

}  // namespace

BenchSchedule::BenchSchedule(const Options& options)
    : options_(options),
      lead_in_ns_(options.echo ? kLeadInNs : 0),
      window_ns_(to_ns(options.window_s)),
      warm_up_segments_(static_cast<int64_t>(std::ceil(options.warm_up_s / options.window_s - 1e-9))) {}

BenchSchedule::Position BenchSchedule::position_of(uint64_t k, size_t session) const {
  const double phase = static_cast<double>(session) / static_cast<double>(options_.sessions);
  const int64_t own_ns = to_ns((static_cast<double>(k) + phase) / options_.rate_hz);
  const int64_t segment_ns = lead_in_ns_ + window_ns_;
  return {own_ns / segment_ns, own_ns % segment_ns};
}

int64_t BenchSchedule::start_ns(BenchPeer peer, int64_t segment) const {
  const int64_t turn = options_.echo ? 2 * segment + (peer == BenchPeer::kEcho ? 1 : 0) : segment;
  return turn * (lead_in_ns_ + window_ns_);
}

int64_t BenchSchedule::due_ns(BenchPeer peer, uint64_t k, size_t session) const {
  const Position position = position_of(k, session);
  return start_ns(peer, position.segment) + position.ns;
}

int BenchSchedule::window_of(uint64_t k, size_t session) const {
  const Position position = position_of(k, session);
  if (position.ns < lead_in_ns_ || position.segment < warm_up_segments_) return -1;
  return static_cast<int>(position.segment - warm_up_segments_);
}

int64_t BenchSchedule::begin_ns(BenchPeer peer, int window) const {
  return start_ns(peer, warm_up_segments_ + window) + lead_in_ns_;
}

int64_t BenchSchedule::end_ns(BenchPeer peer, int window) const {
  return begin_ns(peer, window) + window_ns_;
}

}  // namespace sightline
