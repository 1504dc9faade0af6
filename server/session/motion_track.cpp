#include "server/session/motion_track.h"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

// The motions: to stand, to go on, and to speed up or turn. How often each passes into the others, 1/s. The spectral
// density of its acceleration, m^2/s^3; of who stands, that of the velocity, m^2/s.
constexpr size_t kMotions = 3, kStands = 0;
constexpr std::array<double, kMotions> kLeaves{0.05, 0.05, 2.0};
constexpr std::array<double, kMotions> kUnrest{1e-6, 1e-3, 30.0};
// Noise counts from the first value on, until it falls below the second.
constexpr double kNoisyM = 1e-3, kCalmM = 5e-4;
// The memory of noise and holds, and the number of positions from which on it is known.
constexpr double kMemoryS = 0.5;
constexpr uint32_t kKnownMisses = 12;
// Positions are held if this share of them was sent in more than one tick, until the share falls below the second
// value.
constexpr double kHeldShare = 0.08, kFreeShare = 0.03;
constexpr uint32_t kKnownIntervals = 2, kMostIntervals = 1000;
// It may be held for this much longer than the others before it. Whoever has not moved for the second time stands, and
// is not held.
constexpr double kHeldLonger = 1.25, kLongestHeldS = 0.15;
// Slower than this, and nearer to the position that was sent, is at rest.
constexpr double kRestMps = 0.02, kRestM = 1e-3;
// The variance of the velocity of an instance that begins to move, m^2/s^2.
constexpr double kFirstVelocity = 4.0;

}  // namespace

double MotionTrack::noise_m() const {
  // The miss of position n is what the last two positions did not foretell: n_k - 2 n_{k-1} + n_{k-2} of the noise.
  // Successive ones have the covariance -4 sigma^2 by axis. Those of a smooth motion have the same direction, and a
  // corner is one miss alone.
  return misses_ < kKnownMisses ? 0.0 : std::sqrt(std::max(0.0, -miss_product_m2_) / 12.0);
}

bool MotionTrack::is_noisy() const {
  return noise_m() > (noisy_ ? kCalmM : kNoisyM);
}

double MotionTrack::variance_m2() const {
  // A position may be as old as its tick is late.
  glm::dvec3 velocity_mps(0.0);
  for (const Belief& belief : beliefs_) velocity_mps += belief.share * belief.velocity_mps;
  return std::max(noise_m() * noise_m(), kCalmM * kCalmM) +
         glm::dot(velocity_mps, velocity_mps) * interval_variance_s2_;
}

// The weight of the newest value in a mean over the last half second, or over all so far.
double MotionTrack::newest_part(double interval_s, uint32_t known) const {
  return std::max(-std::expm1(-interval_s / kMemoryS), 1.0 / (known + 1.0));
}

void MotionTrack::restart(const glm::dvec3& at_m) {
  *this = MotionTrack();
  known_ = true;
  last_m_ = at_m;
}

// A position that was held has had as long to change.
bool MotionTrack::jumps(double dt_s, const glm::dvec3& at_m, double jump_mps) const {
  const double held_s = since_s_ + dt_s <= kLongestHeldS ? since_s_ : 0.0;
  return !(glm::distance(at_m, last_m_) <= jump_mps * (held_s + dt_s));
}

MotionEstimate MotionTrack::observe(double dt_s, const glm::dvec3& at_m, double jump_mps) {
  if (!known_ || jumps(dt_s, at_m, jump_mps)) return restart(at_m), MotionEstimate{};
  const bool leaps = glm::distance(at_m, last_m_) > jump_mps * dt_s;
  since_s_ += dt_s, believed_s_ += dt_s, ++ticks_since_;
  sent_ = false;
  if (at_m == last_m_) return unchanged(dt_s);
  const MotionEstimate now = changed(dt_s, at_m);
  // Until it is known that positions are held, a leap of one tick is no motion.
  return leaps && !filters_ ? MotionEstimate{} : now;
}

