// A ray as boxes are tested with it. Internal to ray.cpp and crossings.cpp.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "server/scene/geometry.h"

namespace sightline {

struct BoxRay {
  glm::dvec3 origin, inverse;  // 1 / direction

  BoxRay(const glm::dvec3& origin_m, const glm::dvec3& direction)
      : origin(origin_m), inverse(inverse_of(direction.x), inverse_of(direction.y), inverse_of(direction.z)) {}

  // The distance at which the box is entered, 0 from inside; infinity when it is missed.
  double enters(const Aabb& box) const {
    double first = 0.0, last = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
      const double a = (box.min[axis] - origin[axis]) * inverse[axis];
      const double b = (box.max[axis] - origin[axis]) * inverse[axis];
      first = std::max(first, std::min(a, b));
      last = std::min(last, std::max(a, b));
    }
    return first <= last ? first : std::numeric_limits<double>::infinity();
  }

 private:
  // 1 / x, finite, so that no product with it is undefined.
  static double inverse_of(double x) {
    constexpr double kLeast = 1e-30;
    return 1.0 / (std::abs(x) < kLeast ? std::copysign(kLeast, x) : x);
  }
};

}  // namespace sightline
