// The fourth stage: the goal, the way there, and the way to look (paper 3.4, 6).
#include <algorithm>
#include <cmath>
#include <functional>

#include "server/step/step_work.h"

namespace sightline {
namespace {

// The horizon doubles in this time while nothing is seen, and halves in it once something is (design 3).
constexpr double kHorizonDoublingS = 0.25;

void gather_colliders(StepWork& w) {
  const glm::dvec3 place = w.memory.camera.pose.position_m;
  const double body = swept_radius_m(w.input.limits, w.lens);
  const double reach = 2 * w.memory.bound.radius_m + w.input.limits.max_speed_mps * w.move_s +
                       braking_distance_m(glm::dvec3(w.input.limits.max_speed_mps, 0, 0), w.input.limits);
  w.memory.colliders.gather(w.input.scene, place,
                            std::min(reach, 2 * w.memory.bound.radius_m + 20.0) + 2 * body, {});
  for (size_t look = 0; look < kEvadeS.size(); ++look)
    w.memory.movers_ahead[look].gather_movers(w.input.scene, place,
                                              w.input.limits.max_speed_mps * kEvadeS[look] + 2 * body + 1.0,
                                              {}, kEvadeS[look]);
}

// With a prediction what is hidden from the targets as they will be counts as hidden, while some place is free of both: else the
// camera would go to the very rim of what is about to be hidden, and begin slowly.
void leave_out_hidden_ahead(StepWork& w) {
  if (w.memory.ahead_s <= 0) return;
  const std::span<const uint32_t> ahead = w.memory.candidates.ahead();
  const auto seen_ahead = [&](size_t i) { return (ahead[i] & w.steered) == w.steered; };
  bool any = false;
  for (size_t i = 0; i < ahead.size(); ++i) any |= w.memory.members[i] && seen_ahead(i);
  if (!any) return;
  for (size_t i = 0; i < ahead.size(); ++i)
    if (!seen_ahead(i)) w.memory.members[i] = 0;
}

void set_robust_costs(StepWork& w, const glm::dvec3& desired) {
  StepMemory& m = w.memory;
  list_all_visible(w);
  leave_out_hidden_ahead(w);
  find_groups(m.cells, m.place_m, m.members, desired, m.group_scratch, m.groups);
  measure_shelter(m.cells, m.members, m.shelter_scratch, m.shelter_squared);
  robust_costs(m.place_m, desired, m.groups, m.shelter_squared, m.cost);
}

Choice choose(StepWork& w) {
  if (w.steered == 0) return {MoveStatus::kHolding, MoveReason::kNoTargets, -1};
  const glm::dvec3 from = w.memory.camera.pose.position_m, desired = desired_place(w);
  if (w.input.settings.move.strategy == Strategy::kMinCost) return choose_goal(w, desired);
  StraightWays ways(w.memory.colliders, from, swept_radius_m(w.input.limits, w.lens));
  const auto is_free = [&](const glm::dvec3& place) { return ways.is_free(place); };
  const Reachable reachable = std::cref(is_free);  // by reference: nothing is allocated
  const double ahead_weight = w.input.settings.move.coherence.predictive_power * w.memory.ahead_confidence;
  if (w.input.settings.move.strategy == Strategy::kBasic)
    return choose_basic(w.memory.candidates, w.memory.target_views, desired, ahead_weight,
                        w.input.settings.move, reachable, w.memory.choice_scratch);
  set_robust_costs(w, desired);
  return choose_place(w.memory.candidates, w.memory.target_views, w.memory.cost, desired, ahead_weight,
                      w.input.settings.move, reachable, w.memory.choice_scratch);
}

// Grows while no place sees everything, so that an escape looks further; shrinks again once one does.
void adapt_horizon(StepWork& w) {
  const double factor = std::exp2(w.move_s / kHorizonDoublingS);
  const bool all_seen = w.result.status == MoveStatus::kTracking || w.steered == 0;
  w.memory.horizon_s = all_seen ? w.memory.horizon_s / factor : w.memory.horizon_s * factor;
}

void travel(StepWork& w, Choice& choice) {
  CameraState& camera = w.memory.camera;
  glm::dvec3 wanted = clamp_velocity(camera.velocity_mps, glm::dvec3(0.0), w.input.limits, w.move_s);
  if (w.input.settings.move.strategy == Strategy::kMinCost) {
    wanted = velocity_to_goal(w, choice);
  } else if (choice.candidate >= 0) {
    // At the desired place the camera travels with the targets; elsewhere the goal is a fixed place in the world.
    const glm::dvec3 with =
        choice.reason == MoveReason::kAtDesiredPlace ? group_velocity(w) : glm::dvec3(0.0);
    wanted = velocity_towards(camera, w.memory.candidates.position_m[choice.candidate], with, w.input.limits,
                              w.move_s);
  }
  wanted = evade(camera, wanted, w.input.limits, w.lens, w.memory.movers_ahead, w.move_s);
  const SafeMove safe = make_safe(camera, wanted, w.input.limits, w.lens, w.memory.colliders, w.move_s);
  w.result.flags.body_overlap = safe.overlap;
  if (safe.overlap) w.result.reason = MoveReason::kBodyOverlap;
  camera.velocity_mps = safe.velocity_mps;
  camera.pose.position_m += safe.velocity_mps * w.move_s;
}

void turn(StepWork& w) {
  TurnState& turn = w.memory.turn;
  const FramingSettings& framing = w.input.settings.framing;
  Aim aim{turn.angles, w.lens.vertical_fov_rad, true};
  if (w.steered != 0)
    aim = aim_at(w.memory.camera.pose.position_m, w.memory.target_views, turn.angles, w.lens, framing);
  const glm::dquat before = w.memory.camera.pose.rotation;
  turn = turn_towards(turn, aim.angles, w.input.limits, framing.aim_response_s, w.move_s);
  w.memory.camera.pose.rotation = rotation_from_angles(turn.angles);
  const glm::dquat delta = w.memory.camera.pose.rotation * glm::conjugate(before);
  w.memory.camera.angular_velocity_radps =
      glm::axis(delta) * (std::remainder(glm::angle(delta), 2 * std::acos(-1.0)) / w.move_s);
  // Zoom closes at the same pace as the aim.
  const double share = framing.aim_response_s > 0 ? 1 - std::pow(0.01, w.move_s / framing.aim_response_s) : 1.0;
  const double fov_rad = zooms(framing) ? aim.vertical_fov_rad : w.input.lens.vertical_fov_rad;
  w.memory.vertical_fov_rad += share * (fov_rad - w.memory.vertical_fov_rad);
}

}  // namespace

glm::dvec3 group_velocity(const StepWork& w) {
  glm::dvec3 sum(0.0);
  double weight = 0;
  for (const TargetView& t : w.memory.target_views) sum += t.weight * t.velocity_mps, weight += t.weight;
  return weight > 0 ? sum / weight : sum;
}

void list_all_visible(StepWork& w) {
  const std::span<const uint32_t> seen = w.memory.candidates.filtered();
  lattice_cells(w.memory.candidates.position_m, w.memory.lattice.spacing_m(), w.memory.cells);
  w.memory.members.resize(seen.size());
  for (size_t i = 0; i < seen.size(); ++i) w.memory.members[i] = (seen[i] & w.steered) == w.steered;
}

void move(StepWork& w) {
  if (w.move_s <= 0) {
    w.result.status = MoveStatus::kHolding;
    w.result.reason = MoveReason::kPaused;
    return;
  }
  gather_colliders(w);
  Choice choice = choose(w);
  w.result.status = choice.status;
  w.result.reason = choice.reason;
  w.result.chosen_candidate = choice.candidate;
  adapt_horizon(w);
  travel(w, choice);
  turn(w);
}

}  // namespace sightline
