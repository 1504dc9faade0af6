// The stages of a step, as step.cpp calls them, and their shared types. Internal to this folder. Every stage takes its
// inputs as const and fills one struct of step_dump.h. It writes nothing else but the carried state and scratch memory
// that it is passed.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <span>
#include <vector>

#include "server/aggregate/compose.h"
#include "server/move/choose.h"
#include "server/move/clearance_cache.h"
#include "server/move/flight_plan.h"
#include "server/move/picture_fit.h"
#include "server/move/summed_gain.h"
#include "server/paper/choose_place.h"
#include "server/paper/groups.h"
#include "server/step/step.h"
#include "server/step/target_points.h"

namespace sightline {

// The inputs that all stages share.
struct StepContext {
  const StepInput& input;
  const TargetsNow& targets;
  const CameraState& camera;  // before this step moves it
  Lens lens;                  // of the input, with the present zoom
  double move_s = 0.0;        // time that the camera moves for; 0: paused
  bool decides = true;        // false: the last decision is carried out further (tracking.h)
  double decision_s = 0.0;    // the time that the camera moves for since the last decision, with this step; 0: paused
  uint64_t decision = 0;      // number of this decision, which does not depend on how many there were
  double clock_s = 0.0;       // the time that the camera has moved for since the session opened, with this step

  size_t target_count() const { return input.targets.size(); }
  // as asked for
  double roll_rad() const {
    return input.shot && input.settings.move.follow == Follow::kOffset ? input.shot->roll_rad : 0.0;
  }
  bool is_steered(size_t target) const { return targets.steered >> target & 1u; }
  glm::dvec3 center_m() const { return weighted_center_m(targets.tracked_targets); }  // some target is steered
};

// The past poses of a target, including the present one. The target must belong to this step.
const TargetPast& past_of(std::span<const TargetPast> pasts, uint64_t id);
// kept_before: the mask of the steered targets that are not in an earlier step's list. dropped_ids: the list of the
// steered targets that are not in a mask.
uint32_t kept_before(const TargetsNow& now, const TargetIds& dropped);
TargetIds dropped_ids(const TargetsNow& now, uint32_t kept);
// A hash over the ids of the targets in a mask, in any order.
uint64_t hash_of(const TargetsNow& now, uint32_t mask);
// True if no steered target moves.
bool targets_stand(const StepContext& step);
// The targets' mean velocity, by weight.
glm::dvec3 group_velocity_mps(const StepContext& step);
// The radius of the body with the room that a path keeps from walls. So the camera can turn corners without grazing
// them.
double route_radius_m(const StepContext& step);
// The most tests of triangles (ClearanceField) of one part of a step: some milliseconds. In eight of our scenes none
// took more than 10,745. So in a scene of very many triangles at one place, no part takes long, and the same answer
// comes on every machine.
inline constexpr uint64_t kMostTests = 100'000;

// The settings of framing, with the lens range of the shot if it has one.
FramingSettings framing_of(const StepInput& input);
// The lens of the shot: the client's; within the lens range where the shot keeps a size by zooming.
Lens shot_lens(const StepInput& input);
// The lens by which places are judged, at its present zoom. Where the zoom keeps a size from any place, it is
// shot_lens.
Lens place_lens(const StepContext& step);

// The position that the camera tries to reach. Some target must be steered, unless the camera is to stay where it is.
glm::dvec3 desired_position_m(const StepContext& step, const WantedShot& shot);

// The depth that a map needs when no position farther than `farthest_m` from its eye is looked up in it.
inline double beyond_all_m(double farthest_m) {
  return 1.001 * farthest_m + 0.01;
}

// Strategy kMinCost: the goal is where the camera is to be after this time, however it was found. So the goal only
// moves when the camera changes its mind.
inline constexpr double kGoalS = 0.35;
// A target whose visible share was smaller of late does not count as seen.
inline constexpr double kGlimpse = 0.1;
// The steered targets that the camera itself has seen over the last ShareWindow, wherever they are to the picture. Bit
// i is target i.
uint32_t seen_of_late(const StepContext& step, const CarriedState& carried);

// ---- sample (sample_stage.cpp; paper 3.2, 4): plans the maps ----

struct SampleInput {
  const StepContext& step;
  const Bound& bound;
  std::span<const TargetPast> pasts;
  const WantedShot& shot;
  const CarriedState& carried;
};
struct SampleScratch {
  TargetPicker picker;
  ClearanceField colliders;  // that stand around a target
};
void plan_sample(const SampleInput& input, SampleScratch& scratch, SamplePlan& plan);
// Between two decisions: only single rays to where the camera is and will be.
void plan_sights_alone(const SampleInput& input, SampleScratch& scratch, SamplePlan& plan);
// Its parts. The points of all targets, now and at the longest usable prediction, which is at most `most_ahead_s`. Maps
// of the present are taken from one in `of_points` of the points, or from none if that is 0. Returns where in their
// texels the maps' rays go.
glm::dvec2 pick_points(const SampleInput& input, double most_ahead_s, size_t of_points, SampleScratch& scratch,
                       SamplePlan& plan);
// Maps of the whole bound from each of these points.
void plan_maps(const SampleInput& input, const glm::dvec2& jitter, Sampled& sampled, SamplePlan& plan);
// Single rays from each point to where the camera will be after this step.
void plan_sights(const StepContext& step, SamplePlan& plan);
// sample_slices.cpp: from the predicted points to where the camera is expected then
void plan_sights_ahead(SamplePlan& plan);
// The longest forecast of what the camera will see. People do something else after that time. The plan looks farther
// ahead.
inline constexpr double kForecastS = 0.5;
void plan_flight_maps(const SampleInput& input, SampleScratch& scratch, SamplePlan& plan);  // sample_slices.cpp
// False if only the target's aim point is sampled.
bool samples_surface(const StepContext& step, size_t target);

// The maps of a step, with the plan for which they were taken.
struct TakenMaps {
  const SamplePlan& plan;
  std::span<const DepthMap> maps;
  const AggregateSettings& settings;

