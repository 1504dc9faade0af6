// Points of targets in the world, as the sample stage lists them. Internal to this folder.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/step/step_dump.h"
#include "server/step/target_points.h"

namespace sightline {

// Appends the points in the world. `world_from` gives the transform of the instance in a mirror slot.
template <typename WorldFrom>
void add_points(std::vector<glm::dvec3>& points_m, std::span<const TargetPoint> points, WorldFrom world_from) {
  for (const TargetPoint& p : points) points_m.push_back(transform_point(world_from(p.slot), glm::dvec3(p.at_m)));
}

// The range from `first` to the end of a list.
inline MapRange run_from(size_t first, const std::vector<glm::dvec3>& list) {
  return {static_cast<uint32_t>(first), static_cast<uint32_t>(list.size() - first)};
}

}  // namespace sightline
