// The stages of a step under the paper's strategies, Basic and RobustMove (paper 3.2 to 3.4, 5, 6.1). They take maps
// for pair volumes or the lattice, find which candidates see which targets, and choose the nearest good candidate.
// server/paper/README.md says where each part is.
#include <algorithm>
#include <functional>
#include <limits>

#include "server/paper/robust_costs.h"
#include "server/step/stages.h"

namespace sightline {
namespace {

// ---- sample ----

// Plans pair volumes from one point of each target, the paper's one per frame.
void chain_pairs(const SampleInput& in, const glm::dvec2& jitter, SamplePlan& plan) {
  const StepSettings& settings = in.step.input.settings;
  if (!plan.pair.asked) return;
  // This filter keeps what it knows of a position by its lattice cell.
  plan.pair.needs_lattice = settings.aggregate.filter.mode == FilterMode::kPerTarget;
  if (plan.pair.needs_two || plan.pair.needs_lattice) return;
  plan.chained_m.clear();
  for (const MapRange& points : plan.now.points_of_target) plan.chained_m.push_back(plan.now.points_m[points.first]);
  plan.pair.gap = make_pair_chain(plan.chained_m, in.bound, map_resolution(settings.sample, in.bound), jitter,
                                  plan.chain);
  plan.pair.used = plan.pair.gap == PairGap::kNone;
}

// Plans one map and one sight for each target. These maps come first: maps[i] belongs to target i.
void plan_chain_maps(const glm::dvec2& jitter, SamplePlan& plan) {
  Sampled& now = plan.now;
  now.points_m = plan.chained_m;
  for (uint32_t i = 0; i < now.points_m.size(); ++i) {
    now.sights_m[i] = now.sights_m[now.sights_of_target[i].first];
    now.sights_of_target[i] = {i, 1};
    now.points_of_target[i] = now.maps_of_point.emplace_back(MapRange{i, 1});
    plan.views.push_back(chain_view(plan.chain, i, jitter));
  }
  now.sights_m.resize(now.points_m.size());
}

// ---- aggregate ----

// The camera's own position and the desired one are rarely meeting points. Each takes the nearest texels, and outside
// of the volume such as have no neighbour.
void list_own_texels(const AggregateInput& in, CandidateSights& sights) {
  const PlaceList& candidate_m = sights.candidates.position_m;
  const glm::dvec2 jitter = in.taken.maps.front().view.jitter;
  for (size_t i = sights.own_candidate; i < candidate_m.size(); ++i) {
    const auto texels = nearest_texels(in.taken.plan.chain.links.front().volume, candidate_m[i], jitter);
    sights.texels.push_back(texels.value_or(glm::ivec3(-2 - 2 * static_cast<int>(i - sights.own_candidate), 0, 0)));
  }
}

// Lists the candidates and the targets that each sees now. Lattice cells get addresses only where the filter stores
// their past.
void list_and_look(const AggregateInput& in, CandidateMemory& memory, AggregateScratch& scratch,
                   CandidateSights& sights) {
  const TakenMaps& taken = in.taken;
  const AggregateSettings& settings = taken.settings;
  CandidateSet& candidates = sights.candidates;
  std::vector<uint32_t>& visible = candidates.visible_targets;
  if (taken.plan.pair.used) {
    sights.on_lattice = false;
    sights.texels.clear();
    compose_chain(taken.plan.chain, taken.maps, in.bound, settings.relative_bias, candidates, sights.texels);
    add_own_and_desired_position(in, sights);
    list_own_texels(in, sights);
    scratch.composer.set_positions(PlaceView(candidates.position_m.view().singles_m().subspan(sights.own_candidate)));
    scratch.composer.visibility(taken.of(taken.plan.now), settings.relative_bias, scratch.off_grid_visible);
    visible.insert(visible.end(), scratch.off_grid_visible.begin(), scratch.off_grid_visible.end());
    scratch.composer.set_positions(candidates.position_m);
  } else {
    if (settings.filter.mode == FilterMode::kNone)
      memory.lattice.lay(in.bound, settings.candidates);
    else
      memory.lattice.cover(in.bound, settings.candidates);
    list_cells(memory.lattice, sights);
    add_own_and_desired_position(in, sights);
    scratch.composer.set_positions(candidates.position_m);
    scratch.composer.visibility(taken.of(taken.plan.now), settings.relative_bias, visible);
  }
  visible[sights.own_candidate] = seen_from_own_position(in.step, taken);
}

// Filters over the last steps. For a pair volume's candidates, their volumes are looked up; for lattice cells, the past
// is kept by address.
void filter_paper(const AggregateInput& in, CandidateMemory& memory, AggregateScratch& scratch,
                  CandidateSet& candidates) {
  const TakenMaps& taken = in.taken;
  const FilterSettings& filter = taken.settings.filter;
  const PairPlan& pair = taken.plan.pair;
  const std::span<const uint64_t> ids = in.step.targets.ids;
  if (filter.mode != FilterMode::kJoint || !pair.asked) memory.pairs.clear();
  if (!pair.used || filter.mode == FilterMode::kNone) {
    const bool took_none = filter.mode == FilterMode::kJoint && pair.asked && in.step.move_s > 0;
    if (took_none) memory.pairs.push_none(filter.n);
    return filter_cells(in.step, filter, memory, scratch.slots, candidates);
  }
  memory.volume.forget();  // its steps would pass for recent ones later
  if (in.step.move_s <= 0) return;
  memory.pairs.push(taken.plan.chain, taken.maps.first(ids.size()), ids, taken.settings.relative_bias, filter.n);
  memory.pairs.filter(candidates.position_m.view().singles_m(), candidates.visible_targets, ids,
                      in.step.targets.steered, filter, candidates.filtered_targets);
}

// ---- move ----

// With a prediction, drops candidates that will not see the predicted targets, as long as another one sees them now and
// then. Otherwise the camera would go to the edge of a region that is about to be hidden, and would react late.
void leave_out_hidden_ahead(const MoveInput& in, std::vector<uint8_t>& members) {
  if (in.plan.ahead_s <= 0) return;
  const std::span<const uint32_t> ahead = in.sights.candidates.ahead();
  const uint32_t steered = in.step.targets.steered;
  const auto seen_ahead = [&](size_t i) { return (ahead[i] & steered) == steered; };
  bool any = false;
  for (size_t i = 0; i < ahead.size(); ++i) any |= members[i] && seen_ahead(i);
  if (!any) return;
  for (size_t i = 0; i < ahead.size(); ++i)
    if (!seen_ahead(i)) members[i] = 0;
}

// Lists the candidates' cells, in the lattice or in the pair volume, and marks the candidates that see all steered
// targets.
void list_all_visible(const MoveInput& in, MoveScratch& scratch) {
  const CandidateSet& candidates = in.sights.candidates;
  const std::span<const uint32_t> seen = candidates.filtered();
  const uint32_t steered = in.step.targets.steered;
  if (in.sights.on_lattice)
    lattice_cells(candidates.position_m, in.carried.candidates.lattice.spacing_m(), scratch.cells);
  else
    scratch.cells = in.sights.texels;
  scratch.members.resize(seen.size());
  for (size_t i = 0; i < seen.size(); ++i) scratch.members[i] = (seen[i] & steered) == steered;
}

void set_robust_costs(const MoveInput& in, MoveScratch& s) {
  const auto& position_m = in.sights.position_m;
  list_all_visible(in, s);
  leave_out_hidden_ahead(in, s.members);
  const Neighbours neighbours = in.sights.on_lattice ? Neighbours::kFaces : Neighbours::kTouching;
  find_groups(s.cells, neighbours, position_m, s.members, in.desired_m, s.group_scratch, s.groups);
  if (in.step.input.settings.move.robust_goal == RobustGoal::kCenter)
    return center_costs(position_m, in.desired_m, s.groups, s.cost);
  // A place outside a pair volume has no cell that is near any other, so nothing is measured from it.
  if (!in.sights.on_lattice)
    for (size_t i = 0; i < s.members.size(); ++i) s.members[i] |= s.cells[i].x < 0;
  measure_edge_distances(s.cells, s.members, s.edge_distance_scratch, s.edge_distance_squared);
  robust_costs(position_m, in.desired_m, s.groups, s.edge_distance_squared, s.cost);
}

// With RobustGoal::kCenter the camera goes to the group's centre itself rather than to the member next to it, if the
// body can go there.
void aim_at_center(const MoveInput& in, const MoveScratch& s, const Reachable& reachable, Choice& choice) {
  if (in.step.input.settings.move.robust_goal != RobustGoal::kCenter || choice.candidate < 0) return;
  if (s.groups.largest == kNoGroup || s.groups.group_of[static_cast<size_t>(choice.candidate)] != s.groups.largest)
    return;
  const glm::dvec3 center_m = center_of_largest_m(in.sights.position_m, s.groups);
  if (!reachable(center_m) || !within_limits(center_m, in.step.targets.tracked_targets, in.step.input.settings.move))
    return;
  choice.place_m = center_m;
  if (choice.reason == MoveReason::kAtDesiredPlace) choice.reason = MoveReason::kNearestAllVisible;
}

Choice choose(const MoveInput& in, MoveScratch& scratch) {
  const MoveSettings& settings = in.step.input.settings.move;
  const CandidateSet& candidates = in.sights.candidates;
  const std::span<const TrackedTarget> targets = in.step.targets.tracked_targets;
  StraightWays ways(in.surroundings.colliders, in.step.camera.pose.position_m,
                    swept_radius_m(in.step.input.limits, in.step.lens));
  const auto is_free = [&](const glm::dvec3& position_m) { return ways.is_free(position_m); };
  const Reachable reachable = std::cref(is_free);  // by reference: nothing is allocated
  const double ahead_weight = in.step.input.settings.move.predictive_power * in.plan.ahead_confidence;
  if (settings.strategy == Strategy::kBasic)
    return choose_basic(candidates, targets, in.desired_m, ahead_weight, settings, reachable, scratch.choice_scratch);
  set_robust_costs(in, scratch);
  Choice choice = choose_place(candidates, targets, scratch.cost, in.desired_m, ahead_weight, settings, reachable,
                               scratch.choice_scratch);
  aim_at_center(in, scratch, reachable, choice);
  return choice;
}

glm::dvec3 velocity_to(const MoveInput& in, const Choice& choice) {
  const CameraState& camera = in.step.camera;
  const CameraLimits& limits = in.step.input.limits;
  if (choice.candidate < 0) return stopping_mps(in);
  // A goal at the desired position moves with the targets; any other goal is fixed in the world.
  const bool travels = choice.reason == MoveReason::kAtDesiredPlace;
  return velocity_towards(
      camera, choice.place_m.value_or(in.sights.candidates.position_m[static_cast<size_t>(choice.candidate)]),
      travels ? group_velocity_mps(in.step) : glm::dvec3(0.0), limits, in.step.move_s);
}

}  // namespace

bool follows_paper(const StepInput& input) {
  return input.settings.move.strategy != Strategy::kMinCost;
}

void plan_paper_maps(const SampleInput& in, SampleScratch& scratch, SamplePlan& plan) {
  const glm::dvec2 jitter = pick_points(in, std::numeric_limits<double>::infinity(), 1, scratch, plan);
  chain_pairs(in, jitter, plan);
  if (plan.pair.used)
    plan_chain_maps(jitter, plan);
  else
    plan_maps(in, jitter, plan.now, plan);
  plan_sights(in.step, plan);
  plan_maps(in, jitter, plan.ahead, plan);
}

void aggregate_paper(const AggregateInput& in, CandidateMemory& memory, AggregateScratch& scratch,
                     CandidateSights& sights) {
  memory.ahead.restart();
  list_and_look(in, memory, scratch, sights);
  filter_paper(in, memory, scratch, sights.candidates);
  if (in.taken.plan.ahead_s > 0)
    scratch.composer.visibility(in.taken.of(in.taken.plan.ahead), in.taken.settings.relative_bias,
                                sights.candidates.ahead_targets);
  if (in.step.input.settings.move.strategy == Strategy::kRobust)
    list_places(sights.candidates.position_m, sights.position_m);
}

Course paper_course(const MoveInput& in, MoveScratch& scratch, Decision& decision) {
  decision.goal_m.reset();
  decision.follows = false;
  decision.blind = {};
  Choice choice;
  if (in.step.targets.steered != 0) choice = choose(in, scratch);
  decision.horizon_s = next_horizon_s(in, choice.status != MoveStatus::kTracking && in.step.targets.steered != 0);
  if (choice.candidate >= 0) {
    const auto chosen = static_cast<size_t>(choice.candidate);
    scratch.way_m = glm::distance(in.step.camera.pose.position_m, in.sights.candidates.position_m[chosen]);
    if ((in.sights.candidates.filtered()[chosen] & in.step.targets.steered) != 0) decision.view_way_m = scratch.way_m;
  }
  decision.sees_none = !decision.view_way_m;
  return {choice, velocity_to(in, choice)};
}

}  // namespace sightline
