#include "client/evaluate/policy_spring_arm.h"

#include <algorithm>
#include <cmath>

#include "server/move/body.h"

namespace sightline {

double spring_arm_length_m(double present_m, double free_m, double dt_s, const SpringArmSettings& settings) {
  if (present_m < 0) return free_m;
  const double time_s = free_m < present_m ? settings.in_s : settings.out_s;
  const double share = time_s > 0 ? 1 - std::pow(0.01, dt_s / time_s) : 1.0;
  return std::min(present_m + share * (free_m - present_m), free_m + 0.9 * settings.sphere_m);
}

SpringArmPolicy::SpringArmPolicy(const PolicySite& site, std::unique_ptr<ScenarioWorld> world)
    : settings_(), lens_(site.scenario.lens()), world_(std::move(world)), follow_(*world_) {
  for (const ScenarioActor& actor : site.scenario.actors())
    if (actor.is_target) target_slots_.push_back(*world_->mirror().slot_of(actor.id));
  std::sort(target_slots_.begin(), target_slots_.end());
}

double SpringArmPolicy::free_arm_m(const glm::dvec3& center_m) {
  const double wanted = glm::length(follow_.offset_m());
  // Sightline's body keeps the same distance, so that rounding cannot turn a rest against a wall into a touch.
  const double sphere = settings_.sphere_m + kBodySkinM;
  colliders_.gather(world_->mirror(), center_m, wanted + 2 * sphere, target_slots_);
  return wanted * colliders_.free_fraction(center_m, center_m + follow_.offset_m(), sphere);
}

Result<PolicyStep> SpringArmPolicy::next(double time_s, double dt_s) {
  world_->set_time(time_s);
  const glm::dvec3 center_m = world_->targets_center_m();
  length_m_ = spring_arm_length_m(length_m_, free_arm_m(center_m), dt_s, settings_);
  PolicyStep step;
  step.camera = {center_m + glm::normalize(follow_.offset_m()) * length_m_, follow_.rotation()};
  step.lens = lens_;
  return step;
}

}  // namespace sightline
