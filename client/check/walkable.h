// Where a person can walk in a level: standing places on a grid, and which of them are neighbours.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "client/check/level.h"

namespace sightline {

inline constexpr double kPersonRadiusM = 0.3, kPersonHeightM = 1.8;

struct StandingPlace {
  glm::dvec3 foot_m{0.0};
  std::vector<uint32_t> neighbours;  // by steps of up to 45 degrees
};

// The largest connected set of places, of the 100 x 100 m around the level's middle. Of several that are nearly as
// large, the lowest: rooms are below their roofs. Empty where there is no floor with room for a person. Neighbours are
// 0.5 or 0.7 m apart. Everything but targets and moving occluders is in the way.
std::vector<StandingPlace> standing_places(const Level& level);

}  // namespace sightline
