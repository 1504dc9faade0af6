// Computes in double how far a triangle is along a texel's ray. The rasteriser decides which triangle is seen; its
// distance follows from the geometry.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>

#include "server/sample/depth_map.h"
#include "server/scene/mirror.h"

namespace sightline {

// One triangle of an instance, seen from one map. Cheap to make; valid until the mirror changes.
class SeenTriangle {
 public:
  SeenTriangle() = default;
  // `vertex` is the position of any of its vertices in Geometry::indices. The instance is placed where it is in
  // `ahead_s` seconds.
  SeenTriangle(const MapView& view, const Instance& instance, double ahead_s, uint32_t vertex);

  // Depth along the view axis at which the ray hits the triangle, in multiples of `direction`, whose depth is one.
  // Rasterisers round vertices (llvmpipe to 1/256 pixel), so the ray may pass just beside the triangle. Then the
  // instance's other triangles at about that depth are tested; when none is hit, the depth of this triangle's edge is
  // returned.
  double depth_along(const glm::dvec3& direction) const;

 private:
  const MapView* view_ = nullptr;
  const Instance* instance_ = nullptr;
  double ahead_s_ = 0.0;
  std::array<glm::dvec3, 3> corner_{};     // world, relative to the eye
  double nearest_ = 0.0, farthest_ = 0.0;  // depths of the corners, at least the near plane's depth
};

}  // namespace sightline
