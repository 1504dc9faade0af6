#include "client/evaluate/policy.h"

#include <array>

#include "client/truth/follow.h"
#include "client/evaluate/policy_raycast.h"
#include "client/evaluate/policy_spring_arm.h"
#include "client/evaluate/policy_step.h"
#include "server/step/presets.h"

namespace sightline {
namespace {

using MadePolicy = Result<std::unique_ptr<CameraPolicy>>;

class FollowPolicy : public CameraPolicy {
 public:
  FollowPolicy(const PolicySite& site, std::unique_ptr<ScenarioWorld> world)
      : lens_(site.scenario.lens()), world_(std::move(world)), follow_(*world_) {}

  Result<PolicyStep> next(double time_s, double) override {
    world_->set_time(time_s);
    PolicyStep step;
    step.camera = follow_.pose(*world_);
    step.lens = lens_;
    return step;
  }

 private:
  const Lens lens_;
  const std::unique_ptr<ScenarioWorld> world_;
  const FollowCamera follow_;
};

// A baseline: a camera in a world that it looks at for itself.
template <typename Policy>
MadePolicy make_in_world(const PolicySite& site) {
  auto world = ScenarioWorld::make(site.scenario, site.store, site.device);
  if (!world) return tl::unexpected(world.error());
  return std::make_unique<Policy>(site, std::move(*world));
}

// ---- presets of the step ----

StepSettings sightline_settings() {
  return preset_settings(Preset::kSightline);
}

StepSettings paper_settings() {
  return preset_settings(Preset::kPaper);
}

constexpr std::array<PolicyEntry, 5> kPolicies{{
    {"follow", "a fixed offset from the targets' centre; avoids nothing", &make_in_world<FollowPolicy>},
    {"spring-arm", "pulled in along its arm by a sphere sweep", &make_in_world<SpringArmPolicy>},
    {"raycast", "single rays to the targets' centres over the same candidates",
     &make_in_world<RaycastPolicy>},
    {"paper", "the method as printed: RobustMove, prediction 0.3 s, filter 6/10", &make_step<paper_settings>},
    {"sightline", "the default settings", &make_step<sightline_settings>},
}};

}  // namespace

Result<std::unique_ptr<CameraPolicy>> make_policy(const PolicyEntry& entry, const PolicySite& site) {
  return entry.settings ? make_step_policy(site, *entry.settings) : entry.make(site);
}

std::span<const PolicyEntry> policies() {
  return kPolicies;
}

const PolicyEntry* find_policy(std::string_view name) {
  for (const PolicyEntry& entry : kPolicies)
    if (entry.name == name) return &entry;
  return nullptr;
}

}  // namespace sightline
