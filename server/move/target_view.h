// What the choice of a place needs to know of a target this tick.
#pragma once

#include <glm/glm.hpp>
#include <span>

namespace sightline {

struct TargetView {
  glm::dvec3 aim_m{0.0};  // world
  double radius_m = 0.0;  // of its bounding sphere
  glm::dvec3 velocity_mps{0.0};
  double weight = 1.0;
  bool required = true;
  bool steered() const { return weight > 0; }
};

// What an optional target counts, a share of its weight, wherever seeing one target is weighed against seeing another: at most a
// tenth, and so little that all optional targets together count at most a tenth of the lightest required one. 1 when no required
// target is steered.
double optional_share(std::span<const TargetView> targets);
// What seeing the target counts; `optional_share` is that of all targets.
inline double sight_weight(const TargetView& target, double optional_share) {
  return target.required ? target.weight : target.weight * optional_share;
}

}  // namespace sightline
