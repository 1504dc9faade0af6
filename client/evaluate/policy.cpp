#include "client/evaluate/policy.h"

#include "client/evaluate/policy_raycast.h"
#include "client/evaluate/policy_spring_arm.h"
#include "client/truth/follow.h"
#include "server/settings/step_settings.h"

namespace sightline {
namespace {

class FollowPolicy : public CameraPolicy {
 public:
  FollowPolicy(const PolicySite& site, std::unique_ptr<ScenarioWorld> world)
      : lens_(site.scenario.lens()), world_(std::move(world)), follow_(*world_) {}

  Result<PolicyStep> next(double time_s, double) override {
    world_->set_time(time_s);
    return PolicyStep{.camera = follow_.pose(*world_), .lens = lens_};
  }

 private:
  const Lens lens_;
  const std::unique_ptr<ScenarioWorld> world_;
  const FollowCamera follow_;
};

// A baseline has a world of its own, in which it traces rays.
template <typename Policy>
PolicyEntry baseline(std::string name) {
  const auto make = [](const PolicySite& site) -> Result<std::unique_ptr<CameraPolicy>> {
    auto world = ScenarioWorld::make(site.scenario, site.store, site.device);
    if (!world) return tl::unexpected(world.error());
    return std::make_unique<Policy>(site, std::move(*world));
  };
  return {std::move(name), make, {}};
}

}  // namespace

std::vector<PolicyEntry> policies() {
  std::vector<PolicyEntry> entries{baseline<FollowPolicy>("follow"), baseline<SpringArmPolicy>("spring-arm"),
                                   baseline<RaycastPolicy>("raycast"),
                                   step_policy("paper", preset_settings(Preset::kPaper)),
                                   step_policy("sightline", preset_settings(Preset::kSightline))};
  for (PolicyEntry& ceiling : ceiling_policies()) entries.push_back(std::move(ceiling));
  return entries;
}

}  // namespace sightline
