// Weights of the targets for strategies that compare partial views. Required targets come first, even if optional ones
// weigh more.
#pragma once

#include <span>

#include "server/scene/target.h"

namespace sightline {

// Factor of the weights of optional targets, at most 0.1. It is so small that all optional targets together count at
// most a tenth of the lightest required one. 1 when no required target is steered.
double optional_share(std::span<const TrackedTarget> targets);
// The weight of seeing a target; `optional_share` is the result of the function above.
inline double sight_weight(const TrackedTarget& target, double optional_share) {
  return target.required ? target.weight : target.weight * optional_share;
}

// The share of the targets that is not seen, [0, 1]; 0 when none is steered. Targets count by `sight_weight`: no weight
// of an optional target makes up for a required one. `seen_share` has one entry a target.
double hidden_share(std::span<const TrackedTarget> targets, std::span<const float> seen_share);
// The same, with required and optional targets alike by their weights.
double hidden_share_by_weight(std::span<const TrackedTarget> targets, std::span<const float> seen_share);

// The number of equal targets that share their weight as these do: (sum w)^2 / sum w^2. Targets of little weight hardly
// count. 0 without a weight.
double effective_count(std::span<const double> sight_weights);

// Hidden shares are means over the targets, so a part of one target counts the less, the more targets there are. Times
// this factor, [1, 3], a part costs as much from three targets on as with two. It has a bound, because a camera with
// very many targets would never be calm. `count` is effective_count(), >= 0.
double several_factor(double count);

// The share of several targets that may be hidden where `share` may be of one or two. So the same part of a single one
// of them may be hidden, however many there are. `count` is effective_count().
double good_enough_share(double share, double count);

// How much a picture lacks, [0, 1], from which `hidden_share`, [0, 1], of the targets is hidden. `count` is
// effective_count(), >= 0. A picture in which one target is not whole is nearly as bad as one in which half of it is
// hidden. So up to half of the loss is reached when half of an average target is hidden, and the rest grows with the
// share. It is up to half with one or two targets. With more targets it is less, by the square of their number: few
// places show them all, and all others would seem alike. Deterministic.
double picture_loss(double hidden_share, double count);

}  // namespace sightline
