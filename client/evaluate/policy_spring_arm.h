// The camera of most third-person games: an arm from the targets' centre, shortened where a sphere swept
// along it touches something, eased in and out as Unreal's spring arm and Cinemachine's follow do.
#pragma once

#include "client/truth/follow.h"
#include "client/evaluate/policy.h"
#include "server/scene/clearance.h"

namespace sightline {

struct SpringArmSettings {
  double sphere_m = 0.3;  // > 0; radius that is swept
  double in_s = 0.2;      // >= 0; time to close 99 % of the way in; 0: at once
  double out_s = 0.4;     // >= 0; and of the way out
};

// The arm's next length. `present_m` is negative before the first. Whatever the easing, the lens stays within
// the sphere that the sweep found free: the arm is never longer than `free_m` + 0.9 sphere_m, so it is never
// behind the surface that stopped the sphere.
double spring_arm_length_m(double present_m, double free_m, double dt_s, const SpringArmSettings& settings);

class SpringArmPolicy : public CameraPolicy {
 public:
  SpringArmPolicy(const PolicySite& site, std::unique_ptr<ScenarioWorld> world);
  // Sweeps from the targets' centre towards the follow camera's place, targets left out. A sphere that
  // overlaps something already at the centre leaves no arm at all.
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
