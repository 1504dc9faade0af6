// What it counts to see a target, where not all targets can be seen: required targets come first, whatever optional ones weigh.
#pragma once

#include <span>

#include "server/move/target_view.h"

namespace sightline {

// What an optional target counts, a share of its weight, wherever seeing one target is weighed against seeing another: at most a
// tenth, and so little that all optional targets together count at most a tenth of the lightest required one. 1 when no required
// target is steered.
double optional_share(std::span<const TargetView> targets);
// What seeing the target counts; `optional_share` is that of all targets.
inline double sight_weight(const TargetView& target, double optional_share) {
  return target.required ? target.weight : target.weight * optional_share;
}

}  // namespace sightline
