// The triangles of a mirror in the world frame, in single precision.
#pragma once

#include <vector>

#include "server/scene/mirror.h"

namespace sightline::bench {

struct FlatTriangles {
  std::vector<glm::vec3> positions;
  std::vector<uint32_t> indices;
};

// Appends the occluding triangles of one instance.
inline void append_flat(const Instance& instance, FlatTriangles& flat) {
  const auto base = static_cast<uint32_t>(flat.positions.size());
  const Geometry& geometry = *instance.geometry;
  for (const glm::vec3& p : geometry.positions)
    flat.positions.push_back(glm::vec3(transform_point(instance.world_from_instance, glm::dvec3(p))));
  for (uint32_t i = 0; i < geometry.occluding_index_count; ++i) flat.indices.push_back(base + geometry.indices[i]);
}

inline FlatTriangles flat_statics(const SceneMirror& mirror) {
  FlatTriangles flat;
  for (const Instance& instance : mirror.instances())
    if (instance.geometry && instance.occludes() && !instance.moving) append_flat(instance, flat);
  return flat;
}

// Slots of the instances that move and occlude.
inline std::vector<uint32_t> moving_occluders(const SceneMirror& mirror) {
  std::vector<uint32_t> slots(mirror.moving_slots().begin(), mirror.moving_slots().end());
  std::erase_if(slots, [&](uint32_t slot) { return !mirror.instances()[slot].occludes(); });
  return slots;
}

}  // namespace sightline::bench
