// Scenes of random triangles, and all their triangles in the world, for brute force.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "server/base/random.h"
#include "server/scene/mirror.h"

namespace sightline::test {

using Triangle = std::array<glm::dvec3, 3>;

class Draw {
 public:
  explicit Draw(uint64_t seed) : random_(seed, 0, RandomPurpose::kTest) {}
  double in(double low, double high) { return random_.next_in(low, high); }
  glm::dvec3 vec(double size) { return {in(-size, size), in(-size, size), in(-size, size)}; }
  glm::dquat rotation() { return glm::normalize(glm::dquat(in(-1, 1), in(-1, 1), in(-1, 1), in(-1, 1))); }
  // Rotated, unevenly scaled, mirrored or sheared.
  glm::dmat3 linear() {
    const glm::dvec3 s(in(0.1, 3), in(0.1, 3), in(-3, -0.1));
    return glm::mat3_cast(rotation()) * glm::dmat3(s.x, 0, 0, 0, s.y, 0, 0, 0, s.z) * glm::mat3_cast(rotation());
  }

 private:
  CounterRandom random_;
};

// Triangles of about 0.4 m in a box of 4 m; half of them are see-through.
inline std::shared_ptr<const Geometry> random_soup(Draw& draw, uint32_t triangles) {
  MeshData mesh;
  for (uint32_t t = 0; t < triangles; ++t) {
    const glm::dvec3 at = draw.vec(2);
    for (uint32_t k = 0; k < 3; ++k) {
      mesh.positions.emplace_back(at + draw.vec(0.4));
      mesh.indices.push_back(3 * t + k);
    }
  }
  mesh.see_through_first_index = triangles / 2 * 3;
  return build_geometry(std::move(mesh)).value();
}

inline NewInstance placed(uint64_t id, std::shared_ptr<const Geometry> geometry, const Pose& pose = {}) {
  NewInstance made;
  made.id = id;
  made.geometry = std::move(geometry);
  made.pose = pose;
  return made;
}

inline void add(SceneMirror& mirror, NewInstance instance) {
  SceneDelta delta;
  delta.add = {std::move(instance)};
  ASSERT_TRUE(mirror.apply(delta, {}));
}

// Every triangle of the instances that collide, in the world.
inline std::vector<Triangle> world_triangles(const SceneMirror& mirror) {
  std::vector<Triangle> triangles;
  for (const Instance& i : mirror.instances()) {
    if (!i.geometry || !i.collides()) continue;
    const auto& g = *i.geometry;
    const auto corner = [&](size_t k) {
      return i.pose.position_m + i.pose.rotation * (i.linear * glm::dvec3(g.positions[g.indices[k]]));
    };
    for (size_t k = 0; k < g.indices.size(); k += 3) triangles.push_back({corner(k), corner(k + 1), corner(k + 2)});
  }
  return triangles;
}

}  // namespace sightline::test
