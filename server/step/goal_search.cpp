// The goal of strategy kMinCost: the candidate with the least cost of occlusion, now and in every future, and of the
// route to it. `choose_goal` sets up the costs; `find_goal` (move/goal.cpp) decides which candidate wins.
#include <algorithm>
#include <cmath>
#include <optional>

#include "server/move/goal.h"
#include "server/step/stages.h"

namespace sightline {
namespace {

// Routes keep this much more from walls than the body needs, so that it can turn corners without grazing them.
constexpr double kRouteRoomM = 0.05;
// Length of the trail that a lost camera examines.
constexpr double kTrailReachM = 16.0;

double body_m(const MoveInput& in) {
  return swept_radius_m(in.step.input.limits, in.step.lens);
}

// Sets the clearance of candidates to 0 where a moving collider, such as a cart, is about to be. No route then leads to
// them or through them.
void give_way(const MoveInput& in, double body_radius_m, std::vector<float>& clearance_m) {
  const ClearanceField& soon = in.surroundings.movers_ahead.back();
  if (soon.collider_count() == 0) return;
  const auto& position_m = in.sights.position_m;
  for (size_t i = 0; i < position_m.size(); ++i)
    if (soon.clearance_m(position_m[i], body_radius_m) < body_radius_m) clearance_m[i] = 0;
}

void measure_clearances(const MoveInput& in, double body_radius_m, MoveScratch& scratch) {
  const std::span<const float> to_what_stands =
      scratch.clearance_cache.measure(in.step.input.scene, in.carried.candidates.lattice, in.bound, in.sights.position_m,
                                      in.sights.on_lattice, body_radius_m);
  scratch.clearance_m.assign(to_what_stands.begin(), to_what_stands.end());
  give_way(in, body_radius_m, scratch.clearance_m);
}

// True if no reachable candidate sees any target. Settles further routes until it finds a candidate that sees one.
bool is_lost(const std::vector<double>& hidden, RouteFinder& routes) {
  for (uint32_t i = 0; i < hidden.size(); ++i)
    if (hidden[i] < kAllHidden && routes.is_settled(i)) return false;
  while (const auto candidate = routes.settle_next())
    if (hidden[*candidate] < kAllHidden) return false;
  return true;
}

// The next position to head for on the route to the goal, and the remaining length of the route.
struct Leg {
  glm::dvec3 to_m{0.0};
  double length_m = 0;
};

// Roughly the farthest candidate of the route that the body can reach in a straight line. On long routes only every
// second candidate is tried. The first one always qualifies, because every route begins with a leg that the body can
// take.
Leg first_leg(const MoveInput& in, uint32_t goal, RouteFinder& routes) {
  const auto& position_m = in.sights.position_m;
  const std::vector<uint32_t>& route = routes.to(goal);
  const glm::dvec3 from_m = in.step.camera.pose.position_m;
  if (route.empty()) return {from_m, 0};
  StraightWays ways(in.surroundings.colliders, from_m, body_m(in));
  size_t k = route.size() - 1;
  while (k > 0 && !ways.is_free(position_m[route[k]])) k = k > 4 ? k - 2 : k - 1;
  const glm::dvec3 to_m = position_m[route[k]];
  double length_m = glm::distance(from_m, to_m);
  for (; k + 1 < route.size(); ++k) length_m += glm::distance(position_m[route[k]], position_m[route[k + 1]]);
  return {to_m, length_m};
}

// The velocity towards the end of the leg, no faster than allows the camera to stop at the goal. It changes with the
// time constant response_s.
glm::dvec3 velocity_along(const StepContext& step, const Leg& leg, const glm::dvec3& with_mps) {
  const double response_s = step.input.settings.move.move_response_s;
  const glm::dvec3 way_m = leg.to_m - step.camera.pose.position_m;
  const double distance_m = glm::length(way_m);
  glm::dvec3 wanted_mps = with_mps;
  if (distance_m > 1e-9) {
    const double arrival_mps = arrival_speed_mps(leg.length_m, step.input.limits, step.move_s);
    wanted_mps += way_m * (std::min(arrival_mps, leg.length_m / std::max(response_s, 2 * step.move_s)) / distance_m);
  }
  return steer_velocity(step.camera, wanted_mps, step.input.limits, response_s, step.move_s);
}

// The newest reachable position of the targets' trail; empty if none is reachable.
std::optional<Leg> leg_to_trail(const MoveInput& in, ClearanceField& field) {
  const glm::dvec3 from_m = in.step.camera.pose.position_m;
  field.gather(in.step.input.scene, from_m, kTrailReachM + 2 * body_m(in), {});
  const auto to_m = in.carried.trail.way_back(field, from_m, kTrailReachM, body_m(in),
                                              in.step.input.settings.move.min_distance_m);
  if (!to_m) return std::nullopt;
  return Leg{*to_m, glm::distance(from_m, *to_m)};
}

// A goal at the desired position, or where the bound ends on the way to it, moves with the targets; any other goal is fixed in the
// world. The last candidate is that position (aggregate).
bool leads_to_desired(const MoveInput& in, const Goal& goal) {
  if (goal.choice.candidate < 0) return false;  // without targets there are no candidates
  return glm::distance(goal.position_m, in.sights.position_m.back()) < in.carried.candidates.lattice.spacing_m();
}

}  // namespace

Goal choose_goal(const MoveInput& in, MoveScratch& scratch) {
  const MoveSettings& settings = in.step.input.settings.move;
  const auto& position_m = in.sights.position_m;
  const double body_radius_m = body_m(in) + kRouteRoomM, spacing_m = in.carried.candidates.lattice.spacing_m();
  list_all_visible(in, scratch);
  scratch.edge_depths.begin(scratch.cells, scratch.members);
  measure_clearances(in, body_radius_m, scratch);
  StraightWays ways(in.surroundings.colliders, in.step.camera.pose.position_m, body_m(in));
  const RouteNodes nodes{.position_m = position_m,
                         .cell = scratch.cells,
                         .clearance_m = scratch.clearance_m,
                         .hidden = in.sights.hidden,
                         .first_leg_is_free = [&](uint32_t node) { return ways.is_free(position_m[node]); },
                         .spacing_m = spacing_m};
  scratch.routes.begin(nodes, static_cast<uint32_t>(in.sights.own_candidate),
                       {.body_radius_m = body_radius_m, .exposure = settings.cost.exposure});
  CostWeights weights = settings.cost;
  if (targets_stand(in.step)) weights.tolerance = std::max(weights.tolerance, settings.viewpoint_search.keep_shot_below);
  std::optional<glm::dvec3> former_goal_m = in.carried.goal_m;
  if (former_goal_m) *former_goal_m += group_velocity_mps(in.step) * in.step.move_s;
  const CandidateCosts costs({.position_m = position_m,
                          .hidden = in.sights.hidden,
                          .spacing_m = spacing_m,
                          .desired_m = in.desired_m,
                          .former_goal_m = former_goal_m},
                         weights);
  const PlaceLimits limits(in.step.targets.tracked_targets, settings);
  const uint32_t found = find_goal({costs, scratch.edge_depths, limits, position_m}, scratch.routes);
  return {.choice = choice_of(found, in.sights.candidates, in.step.targets.tracked_targets, in.desired_m),
          .position_m = position_m[found],
          .lost = is_lost(in.sights.hidden, scratch.routes)};
}

glm::dvec3 velocity_to_goal(const MoveInput& in, Goal& goal, MoveScratch& scratch) {
  if (goal.lost) {
    if (const auto leg = leg_to_trail(in, scratch.trail_colliders)) {
      goal.choice = {MoveStatus::kEscaping, MoveReason::kOnTrail, -1};
      return velocity_along(in.step, *leg, glm::dvec3(0.0));
    }
  }
  Leg leg{in.step.camera.pose.position_m, 0};
  if (goal.choice.candidate >= 0) leg = first_leg(in, static_cast<uint32_t>(goal.choice.candidate), scratch.routes);
  return velocity_along(in.step, leg, leads_to_desired(in, goal) ? group_velocity_mps(in.step) : glm::dvec3(0.0));
}

}  // namespace sightline
