// A camera policy steers a camera through a scenario, tick by tick: Sightline's own step under several settings, or one
// of the baselines that it is compared with (design 9). `policies()` lists the built-in ones.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "client/evaluate/reasons.h"
#include "client/scenario/scenario_world.h"
#include "client/truth/reports.h"
#include "server/move/asked_shot.h"
#include "server/sample/extent.h"
#include "server/sample/sampler.h"
#include "server/step/step.h"

namespace sightline {

// Where a policy works. All references must outlive it. Several policies on several threads may share one site.
struct PolicySite {
  const Scenario& scenario;  // with at least one target of weight > 0
  GeometryStore& store;
  EmbreeDevice& device;
  SamplerDevice& samplers;
  ExtentCache& extents;
  CameraLimits limits;
  double tick_s = 1.0 / 60.0;  // > 0; actors' velocities are taken over this time
  uint64_t seed = 1;
  // The extent of the run. Only a policy that knows the future reads it.
  size_t ticks = 1;              // calls of next(), at times k tick_s
  size_t ticks_per_picture = 1;  // every n-th is judged by a picture
};

struct PolicyStep {
  Pose camera;
  Lens lens;
  bool jump = false;  // see CameraFrame
  // The policy's reports in this tick. A policy that reports nothing leaves them empty.
  std::optional<std::vector<ReportedShare>> reports = std::nullopt;  // the visible shares of the targets
  std::optional<bool> tracking = std::nullopt;                       // whether its status is TRACKING
  std::optional<glm::dvec3> goal_m = std::nullopt;                   // world; the position that it heads for
  // the newest reason and the places that it speaks of; only at a tick with a picture
  std::optional<ReasonClaim> claim = std::nullopt;
  std::optional<AskedPlace> asked_place = std::nullopt;  // the place of its shot
  // whether it chose among the candidates of a pair volume (paper 3.3)
  std::optional<bool> pair_volume = std::nullopt;
};

// Deterministic: the same site and the same calls give the same answers. Used by one thread at a time.
class CameraPolicy {
 public:
  virtual ~CameraPolicy() = default;
  // The camera at `time_s` of the scene. Times never decrease; `dt_s` is the time since the last call, 0 at the first.
  virtual Result<PolicyStep> next(double time_s, double dt_s) = 0;
  // The greatest joint visible share that any camera could have in this run, estimated from above; only of policies
  // that know it.
  virtual std::optional<double> most_joint() const { return std::nullopt; }
  // The same of the mean worth of the pictures.
  virtual std::optional<double> most_worth() const { return std::nullopt; }
};

struct PolicyEntry {
  std::string name;
  std::function<Result<std::unique_ptr<CameraPolicy>>(const PolicySite& site)> make;
  AskedShot shot = {};  // its pictures are judged against this one; number 0: against the first picture's
};
// The built-in policies, in the order in which tables show them: follow, spring-arm, raycast, paper, sightline,
// ceiling, ceiling-worth.
std::vector<PolicyEntry> policies();
// Cameras that know the whole scenario in advance (client/ceiling/plan.h). The one shows all targets in as many
// pictures as it can, the other has pictures of as much worth as it can. They take about as long as the scene, so they
// play only when they are asked for.
std::vector<PolicyEntry> ceiling_policies();
inline constexpr std::string_view kCeilingName = "ceiling", kWorthCeilingName = "ceiling-worth";
inline bool is_ceiling(std::string_view policy) {
  return policy == kCeilingName || policy == kWorthCeilingName;
}
// A policy of Sightline's step under these settings.
PolicyEntry step_policy(std::string name, const StepSettings& settings, const AskedShot& shot = {});

// Reads NAME=JSON, where JSON holds `settings`, `tuning` and `shot` of an OpenSession message (session.proto), over the
// default preset. For example
//   calm={"settings":{"move_response_s":0.4},"tuning":{"aggregate":{"filter":{"mode":"JOINT","alpha":0.6,"n":10}}}}
// NAME consists of 1 to 32 letters, digits, '-' and '_'. Fields that are absent keep the preset's value, as in a
// session.
//
// Errors name the field: "settings" when the text is not NAME=JSON, "settings.calm" when JSON is no such message,
// "settings.calm.settings.move_response_s" when a value is out of range.
struct NamedSettings {
  std::string name;
  StepSettings settings;
  AskedShot shot;  // number 0: none
};
Result<NamedSettings> read_named_settings(const std::string& text);

}  // namespace sightline
