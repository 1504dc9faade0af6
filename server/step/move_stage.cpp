// The move stage: it chooses the goal, the velocity and the orientation of the camera (paper 3.4, 6).
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "server/move/keep_together.h"
#include "server/step/shot_in_force.h"
#include "server/step/stages.h"

namespace sightline {
namespace {

// See Decision::view_way_m.
std::optional<double> way_to_view_m(const MoveInput& in, const Choice& choice, const std::vector<uint32_t>& way) {
  if (choice.candidate < 0) return std::nullopt;
  const auto goal = static_cast<uint32_t>(choice.candidate);
  const std::span<const uint32_t> seen = in.sights.candidates.filtered();
  const auto sees = [&](uint32_t candidate) {
    return (seen[candidate] & in.step.targets.steered) != 0 || in.sights.hidden[candidate] < kAllHidden;
  };
  const glm::dvec3 from_m = in.step.camera.pose.position_m;
  for (size_t k = 0; k < way.size(); ++k) {
    if (!sees(way[k])) continue;
    const std::span<const uint32_t> to_view = std::span(way).first(k + 1);
    if (sees(static_cast<uint32_t>(in.sights.own_candidate))) return way_length_m(in, from_m, to_view);
    return first_leg(in, to_view, swept_radius_m(in.step.input.limits, in.step.lens)).length_m;
  }
  return sees(goal) ? std::optional(way_length_m(in, from_m, way)) : std::nullopt;
}

// Chooses the candidate to go to and the velocity. Sets the horizon, the goal, and what is expected to be seen on the
// way.
Course flight_course(const MoveInput& in, MoveScratch& scratch, Decision& decision) {
  Goal goal;
  if (in.step.targets.steered != 0) {
    goal = choose_goal(in, scratch);
    decision.goal_m = goal.position_m;
    decision.blind = goal.blind;
    decision.change = goal.change;
    decision.tracking = goal.tracking;
  }
  decision.horizon_s = next_horizon_s(in, goal.searches);
  decision.follows = goal.follows;
  decision.courses = goal.courses, decision.facts = goal.facts;
  decision.plan_m = goal.plan_m;
  decision.view_way_m = way_to_view_m(in, goal.choice, scratch.way);
  if (goal.way_m) decision.view_way_m = goal.way_m;
  decision.sees_none = goal.lost;
  scratch.way_m = way_length_m(in, in.step.camera.pose.position_m, scratch.way);
  return {goal.choice, in.step.targets.steered != 0 ? goal.velocity_mps : stopping_mps(in)};
}

// More than by rounding.
bool differ(const glm::dvec3& a_mps, const glm::dvec3& b_mps) {
  return glm::distance(a_mps, b_mps) > 1e-6;
}

// The nearest candidate that sees a target.
std::optional<glm::dvec3> nearest_view_m(const MoveInput& in, const glm::dvec3& from_m) {
  const CandidateSet& candidates = in.sights.candidates;
  const std::span<const uint32_t> seen = candidates.filtered();
  std::optional<glm::dvec3> nearest_m;
  double least_m = std::numeric_limits<double>::infinity();
  for (size_t i = 0; i < seen.size(); ++i) {
    if ((seen[i] & in.step.targets.steered) == 0) continue;
    const glm::dvec3 position_m = candidates.position_m[i];
    if (const double m = glm::distance(from_m, position_m); m < least_m) least_m = m, nearest_m = position_m;
  }
  return nearest_m;
}

// Adds what the velocity lacks to approach the viewer's camera at the speed of the pull. The velocity may hold some of
// the last step's pull already.
glm::dvec3 pulled(const MoveInput& in, const glm::dvec3& wanted_mps) {
  const double speed_mps = glm::length(in.carried.pull_mps);
  if (speed_mps == 0) return wanted_mps;
  const glm::dvec3 direction = in.carried.pull_mps / speed_mps;
  const double missing_mps = std::clamp(speed_mps - glm::dot(wanted_mps, direction), 0.0, speed_mps);
  return clamp_velocity(in.step.camera.velocity_mps, wanted_mps + missing_mps * direction, in.step.input.limits,
                        in.step.move_s);
}

void travel(const MoveInput& in, const glm::dvec3& wanted_mps, Decision& decision) {
  const CameraLimits& limits = in.step.input.limits;
  const Lens& lens = in.step.lens;
  CameraState& camera = decision.camera;
  const glm::dvec3 pulled_mps = pulled(in, wanted_mps);
  in.surroundings.colliders.allow(kMostTests);  // the choice of the goal may have used up its own
  const glm::dvec3 evading_mps = evade(camera, pulled_mps, limits, lens, in.surroundings.movers_ahead,
                                       in.surroundings.colliders, in.step.move_s);
  const bool blind = in.step.target_count() > 0 && in.seen_here == 0;
  const SafeMove safe = make_safe(camera, evading_mps, limits, lens, in.surroundings.colliders, in.step.move_s, blind);
  decision.wanted_mps = pulled_mps;
  decision.evading = differ(evading_mps, pulled_mps);
  decision.deflected = differ(safe.velocity_mps, evading_mps);
  decision.body_overlap = safe.overlap;
  decision.reason = safe.overlap ? MoveReason::kBodyOverlap : decision.course_reason;
  camera = moved(camera, safe.velocity_mps, in.step.move_s);
}

// The point of a target's body that is nearest to the middle of the picture. The body reaches about kBodyPart of its
// bounding sphere's radius to each side, as a standing person does.
glm::dvec3 innermost_m(const Pose& world_from_camera, const TrackedTarget& target) {
  constexpr double kBodyPart = 0.3;
  const double reach_m = kBodyPart * target.radius_m;
  glm::dvec3 at_m = inverse_transform_point(world_from_camera, target.aim_m);
  at_m.x -= std::clamp(at_m.x, -reach_m, reach_m);
  at_m.y -= std::clamp(at_m.y, -reach_m, reach_m);
  return transform_point(world_from_camera, at_m);
}

// Returns whether the picture shows at least a part of one of these targets.
bool shows_any(const Pose& world_from_camera, Lens lens, double room, std::span<const TrackedTarget> targets,
               uint32_t mask) {
  lens.vertical_fov_rad *= room;
  for (size_t i = 0; i < targets.size(); ++i)
    if (mask >> i & 1u && in_picture(world_from_camera, lens, innermost_m(world_from_camera, targets[i]))) return true;
  return false;
}

// A camera that follows aims at all steered targets if they fit in the picture, or if it shows at least one of those
// that it sees meanwhile. `had_all`: it aimed at all of them at the last step.
bool aims_at_all(const MoveInput& in, const Decision& decision, const Aim& all, uint32_t seen, bool had_all) {
  if (all.fits || seen == 0) return true;
  const auto shows = [&](const ViewAngles& angles, double room) {
    const Pose pose{decision.camera.pose.position_m, rotation_from_angles(angles)};
    return shows_any(pose, in.step.lens, room, in.step.targets.tracked_targets, seen);
  };
  return had_all ? shows(all.angles, 1.0) || shows(decision.turn.angles, 1.0) : shows(all.angles, kRoomToReturn);
}

// Aims at all steered targets. A camera that stays where it is leaves out the least important ones if the picture
// cannot hold all of them. A camera that follows is soon where it can, or has given them up (see give_up_targets). On
// its way there it leaves some out only if it would otherwise show none of those that it sees.
Aim choose_aim(const MoveInput& in, Decision& decision) {
  const StepContext& step = in.step;
  const AimRules rules = aim_rules(step);
  const std::span<const TrackedTarget> targets = step.targets.tracked_targets;
  const glm::dvec3 eye_m = decision.camera.pose.position_m;
  const ViewAngles& present = decision.turn.angles;
  const Aim all = aim_with_shot(step, in.carried.shot, eye_m, present);
  const uint32_t former = kept_before(step.targets, in.carried.not_aimed_at);
  const bool stays = step.input.settings.move.follow == Follow::kStay, had_all = former == step.targets.steered;
  const uint32_t of_late = seen_of_late(step, in.carried);
  // Those that are only beside the picture can be shown by turning.
  const uint32_t seen = stays ? step.targets.steered : of_late != 0 ? of_late : in.seen_here & step.targets.steered;
  if (stays ? all.fits && had_all : aims_at_all(in, decision, all, seen, had_all)) return all;
  const auto fit = [&, lens = widest(step.lens, rules.framing)](std::span<const TrackedTarget> kept, double room) {
    return fits_picture(eye_m, kept, present, lens, room, true);
  };
  TargetMemory memory;
  const uint32_t kept = keep_together(only_kept(targets, seen, memory), eye_m, former, std::cref(fit));
  if (kept == step.targets.steered) return all;
  decision.not_aimed_at = dropped_ids(step.targets, kept);
  return aim_at(eye_m, only_kept(targets, kept, memory), present, step.lens, rules);
}

// The time in which the camera answers an aim: shorter the nearer the aim is to the edge of the soft zone, and none
// outside.
double aim_response_s(const AimRules& rules, const Aim& aim) {
  constexpr double kHurriesFrom = 0.6;  // of the soft zone
  double calm = 1.0;
  for (int axis = 0; axis < 2; ++axis)
    if (const double zone = rules.soft_zone[axis]; zone > 0)
      calm = std::min(calm, std::clamp((zone - aim.off_half_pictures[axis]) / ((1 - kHurriesFrom) * zone), 0.0, 1.0));
  return calm * rules.framing.aim_response_s;
}

void turn(const MoveInput& in, Decision& decision) {
  const StepContext& step = in.step;
  const AimRules rules = aim_rules(step);
  const FramingSettings& framing = rules.framing;
  CameraState& camera = decision.camera;
  Aim aim{.angles = decision.turn.angles, .vertical_fov_rad = step.lens.vertical_fov_rad};
  if (step.targets.steered != 0) aim = choose_aim(in, decision);
  const glm::dquat before = camera.pose.rotation;
  decision.turn = turn_towards(decision.turn, aim.angles, step.input.limits, aim_response_s(rules, aim), step.move_s);
  camera.pose.rotation = rotation_from_angles(decision.turn.angles);
  const glm::dquat delta = camera.pose.rotation * glm::conjugate(before);
  camera.angular_velocity_radps = glm::axis(delta) *
                                  (std::remainder(glm::angle(delta), 2 * std::acos(-1.0)) / step.move_s);
  // The zoom responds as fast as the aim.
  const double share = framing.aim_response_s > 0 ? 1 - std::pow(0.01, step.move_s / framing.aim_response_s) : 1.0;
  double fov_rad = zooms(framing) ? aim.vertical_fov_rad : step.input.lens.vertical_fov_rad;
  if (step.targets.steered != 0)
    fov_rad = fov_for_size_rad(step, in.carried.shot, camera.pose.position_m).value_or(fov_rad);
  decision.vertical_fov_rad += share * (fov_rad - decision.vertical_fov_rad);
}

// The decision that leaves the camera as it is.
Decision unmoved(const MoveInput& in) {
  Decision decision;
  decision.camera = in.carried.camera;
  decision.turn = in.carried.turn;
  decision.vertical_fov_rad = in.carried.zoom.vertical_fov_rad;
  decision.horizon_s = in.carried.horizon_s;
  decision.goal_m = in.carried.goal_m;
  decision.follows = in.carried.follows;
  decision.blind = in.carried.blind;
  if (in.step.move_s <= 0) decision.not_aimed_at = in.carried.not_aimed_at, decision.change = in.carried.change;
  return decision;
}

}  // namespace

double next_horizon_s(const MoveInput& in, bool grows) {
  constexpr double kHorizonDoublingS = 0.25;  // the time in which it doubles or halves
  const double factor = std::exp2(in.step.decision_s / kHorizonDoublingS);
  return grows ? in.carried.horizon_s * factor : in.carried.horizon_s / factor;
}

glm::dvec3 stopping_mps(const MoveInput& in) {
  return steer_velocity(in.step.camera, glm::dvec3(0.0), in.step.input.limits, 0.0, in.step.move_s);
}

void gather_colliders(const StepContext& step, const Bound& bound, Surroundings& surroundings) {
  const CameraLimits& limits = step.input.limits;
  const glm::dvec3 position_m = step.camera.pose.position_m;
  const double body_m = swept_radius_m(limits, step.lens);
  const double reach_m = 2 * bound.radius_m + limits.max_speed_mps * step.move_s +
                         braking_distance_m(glm::dvec3(limits.max_speed_mps, 0, 0), limits);
  surroundings.colliders.gather(step.input.scene, position_m, std::min(reach_m, 2 * bound.radius_m + 20.0) + 2 * body_m,
                                {});
  surroundings.colliders.allow(kMostTests);
  for (size_t look = 0; look < kEvadeS.size(); ++look) {
    surroundings.movers_ahead[look].gather_movers(
        step.input.scene, position_m, limits.max_speed_mps * kEvadeS[look] + 2 * body_m + 1.0, {}, kEvadeS[look]);
    surroundings.movers_ahead[look].allow(kMostTests);
  }
}

Decision decide(const MoveInput& in, MoveScratch& scratch) {
  Decision decision = unmoved(in);
  if (in.step.move_s <= 0) {
    decision.reason = MoveReason::kPaused;
    decision.courses = in.carried.in_force.courses;
    return decision;
  }
  const Course course = follows_paper(in.step.input) ? paper_course(in, scratch, decision)
                                                     : flight_course(in, scratch, decision);
  decision.status = course.choice.status;
  decision.course_reason = course.choice.reason;
  decision.chosen_candidate = course.choice.candidate;
  travel(in, course.wanted_mps, decision);
  turn(in, decision);
  if (decision.sees_none) decision.nearest_view_m = nearest_view_m(in, decision.camera.pose.position_m);
  return decision;
}

Decision go_on(const MoveInput& in) {
  const DecisionInForce& last = in.carried.in_force;
  Decision decision = unmoved(in);
  decision.change = in.carried.change;
  decision.status = last.status, decision.course_reason = last.reason, decision.courses = last.courses;
  decision.view_way_m = last.view_way_m, decision.sees_none = last.sees_none,
  decision.nearest_view_m = last.nearest_view_m;
  decision.tracking = last.tracking;
  // The goal is where the camera will be after a fixed time, so it goes on with it.
  if (decision.goal_m) *decision.goal_m += in.step.camera.velocity_mps * in.step.move_s;
  travel(in, velocity_by(in.step, last.tracking, in.desired_m), decision);
  turn(in, decision);
  return decision;
}

}  // namespace sightline