MotionEstimate MotionTrack::observe_sent(double dt_s, const glm::dvec3& at_m, const glm::dvec3& velocity_mps,
                                         double jump_mps) {
  if (!known_ || jumps(dt_s, at_m, jump_mps)) return restart(at_m), sent_ = true, MotionEstimate{velocity_mps, {}};
  since_s_ += dt_s, ++ticks_since_;
  sent_ = true;
  if (at_m != last_m_) {
    take_interval(dt_s);
    last_m_ = at_m;
    return {velocity_mps, {}};
  }
  const bool goes_on = held_ && since_s_ <= coast_s(dt_s);
  stands_ = !goes_on;
  return {velocity_mps, goes_on ? velocity_mps * since_s_ : glm::dvec3(0.0)};
}

// How long a position may be held before its instance has stopped.
double MotionTrack::coast_s(double dt_s) const {
  return std::max(kHeldLonger * *std::max_element(intervals_s_.begin(), intervals_s_.end()), kHeldLonger * dt_s);
}

// The time that a position was held before it changed says nothing if the instance stood.
void MotionTrack::take_interval(double dt_s) {
  if (since_s_ <= kLongestHeldS) {
    intervals_s_ = {since_s_, intervals_s_[0], intervals_s_[1]};
    const double newest = newest_part(since_s_, intervals_);
    held_share_ += newest * ((ticks_since_ > 1 ? 1.0 : 0.0) - held_share_);
    const double off_s = since_s_ - mean_interval_s_;
    mean_interval_s_ += newest * off_s;
    interval_variance_s2_ = (1 - newest) * (interval_variance_s2_ + newest * off_s * off_s);
    intervals_ = std::min(intervals_ + 1, kMostIntervals);
    held_ = intervals_ >= kKnownIntervals && held_share_ > (held_ ? kFreeShare : kHeldShare);
  } else if (!held_) {
    intervals_s_ = {dt_s, 0.0, 0.0};
  }
  stands_ = false;
  since_s_ = 0.0, ticks_since_ = 0;
}

void MotionTrack::measure_noise(const glm::dvec3& moved_m, double interval_s) {
  const glm::dvec3 miss_m = moved_m - last_mps_ * interval_s;
  const double newest = newest_part(interval_s, misses_);
  miss_product_m2_ += newest * (glm::dot(miss_m, last_miss_m_) - miss_product_m2_);
  last_miss_m_ = miss_m;
  misses_ = std::min(misses_ + 1, kKnownMisses);
}

MotionEstimate MotionTrack::changed(double dt_s, const glm::dvec3& at_m) {
  const glm::dvec3 moved_m = at_m - last_m_;
  const bool starts = since_s_ > kLongestHeldS;
  const double since_s = since_s_;
  take_interval(dt_s);
  // Who starts has moved for as long as positions are held at most.
  const double interval_s = !starts ? since_s : held_ ? std::min(since_s, intervals_s_[0]) : dt_s;
  if (starts)
    last_miss_m_ = glm::dvec3(0.0);
  else
    measure_noise(moved_m, interval_s);
  noisy_ = is_noisy();
  last_mps_ = moved_m / interval_s;
  last_m_ = at_m;
  if (!held_ && !noisy_) {
    filters_ = false;
    return {moved_m / dt_s, glm::dvec3(0.0)};
  }
  if (!filters_ || starts)
    begin_beliefs(at_m, last_mps_, interval_s);
  else
    update_beliefs(believed_s_, at_m);
  return estimate(0.0);
}

MotionEstimate MotionTrack::unchanged(double dt_s) {
  if (!filters_) {
    stands_ = true;
    return {};
  }
  if (!stands_ && since_s_ <= coast_s(dt_s)) return estimate(believed_s_);
  stands_ = true;
  update_beliefs(believed_s_, last_m_);
  const MotionEstimate now = estimate(0.0);
  if (glm::length(now.velocity_mps) > kRestMps || glm::length(now.correction_m) > kRestM) return now;
  begin_beliefs(last_m_, glm::dvec3(0.0), dt_s);
  return {};
}

// ---- the beliefs ----

void MotionTrack::go_on(Belief& belief, double time_s, size_t motion) {
  const double unrest = kUnrest[motion];
  if (motion == kStands) {
    belief.velocity_mps = glm::dvec3(0.0), belief.both = belief.velocity = 0.0;
    belief.position += unrest * time_s;
    return;
  }
  belief.at_m += belief.velocity_mps * time_s;
  belief.position += time_s * (2 * belief.both + time_s * (belief.velocity + unrest * time_s / 3));
  belief.both += time_s * (belief.velocity + unrest * time_s / 2);
  belief.velocity += unrest * time_s;
}

