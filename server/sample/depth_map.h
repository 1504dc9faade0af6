// Depth maps: what a target sees when it looks towards the bound (paper 3.2, design 4).
//
// A map is a picture taken from a point on a target. Each texel holds the distance along its ray to the first occluder
// and which occluder that is. A candidate camera position sees the point exactly when it is nearer than the texel that
// it projects to.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <span>
#include <vector>

#include "server/base/transform.h"

namespace sightline {

inline constexpr uint32_t kNoOccluder = UINT32_MAX;
inline constexpr int kMaxMapSize = 64;     // texels a side
inline constexpr double kMapNearM = 0.01;  // occluders nearer than this to the point are not seen (design 4)

// An off-axis pinhole. View frame: the eye at the origin, looking along -Z, +Y up. The window is the rectangle
// [left, right] x [bottom, top] on the plane z = -1 of the view frame. Texel (x, y), x from the left, y from the
// bottom, shows the window point
//   (left + (x + jitter.x) / width * (right - left), bottom + (y + jitter.y) / height * (top - bottom)),
// jitter (0.5, 0.5) being the texel centre.
struct MapView {
  glm::dvec3 eye_m{0.0};            // world
  glm::dmat3 world_from_view{1.0};  // rotation; columns are right, up, back
  double left = -1, right = 1, bottom = -1, top = 1;
  int width = 7, height = 7;    // [1, kMaxMapSize]
  glm::dvec2 jitter{0.5, 0.5};  // [0, 1) within every texel
  double near_m = kMapNearM;    // along the view axis, as a near plane
};

// World direction, not normalised, of the ray through texel (x, y) as jittered: one unit of depth along the view axis.
glm::dvec3 texel_direction(const MapView& view, int x, int y);

// Where a world point falls in the map.
struct MapPoint {
  double x = 0, y = 0;     // continuous texel coordinates: texel i covers [i, i + 1)
  double distance_m = 0;   // from the eye, Euclidean
  bool in_window = false;  // in front of the eye and inside the window
};
MapPoint project(const MapView& view, const glm::dvec3& point_m);

// One map to be taken.
struct MapRequest {
  MapView view;
  uint32_t layer_mask = 0xFFFFFFFF;  // draws instances with (layers & layer_mask) != 0
  // Moving occluders are drawn where their velocities take them in this time, seconds, [0, 2]. The requests of one call
  // have at most one value besides 0.
  double ahead_s = 0.0;
  // What is farther than this from the eye need not be found: its texels may say that nothing occludes. Nobody may then look up a
  // place beyond it. A sampler that can end its search there saves most of it.
  double far_m = std::numeric_limits<double>::infinity();
  std::span<const uint32_t> ignored_slots =
      {};  // ascending mirror slots that are left out; must outlive the call
};

// Row-major from the bottom row: texel (x, y) is at y * width + x.
struct DepthMap {
  MapView view;
  std::vector<float> distance_m;   // Euclidean, from the eye; +infinity where nothing occludes
  std::vector<uint32_t> occluder;  // mirror slot; kNoOccluder where nothing occludes
  double ahead_s = 0.0;            // as requested

  float distance_at(int x, int y) const { return distance_m[static_cast<size_t>(y) * view.width + x]; }
  uint32_t occluder_at(int x, int y) const { return occluder[static_cast<size_t>(y) * view.width + x]; }
};

}  // namespace sightline
