// The camera of most third-person games: an arm from the targets' centre that is shortened where a sphere swept along
// it touches something. Its length eases in and out, as in Unreal's spring arm and Cinemachine's follow camera.
#pragma once

#include "client/evaluate/policy.h"
#include "client/truth/follow.h"
#include "server/scene/clearance.h"

namespace sightline {

struct SpringArmSettings {
  double sphere_m = 0.3;  // > 0; radius of the swept sphere
  double in_s = 0.2;      // >= 0; time to close 99 % of the distance inwards; 0: at once
  double out_s = 0.4;     // >= 0; the same outwards
};

// The arm's next length. `present_m` is its present length, negative before the first step; `free_m` is how far the
// sphere can be swept. The arm is never longer than `free_m` + 0.9 sphere_m, so the lens is never behind the surface
// that stopped the sphere.
double spring_arm_length_m(double present_m, double free_m, double dt_s, const SpringArmSettings& settings);

class SpringArmPolicy : public CameraPolicy {
 public:
  SpringArmPolicy(const PolicySite& site, std::unique_ptr<ScenarioWorld> world);
  // Sweeps from the targets' centre towards the follow camera's position and ignores the targets. When the sphere
  // overlaps something at the centre already, the arm has no length.
  Result<PolicyStep> next(double time_s, double dt_s) override;

 private:
  double free_arm_m(const glm::dvec3& center_m);

  const SpringArmSettings settings_;
  const Lens lens_;
  const std::unique_ptr<ScenarioWorld> world_;
  const FollowCamera follow_;
  std::vector<uint32_t> target_slots_;
  ClearanceField colliders_;
  double length_m_ = -1.0;
};

}  // namespace sightline
