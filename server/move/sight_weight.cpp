#include "server/move/sight_weight.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace sightline {
namespace {

// Less than one of eight sampled points, so that not even one point of a required target is given up for an optional target.
constexpr double kOptionalShare = 0.1;

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

double effective_count(std::span<const double> sight_weights) {
  double sum = 0, sum_of_squares = 0;
  for (const double weight : sight_weights) sum += weight, sum_of_squares += weight * weight;
  return sum > 0 ? sum * sum / sum_of_squares : 0.0;
}

double several_factor(double count) {
  constexpr double kMost = 3.0;
  return std::clamp(count / 2, 1.0, kMost);
}

double picture_loss(double hidden_share, double count) {
  constexpr double kNotWhole = 0.5;
  const double several = std::max(1.0, count / 2);
  const double not_whole = std::min(1.0, 2 * std::max(1.0, count) * hidden_share);
  return std::lerp(hidden_share, not_whole, kNotWhole / (several * several));
}

}  // namespace sightline
