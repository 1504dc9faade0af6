// Strategy kMinCost: the goal by what is hidden, now and in every future, and by the way there; and the velocity to it.
#include <algorithm>
#include <cmath>

#include "server/move/goal.h"
#include "server/step/step_work.h"

namespace sightline {
namespace {

// What is foretold with all its points counts this share of the future; the rest are the futures of aim points.
constexpr double kForetoldShare = 0.5;
// Nothing at all is seen from a place.
constexpr double kAllHidden = 0.999;
// Routes keep this much more from walls than the body needs, so that it can turn corners without grazing them.
constexpr double kRouteRoomM = 0.05;
// How far along the trail a lost camera looks.
constexpr double kTrailReachM = 12.0;
// Slower than this a target stands.
constexpr double kStandingMps = 0.2;

double body_m(const StepWork& w) {
  return swept_radius_m(w.input.limits, w.lens);
}

// Places that a mover is about to take are none to go to or through: a door that closes, a cart.
void give_way(StepWork& w, double body_radius_m) {
  const ClearanceField& soon = w.memory.movers_ahead.back();
  if (soon.collider_count() == 0) return;
  const auto& places = w.memory.place_m;
  for (size_t i = 0; i < places.size(); ++i)
    if (soon.clearance_m(places[i], body_radius_m) < body_radius_m) w.memory.goal.clearance_m[i] = 0;
}

void measure_clearances(StepWork& w, double body_radius_m) {
  StepMemory& m = w.memory;
  const std::span<const float> standoff = m.goal.standoff.measure(
      w.input.scene, m.lattice, m.bound, m.place_m, w.on_lattice, body_radius_m);
  m.goal.clearance_m.assign(standoff.begin(), standoff.end());
  give_way(w, body_radius_m);
}

// From no place that can be reached anything is seen. Finds further ways until one is.
bool is_lost(StepWork& w) {
  const auto& hidden = w.memory.goal.hidden;
  RouteFinder& routes = w.memory.goal.routes;
  for (uint32_t i = 0; i < hidden.size(); ++i)
    if (hidden[i] < kAllHidden && routes.is_settled(i)) return false;
  while (const auto node = routes.settle_next())
    if (hidden[*node] < kAllHidden) return false;
  return true;
}

// What moves may be gone at once; targets hide each other for as long as they walk so.
void mark_what_passes(StepWork& w) {
  std::vector<uint8_t>& passes = w.memory.goal.passes;
  passes.assign(w.input.scene.instances().size(), 0);
  for (const uint32_t slot : w.input.scene.moving_slots()) passes[slot] = 1;
  for (const Target& target : w.input.targets) passes[*w.input.scene.slot_of(target.instance_id)] = 0;
}

// Where to head for on the way to the goal, and how far it is to the goal by that way.
struct Leg {
  glm::dvec3 to_m{0.0};
  double length_m = 0;
};

// About the farthest place of the route to which the body can go straight: of a long one every second place is tried. The first
// is always one, as the routes begin with legs that the body can take.
Leg first_leg(StepWork& w, uint32_t goal) {
  const auto& places = w.memory.place_m;
  const std::vector<uint32_t>& route = w.memory.goal.routes.to(goal);
  const glm::dvec3 from = w.memory.camera.pose.position_m;
  if (route.empty()) return {from, 0};
  StraightWays ways(w.memory.colliders, from, body_m(w));
  size_t k = route.size() - 1;
  while (k > 0 && !ways.is_free(places[route[k]]))
    k = k > 4 ? k - 2 : k - 1;
  const glm::dvec3 to_m = places[route[k]];
  double length_m = glm::distance(from, to_m);
  for (; k + 1 < route.size(); ++k) length_m += glm::distance(places[route[k]], places[route[k + 1]]);
  return {to_m, length_m};
}

// Towards the leg's end, as fast as lets the camera stop at the goal; the velocity changes with the time constant response_s.
glm::dvec3 velocity_along(const StepWork& w, const Leg& leg, const glm::dvec3& with_mps) {
  const CameraState& camera = w.memory.camera;
  const double response_s = w.input.settings.move.move_response_s;
  const glm::dvec3 way = leg.to_m - camera.pose.position_m;
  const double distance = glm::length(way);
  glm::dvec3 wanted = with_mps;
  if (distance > 1e-9) {
    const double brake = std::sqrt(2 * kBrakeShare * w.input.limits.max_acceleration_mps2 * leg.length_m);
    wanted += way * (std::min(brake, leg.length_m / std::max(response_s, 2 * w.move_s)) / distance);
  }
  const double share = response_s > 0 ? std::min(1.0, w.move_s / response_s) : 1.0;
  return clamp_velocity(camera.velocity_mps, camera.velocity_mps + share * (wanted - camera.velocity_mps),
                        w.input.limits, w.move_s);
}

// The way that the targets went; false when the camera can reach no place of it.
bool follow_trail(StepWork& w, Leg& leg) {
  const glm::dvec3 from = w.memory.camera.pose.position_m;
  ClearanceField& field = w.memory.goal.trail_colliders;
  field.gather(w.input.scene, from, kTrailReachM + 2 * body_m(w), {});
  const auto place = w.memory.goal.trail.way_back(field, from, kTrailReachM, body_m(w),
                                                  w.input.settings.move.min_distance_m);
  if (!place) return false;
  leg = {*place, glm::distance(from, *place)};
  return true;
}

}  // namespace

bool targets_stand(const StepWork& w) {
  return std::none_of(w.memory.target_views.begin(), w.memory.target_views.end(),
                      [](const TargetView& target) {
                        return target.steered() && glm::length(target.velocity_mps) > kStandingMps;
                      });
}

bool expects_hidden(const StepWork& w) {
  return w.input.settings.move.strategy == Strategy::kMinCost;
}

double weight_ahead(const StepWork& w) {
  return w.memory.ahead_s > 0 ? w.input.settings.move.coherence.predictive_power : 0.0;
}

double weight_foretold(const StepWork& w) {
  return weight_ahead(w) * (w.memory.futures.empty() ? 1.0 : kForetoldShare);
}

HiddenWeights hidden_weights(const StepWork& w, double weight) {
  return {w.memory.goal.passes, w.memory.goal.target_weights, weight};
}

void begin_hidden(StepWork& w) {
  if (!expects_hidden(w)) return;
  w.memory.goal.hidden_by.reset(w.memory.candidates.position_m.size());
  mark_what_passes(w);
}

void expect_hidden(StepWork& w) {
  GoalSearch& goal = w.memory.goal;
  if (!expects_hidden(w)) return goal.goal_m.reset();
  const double ahead = weight_ahead(w);
  for (const Future& future : w.memory.futures)
    w.memory.composer.add_hidden(as_input(w, future.sampled), w.input.settings.aggregate.relative_bias,
                                 hidden_weights(w, ahead * (1 - kForetoldShare) * future.weight), goal.hidden_by);
  const FilterSettings& filter = w.input.settings.aggregate.filter;
  goal.lasting.update(w.memory.lattice, w.on_lattice, w.move_s,
                      filter.mode == FilterMode::kPerTarget ? filter.min_occlusion_s : 0.0,
                      goal.hidden_by.by_passing);
  goal.hidden.resize(goal.hidden_by.by_staying.size());
  for (size_t i = 0; i < goal.hidden.size(); ++i)
    goal.hidden[i] = std::clamp(goal.hidden_by.by_staying[i] + goal.hidden_by.by_passing[i], 0.0, 1.0);
}

Choice choose_goal(StepWork& w, const glm::dvec3& desired_m) {
  StepMemory& m = w.memory;
  GoalSearch& goal = m.goal;
  const MoveSettings& settings = w.input.settings.move;
  const double body_radius_m = body_m(w) + kRouteRoomM;
  list_all_visible(w);
  goal.depths.begin(m.cells, m.members);
  measure_clearances(w, body_radius_m);
  StraightWays ways(m.colliders, m.camera.pose.position_m, body_m(w));
  const RouteNodes nodes{.position_m = m.place_m,
                         .cell = m.cells,
                         .clearance_m = goal.clearance_m,
                         .hidden = goal.hidden,
                         .first_leg_is_free = [&](uint32_t node) { return ways.is_free(m.place_m[node]); },
                         .spacing_m = m.lattice.spacing_m()};
  goal.routes.begin(nodes, static_cast<uint32_t>(w.own_candidate),
                    {.body_radius_m = body_radius_m, .exposure = settings.cost.exposure});
  CostWeights weights = settings.cost;
  if (targets_stand(w)) weights.tolerance = std::max(weights.tolerance, settings.viewpoint_search.keep_shot_below);
  const CandidateCosts costs({.position_m = m.place_m,
                          .hidden = goal.hidden,
                          .spacing_m = m.lattice.spacing_m(),
                          .desired_m = desired_m,
                          .former_goal_m = goal.goal_m},
                         weights);
  const PlaceLimits limits(m.target_views, settings);
  const uint32_t found = find_goal({costs, goal.depths, limits, m.place_m}, goal.routes);
  goal.lost = is_lost(w);
  goal.goal_m = m.place_m[found];
  return choice_of(found, m.candidates, m.target_views, desired_m);
}

glm::dvec3 velocity_to_goal(StepWork& w, Choice& choice) {
  Leg leg{w.memory.camera.pose.position_m, 0};
  if (w.steered != 0 && w.memory.goal.lost && follow_trail(w, leg)) {
    w.result.status = MoveStatus::kEscaping;
    w.result.reason = MoveReason::kOnTrail;
    choice.candidate = w.result.chosen_candidate = -1;
    return velocity_along(w, leg, glm::dvec3(0.0));
  }
  if (choice.candidate >= 0) leg = first_leg(w, static_cast<uint32_t>(choice.candidate));
  // At the desired place the camera travels with the targets; elsewhere the goal is a fixed place in the world.
  return velocity_along(w, leg,
                        choice.reason == MoveReason::kAtDesiredPlace ? group_velocity(w) : glm::dvec3(0.0));
}

}  // namespace sightline
