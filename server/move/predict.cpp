#include "server/move/predict.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "server/base/check.h"

namespace sightline {
namespace {

// This many samples always have some weight, so that a parabola is defined after a long gap too.
constexpr size_t kAlwaysFitted = 3;
constexpr double kLeastWeight = 1e-3;
constexpr size_t kStepsToJudge = 2;  // with three samples the fit is a parabola: the fourth is compared with it

glm::dvec3 rotation_vector(const glm::dquat& rotation) {
  const glm::dquat q = rotation.w < 0 ? -rotation : rotation;
  const glm::dvec3 v(q.x, q.y, q.z);
  const double s = glm::length(v);
  return s > 0 ? v * (2 * std::atan2(s, q.w) / s) : v;
}

glm::dquat rotation_of(const glm::dvec3& vector) {
  const double angle = glm::length(vector);
  return angle > 0 ? glm::angleAxis(angle, vector / angle) : glm::dquat(1, 0, 0, 0);
}

glm::dvec3 shortened(const glm::dvec3& v, double longest) {
  const double length = glm::length(v);
  return length > longest ? v * (longest / length) : v;
}

// The weight of the newest value in a low-pass filter with this time constant.
double newest_share(double dt_s, double time_s) {
  return time_s > 0 ? -std::expm1(-dt_s / time_s) : 1.0;
}

glm::dvec3 rate_of(double dt_s, const glm::dvec3& moved) {
  return moved / dt_s;
}

}  // namespace

// Weighted least squares with polynomials that are orthogonal over the samples, p0 = 1, p1 = t - a0, p2 = (t - a1) p1 -
// b. They are well conditioned for all time steps, where the normal equations in t and t^2 are not. Every sum is taken
// in the order of the samples.
class MotionPredictor::Parabola {
 public:
  Parabola(const SampleTimes& times, const std::array<glm::dvec3, kKept + 1>& y) {
    double n0 = 0;
    glm::dvec3 c0(0.0);
    for (size_t k = 0; k < times.count; ++k) {
      const double w = times.weight[k];
      n0 += w, a0_ += w * times.t[k], c0 += w * y[k];
    }
    a0_ /= n0, c0 /= n0;
    double n1 = 0, bend = 0;
    glm::dvec3 c1(0.0);
    for (size_t k = 0; k < times.count; ++k) {
      const double w = times.weight[k], t = times.t[k], p1 = t - a0_;
      n1 += w * p1 * p1, c1 += w * p1 * (y[k] - c0), bend += w * t * p1 * p1;
    }
    c1 /= n1;
    rate_at_zero_ = c1;
    if (times.count < 3) return;
    const double a1 = bend / n1, b = n1 / n0;
    double n2 = 0;
    glm::dvec3 c2(0.0);
    for (size_t k = 0; k < times.count; ++k) {
      const double w = times.weight[k], t = times.t[k], p1 = t - a0_, p2 = (t - a1) * p1 - b;
      n2 += w * p2 * p2, c2 += w * p2 * (y[k] - c0 - c1 * p1);
    }
    c2 /= n2;
    rate_at_zero_ -= c2 * (a0_ + a1);
    acceleration_ = 2.0 * c2;
  }
  const glm::dvec3& rate_at_zero() const { return rate_at_zero_; }
  const glm::dvec3& acceleration() const { return acceleration_; }

