// The stages of a step, as step.cpp calls them, and what they share. Internal to this folder. Every stage takes what it reads as const
// and makes one struct of step_dump.h; what it writes besides is memory that is passed by name.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/aggregate/compose.h"
#include "server/move/choose.h"
#include "server/move/coherence.h"
#include "server/move/depths.h"
#include "server/move/groups.h"
#include "server/move/route.h"
#include "server/move/shelter.h"
#include "server/move/standoff.h"
#include "server/step/step.h"

namespace sightline {

// What every stage may read.
struct StepContext {
  const StepInput& input;
  const TargetsNow& targets;
  const CameraState& camera;  // before this step moves it
  Lens lens;                  // of the input, with the present zoom
  double move_s = 0.0;        // for how long the camera moves; 0: paused

  size_t target_count() const { return input.targets.size(); }
  bool is_steered(size_t target) const { return targets.steered >> target & 1u; }
  glm::dvec3 center_m() const { return weighted_center_m(targets.tracked_targets); }  // some target is steered
};

// The past of a target of this step, with its pose of now.
const TargetPast& past_of(std::span<const TargetPast> pasts, uint64_t id);
// No steered target moves.
bool targets_stand(const StepContext& step);
// The targets' mean velocity, by weight.
glm::dvec3 group_velocity_mps(const StepContext& step);
// Whether candidates are judged by what is expected to be hidden from them.
bool weighs_hidden(const StepInput& input);
// Where the camera wants to be; some target is steered, or the camera wants to stay.
glm::dvec3 desired_position_m(const StepContext& step, const WantedShot& shot);

// A bound for the depth of a map in which no position farther than `farthest_m` from its eye is looked up.
inline double beyond_all_m(double farthest_m) { return 1.001 * farthest_m + 0.01; }

// ---- sample (sample_stage.cpp; paper 3.2, 4): which maps to take ----

struct SampleInput {
  const StepContext& step;
  const Bound& bound;
  std::span<const TargetPast> pasts;
  const WantedShot& shot;
};
void plan_sample(const SampleInput& input, std::vector<glm::vec3>& picked, SamplePlan& plan);

// The maps of a step with the plan that they were taken by.
struct TakenMaps {
  const SamplePlan& plan;
  std::span<const DepthMap> maps;
  const AggregateSettings& settings;

  // As the composer takes them.
  SampledPoints of(const Sampled& sampled) const;
  // How far before `position_m` the view of sight k's point ends, in metres; <= 0: the point is seen from there. The position is the
  // camera's own, or a step away from it.
  double falls_short_m(uint32_t sight, const glm::dvec3& position_m) const;
};

// How much of one target is seen by its sights, as if the camera stood at `position_m`.
struct OwnSight {
  uint32_t seen = 0, points = 0;
  uint32_t occluder = kNoOccluder;  // slot of the mirror: what hides the first hidden point
  double share() const { return points > 0 ? static_cast<double>(seen) / points : 0.0; }
};
OwnSight own_sight(const TakenMaps& taken, size_t target, const glm::dvec3& position_m);

// ---- the viewpoint search (viewpoint_search.cpp): from which side are the targets well seen for long? ----

// Appends the maps of one target that looks all round.
ViewpointLook plan_look(const SampleInput& input, std::vector<MapView>& views);
void request_look(const SampleInput& input, SamplePlan& plan);

// What the search learns from those maps, and the shot that the camera wants from now on.
struct ViewpointScratch {
  ShotState asked, present;
};
void search_viewpoints(const StepContext& step, const TakenMaps& taken, Survey& viewpoints, WantedShot& shot,
                       ViewpointScratch& scratch);

// ---- aggregate (aggregate_stage.cpp; paper 3.3, 5): which candidates see which targets, now, lately and soon? ----

struct AggregateInput {
  const StepContext& step;
  const Bound& bound;
  const TakenMaps& taken;
  glm::dvec3 desired_m{0.0};  // where the camera wants to be; not read while no target is steered
};
struct AggregateScratch {
  Composer composer;
  HiddenShares hidden_by;
  std::vector<uint8_t> passes;  // by slot of the mirror: moves, and is no target
  std::vector<uint32_t> off_grid_visible, slots;
  FilteredSights filtered;
};
void aggregate(const AggregateInput& input, CandidateMemory& memory, AggregateScratch& scratch, CandidateSights& sights);

// ---- move (move_stage.cpp; paper 3.4, 6): where to, how fast, and which way to look? ----

struct MoveInput {
  const StepContext& step;
  const CarriedState& carried;
  const Bound& bound;
  const SamplePlan& plan;
  const CandidateSights& sights;
  const Surroundings& surroundings;
  glm::dvec3 desired_m{0.0};  // as for aggregate
};
struct MoveScratch {
  std::vector<glm::ivec3> cells;  // of the candidates
  std::vector<uint8_t> members;   // by candidate: sees all steered targets
  // Strategy kRobust.
  GroupScratch group_scratch;
  Groups groups;
  ShelterScratch edge_distance_scratch;
  std::vector<uint32_t> edge_distance_squared;
  std::vector<double> cost;
  ChoiceScratch choice_scratch;
  // Strategy kMinCost.
  Standoff clearance_cache;
  std::vector<float> clearance_m;  // by candidate: to what stands, 0 where a mover is about to be
  Depths edge_depths;              // among the candidates that see all
  RouteFinder routes;
  ClearanceField trail_colliders;
};
void gather_colliders(const StepContext& step, const Bound& bound, Surroundings& surroundings);
Decision decide(const MoveInput& input, MoveScratch& scratch);

// Lists the candidates' cells and which of them see all steered targets.
void list_all_visible(const MoveInput& input, MoveScratch& scratch);

// ---- the goal of strategy kMinCost (goal_search.cpp) ----

struct Goal {
  Choice choice;
  glm::dvec3 position_m{0.0};
  bool lost = false;  // nothing is seen from any candidate that can be reached
};
Goal choose_goal(const MoveInput& input, MoveScratch& scratch);
// A camera that is lost follows the targets' trail instead: `goal.choice` says so.
glm::dvec3 velocity_to_goal(const MoveInput& input, Goal& goal, MoveScratch& scratch);

}  // namespace sightline
