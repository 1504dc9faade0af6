// Bound: the ball in which the camera can be within the horizon (paper 3.1, design 3).
//
// The paper takes a sphere at c + dt v of radius n dt^2 a_max. At 60 Hz and 10 m/s^2 that radius is 2.8 mm, so the
// factor n does all the work. We take a horizon T instead: centre c + T v, radius min(a_max T^2 / 2, v_max T): every
// place that the camera can reach in T. n = radius / (dt^2 a_max) is then derived. `paper` mode takes (dt, a_max, n).
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

  bool contains(const glm::dvec3& p) const {
    return glm::dot(p - center_m, p - center_m) <= radius_m * radius_m;
  }
};

// `horizon_s` is settings.horizon_s, or longer while escaping. `dt_s` >= 0 is the tick's step, used by paper mode and
// to derive n. The centre is limited so that the ball still contains the camera: a fast camera keeps its own place
// among the candidates.
Bound bound_camera(const CameraState& camera, const CameraLimits& limits, const BoundSettings& settings,
                   double horizon_s, double dt_s);

// The least ball that contains `bound` and reaches from it `target_reach_m` metres towards a point, but no nearer to it than
// `nearest_m`; the bound itself when it reaches there already.
Bound extend_towards(const Bound& bound, const glm::dvec3& point_m, double target_reach_m, double nearest_m);

}  // namespace sightline
