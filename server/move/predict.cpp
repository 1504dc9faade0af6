#include "server/move/predict.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <span>

#include "server/base/check.h"

namespace sightline {
namespace {

// Samples that always count a little, so that after a long gap there is still a parabola.
constexpr size_t kAlwaysFitted = 3;
constexpr double kLeastWeight = 1e-3;
constexpr size_t kStepsToJudge =
    2;  // with three samples the fit is a parabola: the fourth is compared with it

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

// The share of the newest in a low-pass of that time constant.
double newest_share(double dt_s, double time_s) {
  return time_s > 0 ? -std::expm1(-dt_s / time_s) : 1.0;
}

struct Sample {
  double t = 0, weight = 0;
  glm::dvec3 y{0.0};
};

glm::dvec3 sum3(std::span<const Sample> samples, auto term) {
  glm::dvec3 total(0.0);
  for (const Sample& s : samples) total += term(s);
  return total;
}
double sum1(std::span<const Sample> samples, auto term) {
  double total = 0;
  for (const Sample& s : samples) total += term(s);
  return total;
}

// Weighted least squares with polynomials that are orthogonal over the samples themselves, p0 = 1, p1 = t -
// a0, p2 = (t - a1) p1 - b: well conditioned for any time steps, where the normal equations in t and t^2 are
// not.
class Parabola {
 public:
  explicit Parabola(std::span<const Sample> samples) {
    const double n0 = sum1(samples, [](const Sample& s) { return s.weight; });
    a0_ = sum1(samples, [](const Sample& s) { return s.weight * s.t; }) / n0;
    const glm::dvec3 c0 = sum3(samples, [](const Sample& s) { return s.weight * s.y; }) / n0;
    const double n1 = sum1(samples, [&](const Sample& s) { return s.weight * p1(s.t) * p1(s.t); });
    const glm::dvec3 c1 =
        sum3(samples, [&](const Sample& s) { return s.weight * p1(s.t) * (s.y - c0); }) / n1;
    rate_at_zero_ = c1;
    if (samples.size() < 3) return;
    a1_ = sum1(samples, [&](const Sample& s) { return s.weight * s.t * p1(s.t) * p1(s.t); }) / n1;
    b_ = n1 / n0;
    const double n2 = sum1(samples, [&](const Sample& s) { return s.weight * p2(s.t) * p2(s.t); });
    const glm::dvec3 c2 =
        sum3(samples, [&](const Sample& s) { return s.weight * p2(s.t) * (s.y - c0 - c1 * p1(s.t)); }) / n2;
    rate_at_zero_ -= c2 * (a0_ + a1_);
    acceleration_ = 2.0 * c2;
  }
  const glm::dvec3& rate_at_zero() const { return rate_at_zero_; }
  const glm::dvec3& acceleration() const { return acceleration_; }

 private:
  double p1(double t) const { return t - a0_; }
  double p2(double t) const { return (t - a1_) * p1(t) - b_; }

  double a0_ = 0, a1_ = 0, b_ = 0;
  glm::dvec3 rate_at_zero_{0.0}, acceleration_{0.0};
};

}  // namespace

Status validate(const PredictionSettings& s) {
  if (auto ok = check_range("move.prediction_s", s.ahead_s, 0, kMaxPredictionS); !ok) return ok;
  if (auto ok = check_range("move.prediction.smoothing_s", s.smoothing_s, 0, 1); !ok) return ok;
  if (auto ok =
          check_range("move.prediction.acceleration_lasts_s", s.acceleration_lasts_s, 0, kMaxPredictionS);
      !ok)
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
  steps_[next_] = {dt_s, moved};
  next_ = (next_ + 1) % kKept;
  count_ = std::min(count_ + 1, kKept);
  fit(settings.smoothing_s);
  measure_extremes();
}

// Noise of single poses makes mismatches that cancel: those are not wrong predictions of where the thing
// goes. So the mismatch is smoothed as the fit is, before its size is taken.
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

void MotionPredictor::Track::fit(double smoothing_s) {
  std::array<Sample, kKept + 1> samples;
  samples[0] = {0.0, 1.0, glm::dvec3(0.0)};
  size_t n = 1;
  for (size_t k = 0; k < count_; ++k) {
    const Step& step = recent(k);
    Sample s{samples[k].t - step.dt_s, 0.0, samples[k].y - step.moved};
    s.weight = smoothing_s > 0 ? std::exp(s.t / smoothing_s) : 0.0;
    if (n < kAlwaysFitted) s.weight = std::max(s.weight, smoothing_s > 0 ? kLeastWeight : 1.0);
    if (s.weight < 1e-9) break;
    samples[n++] = s;
  }
  const Parabola parabola(std::span<const Sample>(samples.data(), n));
  rate = parabola.rate_at_zero();
  acceleration = parabola.acceleration();
}

void MotionPredictor::Track::measure_extremes() {
  top_rate_ = top_acceleration_ = longest_s_ = 0;
  for (size_t k = 0; k < count_; ++k) {
    const Step& step = recent(k);
    const glm::dvec3 rate_k = step.moved / step.dt_s;
    top_rate_ = std::max(top_rate_, glm::length(rate_k));
    longest_s_ = std::max(longest_s_, step.dt_s);
    if (k + 1 == count_) break;
    const Step& before = recent(k + 1);
    const double apart_s = (step.dt_s + before.dt_s) / 2;
    top_acceleration_ =
        std::max(top_acceleration_, glm::distance(rate_k, before.moved / before.dt_s) / apart_s);
  }
}

glm::dvec3 MotionPredictor::Track::displacement(double ahead_s, double max_rate,
                                                const PredictionSettings& settings) const {
  const double bent_s = std::min(ahead_s, settings.acceleration_lasts_s);
  const glm::dvec3 moved = rate * ahead_s + acceleration * (bent_s * (ahead_s - bent_s / 2));
  const double reach = top_rate_ * ahead_s + top_acceleration_ * ahead_s * (ahead_s + longest_s_) / 2;
  // The slack keeps an exact prediction, which lies on the bound when the motion is uniform, from being
  // rounded.
  return shortened(moved, std::min(reach * (1 + 1e-9), max_rate * ahead_s));
}

void MotionPredictor::observe(double dt_s, const Pose& pose) {
  assert(dt_s >= 0 && is_finite(pose.position_m) && is_finite(pose.rotation));
  if (seen_) {
    const glm::dvec3 turned = rotation_vector(pose.rotation * glm::conjugate(last_.rotation));
    travel_.advance(dt_s, pose.position_m - last_.position_m, settings_.max_speed_mps, settings_.tolerance_m,
                    settings_);
    turn_.advance(dt_s, turned, settings_.max_turn_radps, settings_.tolerance_rad, settings_);
  }
  last_ = pose;
  seen_ = true;
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
  const double e =
      std::max(travel_.error(ahead_s, settings_.tolerance_m), turn_.error(ahead_s, settings_.tolerance_rad));
  return 1.0 / (1.0 + e * e);
}

double MotionPredictor::usable_ahead_s(double wanted_s) const {
  const double wanted = std::clamp(wanted_s, 0.0, kMaxPredictionS);
  return std::min(
      {wanted, settings_.tolerance_m / travel_.mismatch(), settings_.tolerance_rad / turn_.mismatch()});
}

}  // namespace sightline
