// The next leg of a way that the camera flies, and the velocity along it.
#include <algorithm>
#include <cmath>

#include "server/step/stages.h"

namespace sightline {

double way_length_m(const MoveInput& in, const glm::dvec3& from_m, std::span<const uint32_t> way) {
  double length_m = 0;
  glm::dvec3 last_m = from_m;
  for (const uint32_t candidate : way) {
    length_m += glm::distance(last_m, in.sights.position_m[candidate]);
    last_m = in.sights.position_m[candidate];
  }
  return length_m;
}

// On long ways only every second candidate is tried.
Leg first_leg(const MoveInput& in, std::span<const uint32_t> way, double body_radius_m) {
  const glm::dvec3 from_m = in.step.camera.pose.position_m;
  if (way.empty()) return {from_m, 0};
  StraightWays ways(in.surroundings.colliders, from_m, body_radius_m);
  size_t k = way.size() - 1;
  while (k > 0 && !ways.is_free(in.sights.position_m[way[k]])) k = k > 4 ? k - 2 : k - 1;
  return {in.sights.position_m[way[k]], way_length_m(in, from_m, way.subspan(k))};
}

glm::dvec3 velocity_along(const StepContext& step, const Leg& leg, const glm::dvec3& with_mps, const Pace& pace) {
  const double response_s = step.input.settings.move.move_response_s;
  CameraLimits braking = step.input.limits;
  braking.max_acceleration_mps2 *= pace.braking;
  const glm::dvec3 way_m = leg.to_m - step.camera.pose.position_m;
  const double distance_m = glm::length(way_m);
  glm::dvec3 wanted_mps = with_mps;
  if (distance_m > 1e-9) {
    const double arrival_mps = arrival_speed_mps(leg.length_m, braking, step.move_s);
    wanted_mps += way_m * (std::min(arrival_mps, leg.length_m / std::max(pace.closing * response_s, 2 * step.move_s)) /
                           distance_m);
  }
  return steer_velocity(step.camera, wanted_mps, step.input.limits, pace.response * response_s, step.move_s);
}

Tracking along(const StepContext& step, const Leg& leg, const Pace& pace) {
  return {.by = TrackBy::kLeg,
          .pace = pace,
          .vector = leg.to_m,
          .beyond_m = std::max(0.0, leg.length_m - glm::distance(step.camera.pose.position_m, leg.to_m))};
}

glm::dvec3 velocity_by(const StepContext& step, const Tracking& tracking, const glm::dvec3& desired_m) {
  const glm::dvec3 eye_m = step.camera.pose.position_m, still(0.0);
  const CameraLimits& limits = step.input.limits;
  const double response_s = step.input.settings.move.move_response_s;
  const auto leg_to = [&](const glm::dvec3& to_m, double beyond_m) {
    return Leg{to_m, glm::distance(eye_m, to_m) + beyond_m};
  };
  switch (tracking.by) {
    case TrackBy::kStop:
      return steer_velocity(step.camera, still, limits, 0.0, step.move_s);
    case TrackBy::kStay:
      return velocity_along(step, {eye_m, 0}, still, tracking.pace);
    case TrackBy::kFollow:
      return velocity_along(step, leg_to(desired_m + tracking.vector, tracking.beyond_m), group_velocity_mps(step),
                            tracking.pace);
    case TrackBy::kLeg:
      return velocity_along(step, leg_to(tracking.vector, tracking.beyond_m), still, tracking.pace);
    case TrackBy::kVelocity:
      return steer_velocity(step.camera, tracking.vector, limits, response_s, step.move_s);
    case TrackBy::kAcceleration:
      return steer_velocity(step.camera, step.camera.velocity_mps + tracking.vector * std::max(response_s, step.move_s),
                            limits, response_s, step.move_s);
  }
  return still;
}

}  // namespace sightline
