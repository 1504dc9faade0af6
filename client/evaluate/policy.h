// A camera policy: what steers a camera through a scenario, tick by tick. Sightline's own step under several
// settings, and the baselines that it is compared with (design 9).
//
// `policies()` is the one table of them all: a preset of the step is a line there.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "client/truth/metrics.h"
#include "client/scenario/scenario_world.h"
#include "server/sample/extent.h"
#include "server/sample/sampler.h"
#include "server/step/step.h"

namespace sightline {

// Where a policy works. All references must outlive it; several policies on several threads may share them.
struct PolicySite {
  const Scenario& scenario;  // with at least one target of weight > 0
  GeometryStore& store;
  EmbreeDevice& device;
  SamplerDevice& samplers;
  ExtentCache& extents;
  CameraLimits limits;
  double tick_s = 1.0 / 60.0;  // > 0; over which actors' velocities are taken
  uint64_t seed = 1;
};

struct PolicyStep {
  Pose camera;
  Lens lens;
  bool jump = false;  // see CameraFrame
  // What the policy says that its camera sees; none: it says nothing.
  std::optional<std::vector<ReportedShare>> words;
};

// Deterministic: the same site and calls give the same answers. One thread at a time.
class CameraPolicy {
 public:
  virtual ~CameraPolicy() = default;
  // The camera for the scene as it is at `time_s`. Times never go back; `dt_s` is the time since the call
  // before, 0 at the first.
  virtual Result<PolicyStep> next(double time_s, double dt_s) = 0;
};

struct PolicyEntry {
  std::string_view name;
  std::string_view summary;
  Result<std::unique_ptr<CameraPolicy>> (*make)(const PolicySite& site);
  // When given, Sightline's step under these settings, and `make` is not called. Must outlive the entry.
  const StepSettings* settings = nullptr;
};
Result<std::unique_ptr<CameraPolicy>> make_policy(const PolicyEntry& entry, const PolicySite& site);
// In the order in which tables and plots show them.
std::span<const PolicyEntry> policies();
// Null when there is no such policy.
const PolicyEntry* find_policy(std::string_view name);

}  // namespace sightline
