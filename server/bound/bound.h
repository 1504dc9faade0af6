// Bound: the ball in which the camera can be within the horizon (paper 3.1, design 3).
//
// The paper takes a sphere at c + dt v of radius n dt^2 a_max. At 60 Hz and 10 m/s^2 that radius is 2.8 mm, so the
// factor n does all the work. We take a horizon T instead: centre c + T v, radius min(a_max T^2 / 2, v_max T): every
// place that the camera can reach in T. n = radius / (dt^2 a_max) is then derived. `paper` mode takes (dt, a_max, n).
#pragma once

#include <glm/glm.hpp>

#include "server/base/camera.h"
#include "server/base/error.h"

namespace sightline {

enum class BoundMode { kHorizon, kPaper };

struct BoundSettings {
  BoundMode mode = BoundMode::kHorizon;
  double horizon_s = 0.5;  // [0.05, 2]; short: the camera finds no way round a pillar; long: coarse lattice
  double max_horizon_s = 2.0;  // [horizon_s, 2]; how far an escape may look
  double towards_m =
      0.0;  // [0, 100]; how far the ball also reaches towards the targets: nearer places are the way out of
            // most occlusions
  double paper_n = 300.0;  // [1, 1e6]; paper mode: the radius factor n
};

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

// The least ball that contains `bound` and reaches from it `towards_m` metres towards a point, but no nearer to it than
// `nearest_m`; the bound itself when it reaches there already.
Bound extend_towards(const Bound& bound, const glm::dvec3& point_m, double towards_m, double nearest_m);

// Names the first setting that is out of range, as "bound.<field>".
Status validate(const BoundSettings& settings);

}  // namespace sightline