  // The maps in the form that the composer takes.
  SampledPoints of(const Sampled& sampled) const;
  // Distance from `position_m` to the stored depth of sight k, in metres; <= 0 means that the sight's point is visible.
  // The position must be the camera's own, or at most a step away from it.
  double falls_short_m(uint32_t sight, const glm::dvec3& position_m) const;
  // The same for any map of a single texel.
  double map_falls_short_m(uint32_t map, const glm::dvec3& position_m) const;
};

// The number of a target's sight points that are visible from `position_m`.
struct OwnSight {
  uint32_t seen = 0, points = 0;
  double share() const { return points > 0 ? static_cast<double>(seen) / points : 0.0; }
};
OwnSight own_sight(const TakenMaps& taken, size_t target, const glm::dvec3& position_m);

// ---- the viewpoint search (viewpoint_search.cpp): which side of the targets has a good and stable view? ----

// `offset_m` from the targets' centre after the corrections by framing and limits. Some target must be steered.
glm::dvec3 framed_offset_m(const StepContext& step, const glm::dvec3& offset_m);
// False if the framing would push a camera at `offset_m` out by more than 5 % to show the whole group.
bool shows_group(const StepContext& step, const glm::dvec3& offset_m);
// The third of the four distances of the viewpoints.
double viewpoint_distance_m(const StepContext& step, const WantedShot& shot);

// True once the viewpoints have been looked at for long enough.
bool knows_viewpoints(const StepContext& step, const ViewpointMap& viewpoints);

// The place of the client's shot, within the limits.
glm::dvec3 asked_place_m(const StepContext& step, const WantedShot& shot);
// Appends the maps that show all directions from one target, and sights from there to the place of the client's shot,
// now and at the plan's slices.
ViewpointLook plan_look(const SampleInput& input, SamplePlan& plan);
void request_look(const SampleInput& input, SamplePlan& plan);

// Updates the viewpoints from those maps, and chooses the shot that the camera tries to keep.
void search_viewpoints(const StepContext& step, const TakenMaps& taken, ViewpointMap& viewpoints, WantedShot& shot);

// ---- aggregate (aggregate_stage.cpp; paper 3.3, 5): which candidates see which targets, now, lately and soon? ----

// The position itself if it is in the bound, else the nearest one in the bound.
glm::dvec3 nearest_in_bound_m(const Bound& bound, const glm::dvec3& position_m);

struct AggregateInput {
  const StepContext& step;
  const Bound& bound;
  const TakenMaps& taken;
  glm::dvec3 desired_m{0.0};  // desired position; not read while no target is steered
};
struct AggregateScratch {
  Composer composer;
  ClearanceCache clearance_cache;
  PlaceList places;  // the candidates, and then the places of moved cells
  HiddenShares hidden_by;
  std::vector<uint8_t> passes;  // by mirror slot: 1 if the instance moves and belongs to no target
  std::vector<uint32_t> off_grid_visible, slots;
  PictureFit picture_fit;
  std::vector<float> shares, outside;  // of one slice, by cell
};
void aggregate(const AggregateInput& input, CandidateMemory& memory, AggregateScratch& scratch,
               CandidateSights& sights);
// Its parts. The lattice's cells as candidates.
void list_cells(const Lattice& lattice, CandidateSights& sights);
// Adds two candidates off the grid: the camera's own position and the desired one. Without them a camera at rest would
// move between grid points.
void add_own_and_desired_position(const AggregateInput& input, CandidateSights& sights);
uint32_t seen_from_own_position(const StepContext& step, const TakenMaps& taken);
// Lattice cells keep their history, if `filter` has a mode. The two positions off the lattice take over the history of
// the nearest cell. `slots` is scratch memory.
void filter_cells(const StepContext& step, const FilterSettings& filter, CandidateMemory& memory,
                  std::vector<uint32_t>& slots, CandidateSet& candidates);

// ---- move (move_stage.cpp; paper 3.4, 6): where to, how fast, and which way to look? ----

struct MoveInput {
  const StepContext& step;
  const CarriedState& carried;
  const Bound& bound;
  const SamplePlan& plan;
  const CandidateSights& sights;
  const Surroundings& surroundings;
  glm::dvec3 desired_m{0.0};  // as for aggregate
  // the targets that are seen from where the camera is, wherever they are to the picture; bit i is target i
  uint32_t seen_here = 0;
};
// What doors would hide if they shut (server/aggregate/doors.h). All but `open` have one entry a lattice point.
struct BehindDoors {
  OpenDoors open;
  std::vector<float> x_m, y_m, z_m;          // places, from the middle of the bound
  std::vector<float> of_target, of_targets;  // the share of one target that is hidden, and of all by their weights
};
struct MoveScratch {
  // Strategy kRobust.
  std::vector<glm::ivec3> cells;  // of the candidates
  std::vector<uint8_t> members;   // by candidate: 1 if it sees all steered targets
  GroupScratch group_scratch;
  Groups groups;
  EdgeDistanceScratch edge_distance_scratch;
  std::vector<uint32_t> edge_distance_squared;
  std::vector<double> cost;
  ChoiceScratch choice_scratch;
  // Strategy kMinCost.
  std::vector<float> clearance_m;  // by candidate: to static colliders; 0 where a mover is expected
  FlightPlanner planner;
  std::vector<float> outside;  // by cell of the planner: the cost of being outside the limits
  BehindDoors behind_doors;
  std::vector<uint32_t> way;  // the candidates on the way to the goal
  double way_m = 0;           // length of the way to the chosen candidate, whichever strategy chose it
  ClearanceField cut_colliders;
  FarWayFinder far_ways;
  ClearanceField far_colliders;
  std::vector<uint32_t> target_slots;
};
// A candidate to go to, and the velocity that the camera should have.
struct Course {
  Choice choice;
  glm::dvec3 wanted_mps{0.0};
};
void gather_colliders(const StepContext& step, const Bound& bound, Surroundings& surroundings);
// The horizon grows, so that an escape looks farther, or shrinks again.
double next_horizon_s(const MoveInput& input, bool grows);
// The velocity of a camera that comes to rest.
glm::dvec3 stopping_mps(const MoveInput& input);
Decision decide(const MoveInput& input, MoveScratch& scratch);
// Carries the last decision out further.
Decision go_on(const MoveInput& input);

// ---- the strategies of the paper (paper_stages.cpp): each stage has one way for them and one for the flight plan ----

bool follows_paper(const StepInput& input);
void plan_paper_maps(const SampleInput& input, SampleScratch& scratch, SamplePlan& plan);
void aggregate_paper(const AggregateInput& input, CandidateMemory& memory, AggregateScratch& scratch,
                     CandidateSights& sights);
Course paper_course(const MoveInput& input, MoveScratch& scratch, Decision& decision);

// ---- cuts (cut_stage.cpp; Settings.cut_after_s): is there a place to jump to? ----

struct CutScratch {
  ViewpointMap pattern;  // for the places of the viewpoints alone
  struct Ranked {
    double score = 0;
    size_t place = 0;
  };
  std::vector<Ranked> ranked;
  ClearanceField colliders;
};
// If a cut is due, adds places and the maps of their sights to a plan that plan_sample has made.
void plan_cut(const SampleInput& input, const CarriedState& carried, bool target_jumped, TargetPicker& picker,
              CutScratch& scratch, SamplePlan& plan);
// The place to jump to instead of following the decision; null: none. Keeps count of the places in `state`.
const CutPlace* choose_cut(const MoveInput& input, const TakenMaps& taken, bool target_jumped, const Decision& decision,
                           MoveScratch& scratch, CutState& state);
// Changes the decision into a cut to `place`, and the shot into the one from there.
void cut_to(const MoveInput& input, const TakenMaps& taken, const CutPlace& place, MoveScratch& scratch,
            WantedShot& shot, Decision& decision);
// Returns whether a target's jump still asks for a cut: none was taken, the shot is far away, and not all places were
// examined yet.
bool jump_waits(const MoveInput& input, bool target_jumped);
// Counts the time without a sight of any required target.
// `is_asked`: the shot may still cut (WantedShot::cut_s).
void note_sights(const StepContext& step, const StepResult& result, bool target_jumped, bool is_asked, CutState& state);

// ---- ways (legs.cpp) ----

// The length of a way over candidates.
double way_length_m(const MoveInput& input, const glm::dvec3& from_m, std::span<const uint32_t> way);
// Roughly the farthest candidate of the way that the body can reach in a straight line. The first one counts as
// reachable, because every way begins with a leg that the body can take.
Leg first_leg(const MoveInput& input, std::span<const uint32_t> way, double body_radius_m);
// `with_mps` and a velocity towards the end of the leg that is no faster than allows the camera to stop at the end of
// the way.
glm::dvec3 velocity_along(const StepContext& step, const Leg& leg, const glm::dvec3& with_mps, const Pace& pace = {});

// The velocity by which a decision is carried out in a later step.
glm::dvec3 velocity_by(const StepContext& step, const Tracking& tracking, const glm::dvec3& desired_m);
// The tracking of a leg that begins where the camera is.
Tracking along(const StepContext& step, const Leg& leg, const Pace& pace = {});

// ---- the goal of strategy kMinCost (goal_search.cpp) ----

// From this hidden share on, a candidate counts as seeing nothing.
inline constexpr double kAllHidden = 0.999;

struct Goal {
  Choice choice;
  glm::dvec3 position_m{0.0};                        // where the camera heads for
  glm::dvec3 velocity_mps{0.0};                      // that leads there
  Tracking tracking = {};                            // the same for later steps
  bool follows = false;                              // it heads for the desired position
  InlineVector<PlanPoint, kSlices + 2> plan_m = {};  // as Decision::plan_m
  bool searches = false;  // no place on its plan sees any target: it goes to the nearest that does
  bool lost = false;      // none that it can reach does
  BlindState blind = {};
  std::optional<SummedGain> change = {};  // as Decision::change
  std::optional<double> way_m = {};       // length of a far way that it takes
  ComparedCourses courses = {};
  HeldFacts facts = {};
};
// Sets `scratch.way` too.
Goal choose_goal(const MoveInput& input, MoveScratch& scratch);

}  // namespace sightline
