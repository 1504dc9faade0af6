// What a map cannot see is not drawn: instances by bounding sphere, then clusters by the geometry's tree. Pure
// functions on the CPU; nothing here knows OpenGL.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/base/transform.h"
#include "server/sample/depth_map.h"
#include "server/scene/geometry.h"

namespace sightline {

// Five half-spaces: the near plane and four sides. A point p is inside plane (n, d) when dot(n, p) + d >= 0. There is
// no far plane. Normals have unit length in the world frame and any length in a local one.
struct Frustum {
  std::array<glm::dvec4, 5> planes;
};

// World frame. Encloses every texel's sample ray from the near plane on, not the whole window: it ends `margin` texels
// (of the map's own) outside the outermost sample points.
inline constexpr double kFrustumMarginTexels = 1.0 / 32;  // llvmpipe rounds vertices to 1/256 of a pixel
Frustum sample_frustum(const MapView& view);

// The same half-spaces in another frame.
Frustum to_local(const Frustum& frustum, const Affine& world_from_local);

// True only when no point of the sphere is inside. `frustum` has unit normals.
bool sphere_is_outside(const Frustum& frustum, const glm::dvec3& center_m, double radius_m);

// A piece of Geometry::indices.
struct IndexRange {
  uint32_t first_index = 0;
  uint32_t index_count = 0;
  bool operator==(const IndexRange&) const = default;
};

// Appends ranges of whole clusters to `ranges`, ascending: every cluster that has a triangle touching the frustum
// (local to the geometry) is covered. Ranges that touch are one; so are ranges with at most `bridge_indices` between
// them, because a draw costs more than a few culled triangles.
void append_visible_ranges(const TriangleTree& tree, const Frustum& local, uint32_t bridge_indices,
                           std::vector<IndexRange>& ranges);

}  // namespace sightline
