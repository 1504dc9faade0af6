// The triangles of an instance in the world.
#pragma once

#include <array>
#include <glm/glm.hpp>

#include "server/scene/mirror.h"

namespace sightline {

struct LevelTriangle {
  std::array<glm::dvec3, 3> corners_m;
  glm::dvec3 normal{0.0};  // unit; of the front, from which an engine draws a surface that has one side
  double area_m2 = 0.0;
  size_t first_index = 0;  // in Geometry::indices
  bool hides = false;      // its instance and its material hide targets
};

// Calls visit(LevelTriangle) for each; those that the instance flattens are left out.
template <typename Visit>
void for_each_triangle(const Instance& instance, Visit visit) {
  const Geometry& geometry = *instance.geometry;
  const Affine& world = instance.world_from_instance;
  // A mirroring transform turns the order of the corners, and the front stays the front (glTF 2.0 section 3.7.4).
  const double side = glm::determinant(glm::dmat3(world[0], world[1], world[2])) < 0.0 ? -1.0 : 1.0;
  for (size_t first = 0; first < geometry.indices.size(); first += 3) {
    LevelTriangle triangle;
    for (size_t k = 0; k < 3; ++k)
      triangle.corners_m[k] = transform_point(world, glm::dvec3(geometry.positions[geometry.indices[first + k]]));
    const auto& [a, b, c] = triangle.corners_m;
    const glm::dvec3 doubled = side * glm::cross(b - a, c - a);
    const double length = glm::length(doubled);
    if (!(length > 0.0)) continue;
    triangle.normal = doubled / length;
    triangle.area_m2 = 0.5 * length;
    triangle.first_index = first;
    triangle.hides = instance.occludes() && first < geometry.occluding_index_count;
    visit(triangle);
  }
}

}  // namespace sightline
