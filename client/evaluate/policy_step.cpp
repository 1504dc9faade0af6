#include "client/evaluate/policy_step.h"

#include "server/session/session.h"

namespace sightline {
namespace {

class StepPolicy : public CameraPolicy {
 public:
  StepPolicy(const PolicySite& site, std::unique_ptr<Session> session)
      : scenario_(site.scenario), tick_s_(site.tick_s), session_(std::move(session)) {}

  Result<PolicyStep> next(double time_s, double dt_s) override {
    if (auto applied = session_->apply(tick_at(time_s, dt_s)); !applied)
      return tl::unexpected(applied.error());
    auto answer = session_->step();
    if (!answer) return tl::unexpected(answer.error());
    PolicyStep step;
    step.camera = answer->step.camera.pose;
    step.lens = answer->lens;
    step.jump = answer->cut || answer->step.flags.dt_capped;
    step.words.emplace();
    for (const TargetSight& sight : answer->step.targets)
      step.words->push_back({sight.id, sight.visible_share, sight.filtered_share});
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
  const std::unique_ptr<Session> session_;
  uint64_t sequence_ = 0;
};

Status add_scene(const Scenario& scenario, GeometryStore& store, SessionOptions& options) {
  std::vector<NodeBinding> bindings;
  for (const ScenarioActor& actor : scenario.actors()) {
    bindings.push_back({actor.name, actor.id});
    if (!actor.is_target) continue;
    Target& target = options.targets.emplace_back();
    target.instance_id = actor.id;
    target.weight = actor.weight;
    target.required = actor.required;
  }
  auto instances = instantiate(scenario.asset(), bindings, store);
  if (!instances) return tl::unexpected(instances.error());
  for (size_t i = 0; i < bindings.size(); ++i) (*instances)[i].moving = true;
  options.instances = std::move(*instances);
  options.scene_instances = options.instances.size();
  return {};
}

}  // namespace

Result<std::unique_ptr<CameraPolicy>> make_step_policy(const PolicySite& site, const StepSettings& settings) {
  SessionOptions options;
  options.seed = site.seed;
  options.camera = site.scenario.camera();
  options.lens = site.scenario.lens();
  options.limits = site.limits;
  options.settings = settings;
  options.extents = &site.extents;
  if (auto added = add_scene(site.scenario, site.store, options); !added)
    return tl::unexpected(added.error());
  // No stage clock: nothing that is measured in time may reach a figure.
  auto session = Session::open(std::move(options), site.samplers.make_sampler(), StageClock());
  if (!session) return tl::unexpected(session.error());
  return std::make_unique<StepPolicy>(site, std::move(*session));
}

}  // namespace sightline
