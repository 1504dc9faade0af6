// The ceilings as policies: each plans the whole run before its first step, and then plays the plan.
#include <algorithm>
#include <cmath>

#include "client/ceiling/plan.h"
#include "client/evaluate/policy.h"
#include "server/settings/step_settings.h"

namespace sightline {
namespace {

class CeilingPolicy : public CameraPolicy {
 public:
  CeilingPolicy(const PolicySite& site, PlanAim aim, CeilingPlan plan)
      : lens_(site.scenario.lens()), tick_s_(site.tick_s), aim_(aim), plan_(std::move(plan)) {}

  Result<PolicyStep> next(double time_s, double) override {
    const auto tick = static_cast<size_t>(std::lround(time_s / tick_s_));
    return PolicyStep{.camera = plan_.path[std::min(tick, plan_.path.size() - 1)], .lens = lens_, .reports = {}};
  }
  std::optional<double> most_joint() const override {
    return aim_ == PlanAim::kJoint ? std::optional(plan_.most) : std::nullopt;
  }
  std::optional<double> most_worth() const override {
    return aim_ == PlanAim::kWorth ? std::optional(plan_.most) : std::nullopt;
  }

 private:
  const Lens lens_;
  const double tick_s_;
  const PlanAim aim_;
  const CeilingPlan plan_;
};

// The ceilings keep the default's limits of distance and elevation, so that they can be compared with it.
Result<std::unique_ptr<CameraPolicy>> make_ceiling(const PolicySite& site, PlanAim aim) {
  PlanOptions options;
  options.aim = aim;
  const MoveSettings place_limits = preset_settings(Preset::kSightline).move;
  auto plan = plan_ceiling(site.scenario, site.store, site.device, site.extents,
                           timeline_of(site.tick_s, site.ticks, site.ticks_per_picture), site.limits, place_limits,
                           options);
  if (!plan) return tl::unexpected(plan.error());
  return std::make_unique<CeilingPolicy>(site, aim, std::move(*plan));
}

}  // namespace

std::vector<PolicyEntry> ceiling_policies() {
  const auto entry = [](std::string_view name, PlanAim aim) {
    return PolicyEntry{std::string(name), [aim](const PolicySite& site) { return make_ceiling(site, aim); }, {}};
  };
  return {entry(kCeilingName, PlanAim::kJoint), entry(kWorthCeilingName, PlanAim::kWorth)};
}

}  // namespace sightline
