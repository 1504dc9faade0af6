// Ray tracing without any acceleration: every triangle of every instance, in double, by Moeller & Trumbore (1997).
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <limits>

#include "server/sample/embree_scene.h"

namespace sightline::test {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Triangle {
  glm::dvec3 a, b, c;
};

// In lengths of `direction`; infinity when it misses. Negative behind the origin.
double hit_distance(const Triangle& triangle, const glm::dvec3& origin, const glm::dvec3& direction);

template <typename Visit>
void for_each_triangle(const Instance& instance, bool occluding_only, const Visit& visit) {
  const Geometry& geometry = *instance.geometry;
  const size_t count = occluding_only ? geometry.occluding_index_count : geometry.indices.size();
  const auto corner = [&](size_t i) {
    return transform_point(instance.world_from_instance, glm::dvec3(geometry.positions[geometry.indices[i]]));
  };
  for (size_t i = 0; i < count; i += 3) visit(Triangle{corner(i), corner(i + 1), corner(i + 2)});
}

struct BruteHit {
  double distance = kInfinity, second = kInfinity;  // `second`: nearest of any other instance
  uint32_t slot = UINT32_MAX;
};

// The first hit beyond `near` on instances that occlude, or that collide, in their present poses.
BruteHit brute_trace(const SceneMirror& mirror, bool occluders, const glm::dvec3& origin, const glm::dvec3& direction,
                     double near, const RayFilter& filter);

}  // namespace sightline::test
