// From "this texel shows that triangle" to a distance, in double. The rasteriser decides what is seen; how far it is
// follows from the geometry itself.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>

#include "server/sample/depth_map.h"
#include "server/scene/mirror.h"

namespace sightline {

// One triangle of one instance as one map sees it. Cheap to make; valid until the mirror changes.
class SeenTriangle {
 public:
  SeenTriangle() = default;
  // `vertex` is any of the triangle's three, counted in Geometry::indices; the instance is where it is in `ahead_s`.
  SeenTriangle(const MapView& view, const Instance& instance, double ahead_s, uint32_t vertex);

  // Depth along the view axis (multiples of `direction`, whose depth is one) of what the ray meets here. Rasterisers
  // round vertices (llvmpipe to 1/256 pixel), so the ray may pass a hair beside the triangle: then the instance's
  // other triangles at about that depth are asked, and when none is met, the edge of this one answers.
  double depth_along(const glm::dvec3& direction) const;

 private:
  const MapView* view_ = nullptr;
  const Instance* instance_ = nullptr;
  double ahead_s_ = 0.0;
  std::array<glm::dvec3, 3> corner_{};     // world, relative to the eye
  double nearest_ = 0.0, farthest_ = 0.0;  // depths of the corners, not before the near plane
};

}  // namespace sightline
