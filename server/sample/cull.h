// What a map cannot show is not drawn: instances by bounding sphere, clusters by the geometry's tree, then single
// triangles (dropping one here costs far less than having a software renderer drop it). Pure functions on the CPU; nothing here knows OpenGL.
//
// A map is a few dozen sample points, not a picture: a cluster between them cannot show however plainly it stands in
// the frustum. Away from the eye that is most of a scene.
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

// True only when no point of the sphere is inside. `frustum` has unit normals.
bool sphere_is_outside(const Frustum& frustum, const glm::dvec3& center_m, double radius_m);

// A projection and the sample points behind it. For a position p = (xyz, 1) of the geometry,
// (dot(x, p), dot(y, p)) / dot(w, p) are sample coordinates: whole numbers in [0, width) x [0, height) are the sample
// points. dot(w, p) is the depth along the view axis; what lies before near_m is not seen.
struct SampleGrid {
  glm::vec4 x, y, w;
  float near_m;
  int width, height;
};
// clip_* are rows of clip_from_instance: (dot(clip_x, p), dot(clip_y, p)) / dot(clip_w, p) is [-1, 1] over the map.
SampleGrid sample_grid(const glm::dvec4& clip_x, const glm::dvec4& clip_y, const glm::dvec4& clip_w,
                       const MapView& view);

// One cluster of a geometry, and where in the map it can show: samples [x0, x1] x [y0, y1], nothing nearer than
// near_depth_m along the view axis.
struct VisibleCluster {
  uint32_t first_index = 0, index_count = 0;  // of Geometry::indices
  float near_depth_m = 0.0f;
  uint8_t x0 = 0, x1 = 0, y0 = 0, y1 = 0;
};
static_assert(kMaxMapSize <= 256);

// Appends every cluster with a triangle that covers a sample point, to within kFrustumMarginTexels, in the order of
// the tree; others may be among them.
void append_visible_clusters(const TriangleTree& tree, const SampleGrid& grid, std::vector<VisibleCluster>& clusters);

// Whether every sample that the cluster can show already shows something nearer. `depth_m` holds the depth along the
// view axis of each sample, row-major, `width` a row, +infinity where nothing is seen yet.
bool is_hidden(const VisibleCluster& cluster, const float* depth_m, int width);

// Appends to `indices` the three of Geometry::indices' positions i, i + 1, i + 2 for every triangle of the cluster that
// covers a sample point, to within kFrustumMarginTexels, and is not hidden; others may be among them.
void append_visible_triangles(const Geometry& geometry, const VisibleCluster& cluster, const SampleGrid& grid,
                              const float* depth_m, std::vector<uint32_t>& indices);

}  // namespace sightline
