// The bound: a ball that contains the positions that the camera can reach within the horizon (paper 3.1, design 3).
//
// The paper takes a sphere at c + dt v of radius n dt^2 a_max. At 60 Hz and 10 m/s^2 that radius is n * 2.8 mm, so only
// the factor n matters. Here the horizon T sets the ball instead: centre c + T v, radius min(a_max T^2 / 2, v_max T).
// The factor n is then derived as radius / (dt^2 a_max). BoundMode::kPaper, which exists only to reproduce the paper,
// takes (dt, a_max, n).
#pragma once

#include <glm/glm.hpp>

#include "server/base/camera.h"
#include "server/settings/bound_settings.h"
#include "server/settings/camera_limits.h"

namespace sightline {

struct Bound {
  glm::dvec3 center_m{0.0};
  double radius_m = 0.0;   // > 0
  double horizon_s = 0.0;  // what the bound was made for (dt in paper mode)
  double paper_n = 0.0;    // radius / (dt^2 a_max); 0 when dt is 0

  bool contains(const glm::dvec3& p) const { return glm::dot(p - center_m, p - center_m) <= radius_m * radius_m; }
};

// The bound of a step. `horizon_s` is settings.horizon_s, or longer while escaping. `dt_s` >= 0 is the time step, used
// by paper mode and to derive n. The centre is limited so that the ball always contains the camera, whose own position
// is a candidate.
Bound bound_camera(const CameraState& camera, const CameraLimits& limits, const BoundSettings& settings,
                   double horizon_s, double dt_s);

// The smallest ball that contains `bound` and extends `target_reach_m` metres farther towards a point, but stays at
// least `nearest_m` away from the point. Returns the bound itself when it already reaches that far.
Bound extend_towards(const Bound& bound, const glm::dvec3& point_m, double target_reach_m, double nearest_m);

}  // namespace sightline