double MotionTrack::correct(Belief& belief, const glm::dvec3& at_m, double variance) {
  const double expected = belief.position + variance;
  const double gain = belief.position / expected, velocity_gain = belief.both / expected;
  const glm::dvec3 miss_m = at_m - belief.at_m;
  belief.at_m += gain * miss_m;
  belief.velocity_mps += velocity_gain * miss_m;
  belief.velocity -= velocity_gain * belief.both;
  belief.both *= 1 - gain;
  belief.position *= 1 - gain;
  return -1.5 * std::log(expected) - glm::dot(miss_m, miss_m) / (2 * expected);
}

void MotionTrack::begin_beliefs(const glm::dvec3& at_m, const glm::dvec3& velocity_mps, double interval_s) {
  const double variance = variance_m2();
  for (Belief& belief : beliefs_)
    belief = {.at_m = at_m,
              .velocity_mps = velocity_mps,
              .position = variance,
              .both = variance / interval_s,
              .velocity = std::min(2 * variance / (interval_s * interval_s), kFirstVelocity) + kFirstVelocity,
              .share = 1.0 / kMotions};
  for (Belief& belief : beliefs_) belief.both = std::min(belief.both, std::sqrt(belief.position * belief.velocity) / 2);
  filters_ = true;
  believed_s_ = 0.0;
}

// Each motion may have passed into another since.
void MotionTrack::mix_beliefs(double time_s) {
  const std::array<Belief, kMotions> before = beliefs_;
  for (size_t to = 0; to < kMotions; ++to) {
    std::array<double, kMotions> parts;
    Belief mixed;
    for (size_t from = 0; from < kMotions; ++from) {
      const double leaves = -std::expm1(-kLeaves[from] * time_s);
      parts[from] = before[from].share * (from == to ? 1 - leaves : leaves / (kMotions - 1));
      mixed.share += parts[from];
    }
    for (size_t from = 0; from < kMotions; ++from) {
      parts[from] /= mixed.share;
      mixed.at_m += parts[from] * before[from].at_m, mixed.velocity_mps += parts[from] * before[from].velocity_mps;
    }
    for (size_t from = 0; from < kMotions; ++from) {
      const glm::dvec3 aside_m = before[from].at_m - mixed.at_m,
                       aside_mps = before[from].velocity_mps - mixed.velocity_mps;
      mixed.position += parts[from] * (before[from].position + glm::dot(aside_m, aside_m) / 3);
      mixed.both += parts[from] * (before[from].both + glm::dot(aside_m, aside_mps) / 3);
      mixed.velocity += parts[from] * (before[from].velocity + glm::dot(aside_mps, aside_mps) / 3);
    }
    beliefs_[to] = mixed;
  }
}

void MotionTrack::update_beliefs(double time_s, const glm::dvec3& at_m) {
  constexpr double kLeastShare = 1e-6;
  const double variance = variance_m2();
  mix_beliefs(time_s);
  std::array<double, kMotions> likelihood;
  for (size_t k = 0; k < kMotions; ++k) {
    go_on(beliefs_[k], time_s, k);
    likelihood[k] = correct(beliefs_[k], at_m, variance);
  }
  const double most = *std::max_element(likelihood.begin(), likelihood.end());
  double sum = 0;
  for (size_t k = 0; k < kMotions; ++k)
    sum += beliefs_[k].share = std::max(beliefs_[k].share * std::exp(likelihood[k] - most), kLeastShare);
  for (Belief& belief : beliefs_) belief.share /= sum;
  believed_s_ = 0.0;
}

MotionEstimate MotionTrack::estimate(double ahead_s) const {
  glm::dvec3 at_m(0.0), velocity_mps(0.0);
  for (const Belief& belief : beliefs_)
    at_m += belief.share * belief.at_m, velocity_mps += belief.share * belief.velocity_mps;
  return {velocity_mps, at_m + velocity_mps * ahead_s - last_m_};
}

}  // namespace sightline
