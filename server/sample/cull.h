// Culls boxes that cover none of a map's sample points, although they lie in its frustum. A map has only a few dozen
// sample points: far from the eye most of a scene lies between them. Pure functions on the CPU; nothing here uses
// OpenGL.
#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>

#include "server/base/transform.h"
#include "server/sample/depth_map.h"
#include "server/scene/geometry.h"

namespace sightline {

// Rasterisers round vertices to 1/256 of a pixel (GL_SUBPIXEL_BITS): an edge that passes this near to a sample point
// may end up on its other side.
inline constexpr double kSampleMarginTexels = 1.0 / 128;

// clip_from_view with the window shifted so that the centre of pixel (x, y) shows the jittered point of texel (x, y).
struct ClipMap {
  glm::dvec3 view_x, view_y, view_z;  // rows of view_from_world
  double scale_x, skew_x, scale_y, skew_y;
};
ClipMap clip_map(const MapView& view);

// Rows of clip_from_instance: clip = (dot(x, p), dot(y, p), near, dot(w, p)) for a position p = (xyz, 1) of an
// instance. Reversed z without a far plane: depth = near / w. Computed relative to the eye, in double.
struct ClipRows {
  glm::dvec4 x, y, w;
};
ClipRows clip_rows(const ClipMap& clip, const MapView& view, const Affine& world_from_instance);

// A projection and its sample points. A position p = (xyz, 1) has the sample coordinates (dot(x, p), dot(y, p)) /
// dot(w, p); the sample points are at whole numbers in [0, width) x [0, height). dot(w, p) is the depth along the view
// axis. Surfaces nearer than near_m are not seen.
struct SampleGrid {
  glm::vec4 x, y, w;
  float near_m;
  int width, height;
};
SampleGrid sample_grid(const ClipRows& rows, const MapView& view);

// The greatest errors of x, y and w of a SampleGrid when positions and rows are rounded to single precision.
struct GridSlack {
  float x, y, w;
};
// For positions within `bounds`.
GridSlack grid_slack(const SampleGrid& grid, const Aabb& bounds);

// The part of a map in which an object may appear: samples [x0, x1] x [y0, y1], no nearer than near_depth_m along the
// view axis.
struct Footprint {
  float near_depth_m = 0.0f;
  uint8_t x0 = 0, x1 = 0, y0 = 0, y1 = 0;
};
static_assert(kMaxMapSize <= 256);

// Tests boxes against one projection, with interval arithmetic.
class BoxTest {
 public:
  // `bounds` encloses every box that will be tested.
  BoxTest(const SampleGrid& grid, const Aabb& bounds);

  // False when no part of the box covers a sample point, to within kSampleMarginTexels. Otherwise sets `where`.
  bool may_show(const Aabb& box, Footprint& where) const;

  // True when a sample of the footprint may show a part of the box. Then the sample's ray passes through the box, to
  // within kSampleMarginTexels, and no nearer surface is known there. `hidden_from_m` is as in is_hidden.
  bool may_show_unhidden(const Aabb& box, const Footprint& where, const float* hidden_from_m) const;

  const SampleGrid& grid() const { return grid_; }
  const GridSlack& slack() const { return slack_; }

 private:
  // True when the box is outside one side of the pyramid of the samples' rays.
  bool is_beside(const Aabb& box) const;
  // The depth at which a sample's ray, as thick as the margin, enters the box; +infinity when it misses.
  float enters_at_m(const Aabb& box, int sample_x, int sample_y) const;

  SampleGrid grid_;
  GridSlack slack_;
  // The rows x, y and w side by side, so that one instruction handles all three: the columns of the projection, their
  // magnitudes, and the slack.
  std::array<std::array<float, 4>, 4> column_;
  std::array<std::array<float, 4>, 3> magnitude_;
  std::array<float, 4> play_;
  // The ray of sample (x, y) in the frame of the boxes: eye_ + depth (ray_x_ x + ray_y_ y + ray_).
  glm::vec3 eye_, ray_x_, ray_y_, ray_;
  glm::vec3 eye_play_;  // greatest rounding error of the eye and of positions
};

// Surfaces are ordered in single precision: one that is nearer by a smaller share than this does not count as hiding.
inline constexpr float kHidingMargin = 1e-3f;

// True when every sample of the footprint certainly shows something nearer. `hidden_from_m` holds for each sample
// (row-major, `width` to a row) the depth along the view axis beyond which nothing can be seen; +infinity where nothing
// is known.
bool is_hidden(const Footprint& footprint, const float* hidden_from_m, int width);

}  // namespace sightline
