// The ceiling as a policy: plans the whole run before its first step, and then plays the plan.
#include <algorithm>
#include <cmath>

#include "client/ceiling/plan.h"
#include "client/evaluate/policy.h"
#include "server/settings/step_settings.h"

namespace sightline {
namespace {

class CeilingPolicy : public CameraPolicy {
 public:
  CeilingPolicy(const PolicySite& site, CeilingPlan plan)
      : lens_(site.scenario.lens()), tick_s_(site.tick_s), plan_(std::move(plan)) {}

  Result<PolicyStep> next(double time_s, double) override {
    const auto tick = static_cast<size_t>(std::lround(time_s / tick_s_));
    return PolicyStep{.camera = plan_.path[std::min(tick, plan_.path.size() - 1)], .lens = lens_, .reports = {}};
  }
  std::optional<double> most_joint() const override { return plan_.most_joint; }

 private:
  const Lens lens_;
  const double tick_s_;
  const CeilingPlan plan_;
};

// The ceiling keeps the default's limits of distance and elevation, so that both can be compared.
Result<std::unique_ptr<CameraPolicy>> make_ceiling(const PolicySite& site) {
  const MoveSettings place_limits = preset_settings(Preset::kSightline).move;
  auto plan = plan_ceiling(site.scenario, site.store, site.device, site.extents,
                           timeline_of(site.tick_s, site.ticks, site.ticks_per_picture), site.limits, place_limits);
  if (!plan) return tl::unexpected(plan.error());
  return std::make_unique<CeilingPolicy>(site, std::move(*plan));
}

}  // namespace

PolicyEntry ceiling_policy() {
  return {std::string(kCeilingName), make_ceiling};
}

}  // namespace sightline
