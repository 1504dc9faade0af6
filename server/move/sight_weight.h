// Weights of the targets for strategies that compare partial views. Required targets come first, even if optional ones weigh
// more.
#pragma once

#include <span>

#include "server/scene/target.h"

namespace sightline {

// Factor of the weights of optional targets, at most 0.1. It is so small that all optional targets together count at most a
// tenth of the lightest required one. 1 when no required target is steered.
double optional_share(std::span<const TrackedTarget> targets);
// The weight of seeing a target; `optional_share` is the result of the function above.
inline double sight_weight(const TrackedTarget& target, double optional_share) {
  return target.required ? target.weight : target.weight * optional_share;
}

// The number of equal targets that share their weight as these do: (sum w)^2 / sum w^2. Targets of little weight hardly count. 0 without a weight.
double effective_count(std::span<const double> sight_weights);

}  // namespace sightline
