// A target as the strategies see it, for tests of choices and places.
#pragma once

#include "server/scene/target.h"

namespace sightline {

inline TrackedTarget target_at(const glm::dvec3& aim, double weight = 1.0, bool required = true) {
  TrackedTarget view;
  view.aim_m = aim;
  view.radius_m = 0.5;
  view.weight = weight;
  view.required = required;
  return view;
}

}  // namespace sightline
