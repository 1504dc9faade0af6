// The bound: a ball that contains the positions that the camera can reach within the horizon (paper 3.1, design 3).
//
// The paper takes a sphere at c + dt v of radius n dt^2 a_max. At 60 Hz and 10 m/s^2 that radius is n * 2.8 mm, so only the factor n
// matters. Here the horizon T sets the ball instead: centre c + T v, radius min(a_max T^2 / 2, v_max T). The factor n is then derived as
// radius / (dt^2 a_max). BoundMode::kPaper, which exists only to reproduce the paper, takes (dt, a_max, n).
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

// The bound of a step. `horizon_s` is settings.horizon_s, or longer while escaping. `dt_s` >= 0 is the time step, used by paper mode and to
// derive n. The centre is limited so that the ball always contains the camera, whose own position is a candidate.
Bound bound_camera(const CameraState& camera, const CameraLimits& limits, const BoundSettings& settings,
                   double horizon_s, double dt_s);

// The smallest ball that contains `bound` and extends `towards_m` metres farther towards a point, but stays at least `nearest_m` away from
// the point. Returns the bound itself when it already reaches that far.
Bound extend_towards(const Bound& bound, const glm::dvec3& point_m, double towards_m, double nearest_m);

// Names the first setting that is out of range, as "bound.<field>".
Status validate(const BoundSettings& settings);

}  // namespace sightline
