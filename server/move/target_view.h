// What the choice of a place needs to know of a target this tick.
#pragma once

#include <glm/glm.hpp>

namespace sightline {

struct TargetView {
  glm::dvec3 aim_m{0.0};  // world
  double radius_m = 0.0;  // of its bounding sphere
  glm::dvec3 velocity_mps{0.0};
  double weight = 1.0;
  bool required = true;
  bool steered() const { return weight > 0; }
};

}  // namespace sightline
