#include "server/session/answer_check.h"

#include <cmath>

namespace sightline {
namespace {

bool is_finite(const Pose& pose) {
  return sightline::is_finite(pose.position_m) && sightline::is_finite(pose.rotation);
}

bool is_finite(const TargetSight& target) {
  const bool numbers = std::isfinite(target.visible_share) && std::isfinite(target.filtered_share) &&
                       std::isfinite(target.picture_share) && std::isfinite(target.distance_m);
  if (!target.forecast) return numbers;
  const SightForecast& forecast = *target.forecast;
  return numbers && std::isfinite(forecast.ahead_s) && std::isfinite(forecast.share) &&
         std::isfinite(forecast.confidence) && std::isfinite(forecast.loss_s.value_or(0.0));
}

// The first that is not finite; null: all are.
const char* not_finite(const SessionAnswer& answer) {
  const CameraState& camera = answer.step.camera;
  if (!is_finite(camera.pose)) return "the camera's pose";
  if (!sightline::is_finite(camera.velocity_mps) || !sightline::is_finite(camera.acceleration_mps2))
    return "the camera's velocity";
  if (!sightline::is_finite(camera.angular_velocity_radps)) return "the camera's angular velocity";
  if (!std::isfinite(answer.lens.vertical_fov_rad)) return "the field of view";
  if (!is_finite(answer.target_from_camera) || !is_finite(answer.unrotated_from_camera))
    return "the camera's pose as seen from a target";
  if (!std::isfinite(answer.step.view_s.value_or(0.0))) return "the time until the camera sees a target";
  if (const auto& shot = answer.step.shot;
      shot &&
      !(std::isfinite(shot->worth) && std::isfinite(shot->asked.distance_m) && std::isfinite(shot->now.distance_m)))
    return "what is given up of the shot";
  for (const TargetSight& target : answer.step.targets)
    if (!is_finite(target)) return "what is seen of a target";
  return nullptr;
}

}  // namespace

Status check_finite(const SessionAnswer& answer) {
  const char* const number = not_finite(answer);
  if (!number) return {};
  return fail(ErrorCode::kInternal, "", std::string(number) + " is not a finite number");
}

}  // namespace sightline
