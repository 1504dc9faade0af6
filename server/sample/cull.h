// What a map cannot show is not drawn: a box that covers none of its sample points is passed over with all that it holds, however
// plainly it stands in the frustum. A map is a few dozen sample points, not a picture: away from the eye most of a scene lies
// between them. Pure functions on the CPU; nothing here knows OpenGL.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>

#include "server/base/transform.h"
#include "server/sample/depth_map.h"
#include "server/scene/geometry.h"

namespace sightline {

// Rasterisers round vertices to 1/256 of a pixel (GL_SUBPIXEL_BITS): an edge that passes a sample point this near may turn out
// to lie on its other side.
inline constexpr double kSampleMarginTexels = 1.0 / 128;

// clip_from_view with the window shifted so that the centre of pixel (x, y) shows the jittered point of texel (x, y).
struct ClipMap {
  glm::dvec3 view_x, view_y, view_z;  // rows of view_from_world
  double scale_x, skew_x, scale_y, skew_y;
};
ClipMap clip_map(const MapView& view);

// Rows of clip_from_instance: clip = (dot(x, p), dot(y, p), near, dot(w, p)) for a position p = (xyz, 1) of an instance. That is
// reversed z without a far plane: depth = near / w. Worked out relative to the eye, in double.
struct ClipRows {
  glm::dvec4 x, y, w;
};
ClipRows clip_rows(const ClipMap& clip, const MapView& view, const Affine& world_from_instance);

// A projection and the sample points behind it. For a position p = (xyz, 1), (dot(x, p), dot(y, p)) / dot(w, p) are sample
// coordinates: whole numbers in [0, width) x [0, height) are the sample points. dot(w, p) is the depth along the view axis;
// what lies before near_m is not seen.
struct SampleGrid {
  glm::vec4 x, y, w;
  float near_m;
  int width, height;
};
SampleGrid sample_grid(const ClipRows& rows, const MapView& view);

// What the rounding of positions and rows to single precision can move x, y and w of a SampleGrid by.
struct GridSlack {
  float x, y, w;
};
// For positions within `bounds`.
GridSlack grid_slack(const SampleGrid& grid, const Aabb& bounds);

// Where in a map something can show: samples [x0, x1] x [y0, y1], nothing nearer than near_depth_m along the view axis.
struct Footprint {
  float near_depth_m = 0.0f;
  uint8_t x0 = 0, x1 = 0, y0 = 0, y1 = 0;
};
static_assert(kMaxMapSize <= 256);

// Asks one projection about boxes by interval arithmetic.
class BoxTest {
 public:
  // `bounds` encloses every box that will be asked about.
  BoxTest(const SampleGrid& grid, const Aabb& bounds);

  // False when no part of the box covers a sample point, to within kSampleMarginTexels. Else fills in where it can.
  bool may_show(const Aabb& box, Footprint& where) const;

  const SampleGrid& grid() const { return grid_; }
  const GridSlack& slack() const { return slack_; }

 private:
  // Wholly outside one side of the pyramid of the samples' rays.
  bool is_beside(const Aabb& box) const;

  SampleGrid grid_;
  GridSlack slack_;
  // The rows x, y and w side by side, so that one instruction serves all three: the columns of the projection, their magnitudes,
  // and the slack.
  std::array<std::array<float, 4>, 4> column_;
  std::array<std::array<float, 4>, 3> magnitude_;
  std::array<float, 4> play_;
};

// Surfaces are ordered in single precision: one that is so little nearer, relative, does not hide for certain.
inline constexpr float kHidingMargin = 1e-3f;

// Whether each sample of the footprint surely shows something nearer. `hidden_from_m` holds, row-major and `width` a row, the
// depth along the view axis from which on nothing can be seen; +infinity where nothing is known.
bool is_hidden(const Footprint& footprint, const float* hidden_from_m, int width);

}  // namespace sightline
