// Random vectors for the tests of pair volumes and of their chains.
#pragma once

#include "server/base/random.h"
#include "server/bound/bound.h"

namespace sightline {

// Each component in [-size, size).
inline glm::dvec3 random_vector(CounterRandom& random, double size) {
  return {random.next_in(-size, size), random.next_in(-size, size), random.next_in(-size, size)};
}

inline Bound ball(const glm::dvec3& center_m, double radius_m) {
  Bound bound;
  bound.center_m = center_m;
  bound.radius_m = radius_m;
  return bound;
}

}  // namespace sightline
