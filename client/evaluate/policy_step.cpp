// Sightline's own step as a policy: a session in this process that gets the ticks which a game server would stream.
#include <algorithm>
#include <cctype>
#include <utility>

#include "client/base/wire_presets.h"
#include "client/evaluate/policy.h"
#include "server/session/session.h"
#include "server/settings/step_settings.h"
#include "server/wire/from_proto_shot.h"
#include "server/wire/from_proto_values.h"

namespace sightline {
namespace {

// The position that the last step heads for. A strategy without a goal of its own goes to the candidate that it chose.
std::optional<glm::dvec3> goal_of(const StepDump& dump) {
  const Decision& decision = dump.decision;
  if (decision.goal_m || decision.chosen_candidate < 0) return decision.goal_m;
  return dump.sights.candidates.position_m[static_cast<size_t>(decision.chosen_candidate)];
}

class StepPolicy : public CameraPolicy {
 public:
  StepPolicy(const PolicySite& site, std::unique_ptr<Session> session)
      : scenario_(site.scenario),
        tick_s_(site.tick_s),
        ticks_per_picture_(site.ticks_per_picture),
        limits_(site.limits),
        session_(std::move(session)) {}

  Result<PolicyStep> next(double time_s, double dt_s) override {
    TickInput tick = tick_at(time_s, dt_s);
    if (scenario_.targets_change(std::exchange(last_s_, time_s), time_s)) tick.targets = targets_at(scenario_, time_s);
    if (auto applied = session_->apply(tick); !applied) return tl::unexpected(applied.error());
    auto answer = session_->step();
    if (!answer) return tl::unexpected(answer.error());
    PolicyStep step;
    step.camera = answer->step.camera.pose;
    step.lens = answer->lens;
    step.jump = answer->cut || answer->step.flags.dt_capped;
    step.tracking = answer->step.status == TrackingStatus::kTracking;
    step.goal_m = goal_of(session_->dump());
    step.pair_volume = answer->step.volume == Volume::kPair;
    step.reports.emplace();
    if (session_->dump().decided) claim_ = claim_of(session_->dump(), time_s, swept_radius_m(limits_, answer->lens));
    if ((sequence_ - 1) % ticks_per_picture_ == 0) step.claim = claim_;
    if (const auto& shot = answer->step.shot)
      step.asked_place = {time_s, shot->place_m, shot->soon_target, shot->soon_s};
    for (const TargetSight& sight : answer->step.targets)
      step.reports->push_back({sight.id, sight.visible_share, sight.filtered_share});
    return step;
  }

 private:
  TickInput tick_at(double time_s, double dt_s) {
    TickInput tick;
    tick.sequence = ++sequence_;
    tick.time_s = time_s;
    tick.dt_s = dt_s;
    const std::vector<ActorMotion> motion = scenario_.motion_at(time_s, tick_s_);
    for (size_t i = 0; i < motion.size(); ++i) {
      tick.transforms.ids.push_back(scenario_.actors()[i].id);
      tick.transforms.poses.push_back(motion[i].pose);
      tick.transforms.velocities_mps.push_back(motion[i].velocity_mps);
    }
    return tick;
  }

  const Scenario& scenario_;
  const double tick_s_;
  const size_t ticks_per_picture_;
  const CameraLimits limits_;
  const std::unique_ptr<Session> session_;
  uint64_t sequence_ = 0;
  double last_s_ = 0.0;
  std::optional<ReasonClaim> claim_;  // of the newest decision
};

Status add_scene(const Scenario& scenario, GeometryStore& store, SessionOptions& options) {
  std::vector<NodeBinding> bindings;
  for (const ScenarioActor& actor : scenario.actors()) {
    bindings.push_back({actor.name, actor.id});
  }
  options.targets = targets_at(scenario, 0.0);
  auto instances = instantiate(scenario.asset(), bindings, store);
  if (!instances) return tl::unexpected(instances.error());
  for (size_t i = 0; i < bindings.size(); ++i) (*instances)[i].moving = true;
  options.instances = std::move(*instances);
  options.scene_instances = options.instances.size();
  return {};
}

Result<std::unique_ptr<CameraPolicy>> make_step_policy(const PolicySite& site, const StepSettings& settings,
                                                       const AskedShot& shot) {
  SessionOptions options;
  options.seed = site.seed;
  options.camera = site.scenario.camera();
  options.lens = site.scenario.lens();
  options.limits = site.limits;
  if (settings.move.strategy != Strategy::kMinCost) options.limits.max_jerk_mps3 = 0;  // the paper has no such limit
  options.settings = settings;
  options.shot = shot;
  options.extents = &site.extents;
  if (auto added = add_scene(site.scenario, site.store, options); !added) return tl::unexpected(added.error());
  // Without a stage clock, no measured time can reach a figure.
  auto session = Session::open(std::move(options), site.samplers.make_sampler(), StageClock());
  if (!session) return tl::unexpected(session.error());
  return std::make_unique<StepPolicy>(site, std::move(*session));
}

constexpr size_t kLongestName = 32;

bool is_name(const std::string& name) {
  return !name.empty() && name.size() <= kLongestName && std::all_of(name.begin(), name.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '-' || c == '_';
  });
}

}  // namespace

PolicyEntry step_policy(std::string name, const StepSettings& settings, const AskedShot& shot) {
  return {std::move(name), [settings, shot](const PolicySite& site) { return make_step_policy(site, settings, shot); },
          shot};
}

Result<NamedSettings> read_named_settings(const std::string& text) {
  const size_t equals = text.find('=');
  NamedSettings named{.name = text.substr(0, equals), .settings = preset_settings(Preset::kSightline), .shot = {}};
  if (equals == std::string::npos || !is_name(named.name))
    return invalid("settings", "must be NAME=JSON, NAME being 1 to 32 letters, digits, '-' or '_'");
  const std::string field = std::string("settings.").append(named.name);
  const auto wire = settings_from_json(text.substr(equals + 1));
  if (!wire) return invalid(field, wire.error().message);
  if (Status ok = read_settings(wire->settings(), wire->tuning(), field + ".", named.settings); !ok)
    return tl::unexpected(ok.error());
  if (wire->has_shot()) {
    if (Status ok = read_shot(wire->shot(), gltf_convention(), Lens{}.aspect, field + ".shot", named.shot); !ok)
      return tl::unexpected(ok.error());
    named.shot.number = 1;
  }
  if (Status ok = validate(named.settings); !ok)
    return fail(ok.error().code, std::string(field).append(".").append(ok.error().field), ok.error().message);
  return named;
}

}  // namespace sightline
