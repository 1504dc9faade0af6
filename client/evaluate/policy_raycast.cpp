#include "client/evaluate/policy_raycast.h"

#include <algorithm>
#include <cmath>

#include "server/bound/bound.h"

namespace sightline {
namespace {

// As in the step, the horizon doubles in this time while no candidate sees all targets.
constexpr double kHorizonDoublingS = 0.25;

glm::dvec3 nearest_in_bound(const Bound& bound, const glm::dvec3& point_m) {
  const glm::dvec3 out = point_m - bound.center_m;
  const double distance = glm::length(out), reach = bound.radius_m * (1 - 1e-9);
  return distance <= reach ? point_m : bound.center_m + out * (reach / distance);
}

// A baseline has no limit of the jerk.
PolicySite without_jerk_limit(PolicySite site) {
  site.limits.max_jerk_mps3 = 0;
  return site;
}

}  // namespace

void trace_visibility(const EmbreeScene& occluders, const SceneMirror& mirror, std::span<const Target> targets,
                      CandidateSet& candidates) {
  std::fill(candidates.visible_targets.begin(), candidates.visible_targets.end(), 0u);
  for (size_t k = 0; k < targets.size(); ++k) {
    const glm::dvec3 aim = aim_point_m(*mirror.find(targets[k].instance_id));
    const uint32_t own = *mirror.slot_of(targets[k].instance_id);
    RayFilter filter;
    filter.layer_mask = targets[k].layer_mask;
    filter.ignored_slots = std::span(&own, 1);
    for (size_t i = 0; i < candidates.size(); ++i) {
      const glm::vec3 way(candidates.position_m[i] - aim);
      if (!occluders.is_blocked(aim, way, 0.0f, 1.0f, filter)) candidates.visible_targets[i] |= 1u << k;
    }
  }
}

RaycastPolicy::RaycastPolicy(const PolicySite& site, std::unique_ptr<ScenarioWorld> world)
    : site_(without_jerk_limit(site)),
      settings_(),
      lens_(site.scenario.lens()),
      world_(std::move(world)),
      offset_m_(site.scenario.camera().position_m - world_->targets_center_m()),
      horizon_s_(settings_.bound.horizon_s) {
  camera_.pose = site.scenario.camera();
  turn_.angles = angles_from_rotation(camera_.pose.rotation);
}

void RaycastPolicy::update_views() {
  views_.clear();
  for (const Target& target : world_->targets()) {
    const Instance& instance = *world_->mirror().find(target.instance_id);
    views_.push_back({.aim_m = aim_point_m(instance),
                      .radius_m = instance.radius_m,
                      .weight = target.weight,
                      .required = target.required});
  }
}

void RaycastPolicy::list_candidates(const Bound& bound, const glm::dvec3& desired_m) {
  lattice_.cover(bound, settings_.aggregate.candidates);
  candidates_.clear();
  for (const glm::dvec3& position : lattice_.positions_m()) candidates_.add(position);
  candidates_.add(camera_.pose.position_m);
  candidates_.add(nearest_in_bound(bound, desired_m));
  trace_visibility(world_->occluders(), world_->mirror(), world_->targets(), candidates_);
  candidates_.filtered_targets = candidates_.visible_targets;
}

Choice RaycastPolicy::choose(const Bound& bound, const glm::dvec3& desired_m) {
  const glm::dvec3 from = camera_.pose.position_m;
  const double body = swept_radius_m(site_.limits, lens_);
  const double brake = braking_distance_m({site_.limits.max_speed_mps, 0, 0}, site_.limits);
  colliders_.gather(world_->mirror(), from,
                    2 * bound.radius_m + site_.limits.max_speed_mps * kMaxStepS + brake + 2 * body, {});
  StraightWays ways(colliders_, from, body);
  const Reachable reachable = [&](const glm::dvec3& position) { return ways.is_free(position); };
  return choose_basic(candidates_, views_, desired_m, 0.0, settings_.move, reachable, scratch_);
}

void RaycastPolicy::travel(const Choice& choice, double dt_s) {
  glm::dvec3 wanted = clamp_velocity(camera_.velocity_mps, glm::dvec3(0.0), site_.limits, dt_s);
  if (choice.candidate >= 0) {
    const glm::dvec3 with = choice.reason == MoveReason::kAtDesiredPlace ? center_velocity_mps_ : glm::dvec3(0.0);
    wanted = velocity_towards(camera_, candidates_.position_m[choice.candidate], with, site_.limits, dt_s);
  }
  camera_.velocity_mps = make_safe(camera_, wanted, site_.limits, lens_, colliders_, dt_s).velocity_mps;
  camera_.pose.position_m += camera_.velocity_mps * dt_s;
  const Aim aim = aim_at(camera_.pose.position_m, views_, turn_.angles, lens_, {.framing = settings_.framing});
  turn_ = turn_towards(turn_, aim.angles, site_.limits, settings_.framing.aim_response_s, dt_s);
  camera_.pose.rotation = rotation_from_angles(turn_.angles);
}

Result<PolicyStep> RaycastPolicy::next(double time_s, double dt_s) {
  const glm::dvec3 before_m = world_->targets_center_m();
  world_->set_time(time_s);
  update_views();
  PolicyStep step;
  if (dt_s > 0) {
    center_velocity_mps_ = (world_->targets_center_m() - before_m) / dt_s;
    const Bound bound = bound_camera(camera_, site_.limits, settings_.bound, horizon_s_, dt_s);
    const glm::dvec3 desired_m = desired_place_m(views_, offset_m_, lens_, settings_.framing.framing_margin,
                                                 settings_.move);
    list_candidates(bound, desired_m);
    const Choice choice = choose(bound, desired_m);
    const double factor = std::exp2(dt_s / kHorizonDoublingS);
    horizon_s_ *= choice.status == MoveStatus::kTracking ? 1 / factor : factor;
    horizon_s_ = std::clamp(horizon_s_, settings_.bound.horizon_s, settings_.bound.max_horizon_s);
    travel(choice, dt_s);
    if (choice.candidate >= 0) step.goal_m = candidates_.position_m[static_cast<size_t>(choice.candidate)];
  }
  step.camera = camera_.pose;
  step.lens = lens_;
  return step;
}

}  // namespace sightline