 private:
  double a0_ = 0;
  glm::dvec3 rate_at_zero_{0.0}, acceleration_{0.0};
};

Status validate(const PredictionSettings& s) {
  if (auto ok = check_range("move.prediction_s", s.ahead_s, 0, kMaxPredictionS); !ok) return ok;
  if (auto ok = check_range("move.prediction.smoothing_s", s.smoothing_s, 0, 1); !ok) return ok;
  if (auto ok = check_range("move.prediction.acceleration_lasts_s", s.acceleration_lasts_s, 0, kMaxPredictionS); !ok)
    return ok;
  if (auto ok = check_range("move.prediction.memory_s", s.memory_s, 0.01, 10); !ok) return ok;
  if (auto ok = check_above("move.prediction.tolerance_m", s.tolerance_m, 0, 100); !ok) return ok;
  if (auto ok = check_above("move.prediction.tolerance_rad", s.tolerance_rad, 0, 3.2); !ok) return ok;
  if (auto ok = check_above("move.prediction.max_speed_mps", s.max_speed_mps, 0, 1000); !ok) return ok;
  return check_above("move.prediction.max_turn_radps", s.max_turn_radps, 0, 1000);
}

void MotionPredictor::Track::advance(double dt_s, const glm::dvec3& moved, double max_rate, double tolerance,
                                     const PredictionSettings& settings) {
  const double distance = glm::length(moved);
  if (distance > (dt_s > 0 ? max_rate * dt_s : tolerance)) {
    forget();
    return;
  }
  if (dt_s == 0) return;
  if (count_ >= kStepsToJudge) judge(dt_s, moved, max_rate, settings);
  const bool full = count_ == kKept;
  const Extremes lost = full ? extremes_at(count_ - 1) : Extremes{},
                 lost_between = full ? extremes_at(count_ - 2) : Extremes{};
  steps_[next_] = {dt_s, moved};
  next_ = (next_ + 1) % kKept;
  count_ = std::min(count_ + 1, kKept);
  measure_extremes({lost.rate, lost_between.acceleration, lost.dt_s});
}

// Noise in single poses causes mismatches that cancel each other, which are no wrong predictions. So the mismatch is
// smoothed like the fit before its size is taken.
void MotionPredictor::Track::judge(double dt_s, const glm::dvec3& moved, double max_rate,
                                   const PredictionSettings& settings) {
  const glm::dvec3 mismatch = (moved - displacement(dt_s, max_rate, settings)) / dt_s;
  drift_ += (judged_ ? newest_share(dt_s, settings.smoothing_s) : 1.0) * (mismatch - drift_);
  mismatch_ = std::max(glm::length(drift_), mismatch_ * std::exp(-dt_s / settings.memory_s));
  judged_ = true;
}

double MotionPredictor::Track::mismatch() const {
  return judged_ ? mismatch_ : std::numeric_limits<double>::infinity();
}

void MotionPredictor::Track::list_times(double smoothing_s, SampleTimes& times) const {
  times.t[0] = 0.0, times.weight[0] = 1.0;
  times.count = 1;
  for (size_t k = 0; k < count_; ++k) {
    const double t = times.t[k] - recent(k).dt_s;
    double weight = smoothing_s > 0 ? std::exp(t / smoothing_s) : 0.0;
    if (times.count < kAlwaysFitted) weight = std::max(weight, smoothing_s > 0 ? kLeastWeight : 1.0);
    if (weight < 1e-9) break;
    times.t[times.count] = t, times.weight[times.count++] = weight;
  }
}

void MotionPredictor::Track::fit(const SampleTimes& times) {
  std::array<glm::dvec3, kKept + 1> y;
  y[0] = glm::dvec3(0.0);
  for (size_t k = 0; k + 1 < times.count; ++k) y[k + 1] = y[k] - recent(k).moved;
  const Parabola parabola(times, y);
  rate = parabola.rate_at_zero();
  acceleration = parabola.acceleration();
}

// The speed of step k, and the acceleration between it and the step before it; 0 where there is none.
MotionPredictor::Track::Extremes MotionPredictor::Track::extremes_at(size_t k) const {
  const Step& step = recent(k);
  const glm::dvec3 rate_k = rate_of(step.dt_s, step.moved);
  Extremes at{glm::length(rate_k), 0.0, step.dt_s};
  if (k + 1 == count_) return at;
  const Step& before = recent(k + 1);
  const double apart_s = (step.dt_s + before.dt_s) / 2;
  at.acceleration = glm::distance(rate_k, rate_of(before.dt_s, before.moved)) / apart_s;
  return at;
}

void MotionPredictor::Track::take_in(const Extremes& at) {
  top_.rate = std::max(top_.rate, at.rate);
  top_.acceleration = std::max(top_.acceleration, at.acceleration);
  top_.dt_s = std::max(top_.dt_s, at.dt_s);
}

// Rescans all steps only when a maximum left with the oldest step and the newest step does not reach it.
void MotionPredictor::Track::measure_extremes(const Extremes& lost) {
  const Extremes newest = extremes_at(0);
  const auto keeps = [](double top, double gone, double come) { return gone < top || come >= top; };
  const bool keep = keeps(top_.rate, lost.rate, newest.rate) && keeps(top_.dt_s, lost.dt_s, newest.dt_s) &&
                    keeps(top_.acceleration, lost.acceleration, newest.acceleration);
  if (keep) return take_in(newest);
  top_ = {};
  for (size_t k = 0; k < count_; ++k) take_in(extremes_at(k));
}

glm::dvec3 MotionPredictor::Track::displacement(double ahead_s, double max_rate,
                                                const PredictionSettings& settings) const {
  const double bent_s = std::min(ahead_s, settings.acceleration_lasts_s);
  const glm::dvec3 moved = rate * ahead_s + acceleration * (bent_s * (ahead_s - bent_s / 2));
  const double reach = top_.rate * ahead_s + top_.acceleration * ahead_s * (ahead_s + top_.dt_s) / 2;
  // Uniform motion is predicted exactly at the bound; the slack keeps rounding from cutting it.
  return shortened(moved, std::min(reach * (1 + 1e-9), max_rate * ahead_s));
}

void MotionPredictor::observe(double dt_s, const Pose& pose) {
  assert(dt_s >= 0 && is_finite(pose.position_m) && is_finite(pose.rotation));
  if (seen_) {
    const glm::dvec3 turned = rotation_vector(pose.rotation * glm::conjugate(last_.rotation));
    travel_.advance(dt_s, pose.position_m - last_.position_m, settings_.max_speed_mps, settings_.tolerance_m,
                    settings_);
    turn_.advance(dt_s, turned, settings_.max_turn_radps, settings_.tolerance_rad, settings_);
    if (dt_s > 0) fit();
  }
  last_ = pose;
  seen_ = true;
}

// Tracks with equally many steps share their sample times, because steps are added to both at once.
void MotionPredictor::fit() {
  SampleTimes times;
  const bool same = travel_.count() == turn_.count();
  for (Track* track : {&travel_, &turn_}) {
    if (track->count() == 0) continue;
    if (track == &travel_ || !same) track->list_times(settings_.smoothing_s, times);
    track->fit(times);
  }
}

Prediction MotionPredictor::at(double ahead_s) const {
  const double ahead = std::clamp(ahead_s, 0.0, kMaxPredictionS);
  Prediction result{last_, confidence(ahead)};
  if (ahead == 0) return result;
  result.pose.position_m += travel_.displacement(ahead, settings_.max_speed_mps, settings_);
  const glm::dvec3 turned = turn_.displacement(ahead, settings_.max_turn_radps, settings_);
  if (turned != glm::dvec3(0.0)) result.pose.rotation = glm::normalize(rotation_of(turned) * last_.rotation);
  return result;
}

double MotionPredictor::confidence(double ahead_s) const {
  if (!seen_) return 0.0;
  if (ahead_s <= 0) return 1.0;
  const double e = std::max(travel_.error(ahead_s, settings_.tolerance_m),
                            turn_.error(ahead_s, settings_.tolerance_rad));
  return 1.0 / (1.0 + e * e);
}

double MotionPredictor::usable_ahead_s(double wanted_s) const {
  const double wanted = std::clamp(wanted_s, 0.0, kMaxPredictionS);
  return std::min({wanted, settings_.tolerance_m / travel_.mismatch(), settings_.tolerance_rad / turn_.mismatch()});
}

}  // namespace sightline
