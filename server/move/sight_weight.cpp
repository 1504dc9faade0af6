#include "server/move/sight_weight.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sightline {
namespace {

// Less than one of eight sampled points, so that not even one point of a required target is given up for an optional
// target.
constexpr double kOptionalShare = 0.1;

// 1 - the mean of what is seen, by weights; 0 when no target has a weight.
double hidden_mean(std::span<const TrackedTarget> targets, std::span<const float> seen_share, auto weight_of) {
  double hidden = 0, all = 0;
  for (size_t i = 0; i < targets.size(); ++i) {
    const double weight = weight_of(targets[i]);
    hidden += weight * (1 - static_cast<double>(seen_share[i])), all += weight;
  }
  return all > 0 ? hidden / all : 0.0;
}

}  // namespace

double optional_share(std::span<const TrackedTarget> targets) {
  double lightest_required = std::numeric_limits<double>::infinity(), optional = 0;
  for (const TrackedTarget& target : targets) {
    if (!target.steered()) continue;
    if (target.required)
      lightest_required = std::min(lightest_required, target.weight);
    else
      optional += target.weight;
  }
  if (lightest_required == std::numeric_limits<double>::infinity()) return 1.0;
  return optional > lightest_required ? kOptionalShare * (lightest_required / optional) : kOptionalShare;
}

double hidden_share(std::span<const TrackedTarget> targets, std::span<const float> seen_share) {
  const double optional = optional_share(targets);
  return hidden_mean(targets, seen_share, [&](const TrackedTarget& target) { return sight_weight(target, optional); });
}

double hidden_share_by_weight(std::span<const TrackedTarget> targets, std::span<const float> seen_share) {
  return hidden_mean(targets, seen_share, [](const TrackedTarget& target) { return target.weight; });
}

double effective_count(std::span<const double> sight_weights) {
  double sum = 0, sum_of_squares = 0;
  for (const double weight : sight_weights) sum += weight, sum_of_squares += weight * weight;
  return sum > 0 ? sum * sum / sum_of_squares : 0.0;
}

double several_factor(double count) {
  constexpr double kMost = 3.0;
  return std::clamp(count / 2, 1.0, kMost);
}

double good_enough_share(double share, double count) {
  return share / std::max(1.0, count / 2);
}

double picture_loss(double hidden_share, double count) {
  constexpr double kNotWhole = 0.5;
  const double several = std::max(1.0, count / 2);
  const double not_whole = std::min(1.0, 2 * std::max(1.0, count) * hidden_share);
  return std::lerp(hidden_share, not_whole, kNotWhole / (several * several));
}

}  // namespace sightline
