// Depth maps, taken from points on targets towards the bound (paper 3.2).
//
// Each texel holds the distance along its ray to the first occluder, and which occluder that is. The ray that passes
// nearest to a candidate camera position decides whether it sees the point: if the candidate is no deeper, along the
// view axis, than the ray's occluder.
//
// Depths are compared because walls and floors at right angles to the view axis then hide exactly what is behind them.
// Most of a level's are at right angles to a face of a cube map. If distances were compared, candidates close behind a
// wall would seem to see the point.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <limits>
#include <span>
#include <vector>

#include "server/base/error.h"
#include "server/base/transform.h"

namespace sightline {

inline constexpr uint32_t kNoOccluder = UINT32_MAX;
inline constexpr int kMaxMapSize = 64;     // texels a side
inline constexpr double kMapNearM = 0.01;  // occluders nearer than this to the point are ignored

// An off-axis pinhole. In the view frame the eye is at the origin, looks along -Z and has +Y up. The window is the
// rectangle [left, right] x [bottom, top] on the plane z = -1. Texels (x, y) count from the left and the bottom. Texel
// (x, y) shows the point
//   (left + (x + jitter.x) / width * (right - left), bottom + (y + jitter.y) / height * (top - bottom))
// of the window; jitter (0.5, 0.5) is the texel's centre.
struct MapView {
  glm::dvec3 eye_m{0.0};            // world
  glm::dmat3 world_from_view{1.0};  // rotation; columns are right, up, back
  double left = -1, right = 1, bottom = -1, top = 1;
  int width = 7, height = 7;    // [1, kMaxMapSize]
  glm::dvec2 jitter{0.5, 0.5};  // [0, 1) within every texel
  double near_m = kMapNearM;    // along the view axis, as a near plane
};

// World direction of the ray through the jittered texel (x, y); its length is one unit of depth along the view axis.
glm::dvec3 texel_direction(const MapView& view, int x, int y);
// The greatest length of such a direction.
double longest_direction(const MapView& view);

// A world point projected into a map.
struct MapPoint {
  double x = 0, y = 0;     // continuous texel coordinates: texel i covers [i, i + 1)
  double depth_m = 0;      // along the view axis
  bool in_window = false;  // in front of the eye and inside the window
};
MapPoint project(const MapView& view, const glm::dvec3& point_m);

// The column or row of the ray that passes nearest to a continuous texel coordinate, among `count` rays. That need not
// be the texel that contains the coordinate, whose ray may pass almost a whole texel away.
int nearest_ray(double coordinate, double jitter, int count);

// One map to be taken.
struct MapRequest {
  MapView view;
  uint32_t layer_mask = 0xFFFFFFFF;  // draws instances with (layers & layer_mask) != 0
  // Moving occluders are placed where their velocities take them in this time, in seconds, [0, 2].
  double ahead_s = 0.0;
  // The greatest depth along the view axis, in metres, at which occluders must be found. Texels may miss or confuse
  // occluders beyond it, so candidates beyond it must not be looked up. A sampler saves time by ending its search
  // there.
  double far_m = std::numeric_limits<double>::infinity();
  // Ascending mirror slots of instances to leave out; must outlive the call.
  std::span<const uint32_t> ignored_slots = {};
};

// Samplers compute in single precision, and Embree ends the process for a ray that is not finite or far beyond any
// scene. So every sampler refuses such requests before it casts a ray or draws: kInternal, since the sizes that a
// client may send (session/checks.h) lead to none.
Status check_castable(std::span<const MapRequest> requests);

// Row-major from the bottom row: texel (x, y) is at y * width + x.
struct DepthMap {
  MapView view;
  std::vector<float> distance_m;   // Euclidean, from the eye; +infinity where nothing occludes
  std::vector<uint32_t> occluder;  // mirror slot; kNoOccluder where nothing occludes
  double ahead_s = 0.0;            // as requested

  float distance_at(int x, int y) const { return distance_m[static_cast<size_t>(y) * view.width + x]; }
  uint32_t occluder_at(int x, int y) const { return occluder[static_cast<size_t>(y) * view.width + x]; }
  // distance_at as depth along the view axis.
  double depth_at(int x, int y) const { return distance_at(x, y) / glm::length(texel_direction(view, x, y)); }
};

}  // namespace sightline
