// What a level holds, in numbers: sizes, triangles, and which instances hide targets or stop the camera.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "client/check/level.h"

namespace sightline {

// Instances that are shorter than this are small: clutter that a camera need not keep clear of.
inline constexpr double kSmallInstanceM = 0.5;

struct LevelFacts {
  glm::dvec3 min_m{0.0}, max_m{0.0};  // of all triangles of visible instances; equal when there are none
  size_t triangles = 0;               // as instanced, of visible instances
  size_t stored_triangles = 0;
  size_t instances = 0;  // visible
  size_t hiding = 0, colliding = 0;
  size_t small_colliding = 0;         // of those, the ones that are shorter than kSmallInstanceM
  std::array<double, 3> facing_m2{};  // area of what hides, by the axis that its normal is within 30 degrees of
  std::string largest_mesh;           // the one with the most stored triangles
  size_t largest_mesh_triangles = 0;
  std::vector<std::string> see_through_materials;  // names
  size_t targets = 0, occluders = 0;

  glm::dvec3 size_m() const { return max_m - min_m; }
};

LevelFacts facts_of(const Level& level);

}  // namespace sightline
