#include "server/bound/bound.h"

#include <algorithm>

namespace sightline {
namespace {

// The least radius. Frusta round a smaller ball are badly conditioned, and a camera that can hardly move still needs
// candidates.
constexpr double kMinRadiusM = 0.05;

}  // namespace

Bound bound_camera(const CameraState& camera, const CameraLimits& limits, const BoundSettings& settings,
                   double horizon_s, double dt_s) {
  const double a = limits.max_acceleration_mps2;
  const bool paper = settings.mode == BoundMode::kPaper;
  Bound bound;
  bound.horizon_s = paper ? dt_s : horizon_s;
  if (paper) {
    // An escape in paper mode multiplies the radius as the horizon grows (paper 3.1: "n can be dynamically
    // controlled").
    const double growth = horizon_s / settings.horizon_s;
    bound.radius_m = settings.paper_n * growth * dt_s * dt_s * a;
  } else {
    bound.radius_m = std::min(0.5 * a * horizon_s * horizon_s, limits.max_speed_mps * horizon_s);
  }
  bound.radius_m = std::max(bound.radius_m, kMinRadiusM);
  bound.paper_n = dt_s > 0 ? bound.radius_m / (dt_s * dt_s * a) : 0.0;

  glm::dvec3 ahead = bound.horizon_s * camera.velocity_mps;
  const double reach = 0.9 * bound.radius_m;
  if (const double length = glm::length(ahead); length > reach) ahead *= reach / length;
  bound.center_m = camera.pose.position_m + ahead;
  return bound;
}

Bound extend_towards(const Bound& bound, const glm::dvec3& point_m, double target_reach_m, double nearest_m) {
  const glm::dvec3 out = bound.center_m - point_m;
  const double middle = glm::length(out), near_side = std::max(nearest_m, middle - bound.radius_m - target_reach_m),
               far_side = middle + bound.radius_m;
  if (near_side >= middle - bound.radius_m) return bound;
  Bound extended = bound;
  extended.center_m = point_m + out * ((near_side + far_side) / 2 / middle);
  extended.radius_m = (far_side - near_side) / 2;
  if (bound.paper_n > 0) extended.paper_n *= extended.radius_m / bound.radius_m;
  return extended;
}

}  // namespace sightline
