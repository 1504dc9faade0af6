// One step of Sightline. READ THIS FIRST: the method is the bodies of `begin_step`, `take_step` and `finish_step` in step.cpp,
//   bound -> sample -> aggregate -> move    (paper sections 3.1 - 3.4).
//
// A step is a pure function of (memory, inputs): no clock decides anything, no random device, no global. The same memory
// and inputs give the same result bit for bit on one sampler.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "server/aggregate/compose.h"
#include "server/aggregate/lasting.h"
#include "server/aggregate/lattice.h"
#include "server/aggregate/pair_chain.h"
#include "server/aggregate/share_window.h"
#include "server/aggregate/survey.h"
#include "server/aggregate/temporal_volume.h"
#include "server/base/camera.h"
#include "server/base/error.h"
#include "server/base/inline_vector.h"
#include "server/bound/bound.h"
#include "server/move/body.h"
#include "server/move/choose.h"
#include "server/move/decision.h"
#include "server/move/depths.h"
#include "server/move/framing.h"
#include "server/move/motion.h"
#include "server/move/predict.h"
#include "server/move/route.h"
#include "server/move/shelter.h"
#include "server/move/shot.h"
#include "server/move/standoff.h"
#include "server/move/trail.h"
#include "server/sample/extent.h"
#include "server/sample/plan.h"
#include "server/sample/sampler.h"
#include "server/scene/mirror.h"
#include "server/scene/target.h"
#include "server/settings/step_settings.h"

namespace sightline {

// Everything that a step reads besides the memory. References must outlive the call.
struct StepInput {
  const SceneMirror& scene;
  std::span<const Target> targets;  // at most kMaxTargets; each an instance of the scene
  const CameraLimits& limits;
  const StepSettings& settings;
  Lens lens;
  uint64_t seed = 0;
  uint64_t tick = 0;
  double dt_s = 0.0;  // >= 0; 0: paused
  // By target: the sample table of its shape; empty, or null for one target: its aim point alone is sampled. Must outlive the
  // call.
  std::span<const ExtentTable* const> extents = {};
};

// Stage clock, injected so that tests and replays can do without one: returns nanoseconds, monotonic.
using StageClock = std::function<int64_t()>;

enum class Stage { kBound, kSample, kAggregate, kMove };
inline constexpr size_t kStageCount = 4;

// What is sampled of the targets in one step. A point of a target has one map, or several, over the bound. Sights are single-texel
// maps to the camera's own place: as many, of points that the target shows there. It may show others to the middle of the bound.
struct Sampled {
  std::vector<glm::dvec3> points_m;     // world
  std::vector<MapRange> maps_of_point;  // over the bound
  std::vector<MapRange> points_of_target;
  std::vector<glm::dvec3> sights_m;  // where they are taken from, world; none of points ahead
  std::vector<MapRange> sights_of_target;
  uint32_t first_sight = 0;  // sight k is map first_sight + k

  void clear() {
    points_m.clear(), maps_of_point.clear(), points_of_target.clear();
    sights_m.clear(), sights_of_target.clear();
  }
};

// Where one target has been: what its prediction is made from.
struct TargetPast {
  uint64_t id = 0;
  MotionPredictor predictor;
  bool current = false;  // still a target in this step
};

// One way in which the targets may go on from here, all of them alike: where each one's aim point will be.
struct Future {
  Sampled sampled;
  double weight = 0.0;  // how likely; those of all futures sum to 1
};

inline constexpr size_t kMaxFutures = 3;  // going on, and turning to either side

// The survey of a step, and the shot that it leads to.
struct ShotSearch {
  Survey survey;
  size_t looking = 0;              // which target looks round in this step
  MapRange maps;                   // what it sees; none without a survey
  glm::dvec3 asked_offset_m{0.0};  // of the shot that the client gave
  size_t asked_place = 0;          // of the survey, most like it
  std::optional<size_t> place;     // of the survey, that the camera wants
  ShotState asked, present;
};

// How a goal is found and gone to (strategy kMinCost).
struct GoalSearch {
  std::vector<double> target_weights;
  HiddenShares hidden_by;       // by candidate: what is expected to be hidden, by what
  std::vector<uint8_t> passes;  // by mirror slot: moves, and is no target
  LastingShares lasting;        // of what they hide
  std::vector<double> hidden;   // by candidate: what counts as hidden, [0, 1]
  Standoff standoff;
  std::vector<float> clearance_m;  // by candidate, to what stands, 0 where a mover is about to be
  Depths depths;                   // among the places that see all
  RouteFinder routes;
  bool lost = false;  // nothing is seen from any place that can be reached
  Trail trail;
  ClearanceField trail_colliders;    // along it; those of the body's own reach stay apart
  std::optional<glm::dvec3> goal_m;  // the former step's
};

// What one session carries from step to step, and scratch memory that is reused. Limits, settings and the lens may be others
// at every step: nothing here depends on what they were, but the way that the camera has gone.
struct StepMemory {
  CameraState camera;
  TurnState turn;
  double vertical_fov_rad = 0.0;  // present zoom; 0 before the first step
  double told_fov_rad = 0.0;      // of the input's lens at the last step
  bool has_offset = false;
  glm::dvec3 desired_offset_m{0.0};  // from the targets' weighted centre to the place that the camera wants
  uint64_t offset_targets = 0;       // for which set of steered targets (their ids, hashed) it holds
  double horizon_s = 0.0;            // grows while escaping
  Lattice lattice;
  TemporalVolume volume;  // what the lattice's cells have seen
  std::vector<TargetPast> pasts;
  ShareWindow shares;  // of the targets' pixels that the camera has seen lately

  // Intermediates of the last step: what is dumped and drawn.
  Bound bound;
  std::vector<TargetView> target_views;
  std::vector<MapRequest> requests;
  std::vector<MapView> views;
  std::vector<std::vector<uint32_t>> ignored_slots;  // by target
  Sampled now;                                       // the targets where they are
  Sampled ahead;                // and where they are predicted to be; empty without prediction
  InlineVector<Future, kMaxFutures> futures;  // other ways that the targets may take until then
  double ahead_s = 0.0;         // for how far; 0: not in this step
  double ahead_confidence = 0.0;
  std::vector<glm::dvec3> chained_m;  // one point a target, when pair volumes are asked for
  PairChain chain;                    // of these; when complete
  std::vector<DepthMap> maps;
  CandidateSet candidates;
  std::vector<glm::dvec3> place_m;  // the candidates' places, listed for the strategies that go over them often
  SightCounts counts;
  ClearanceField colliders;
  MoversAhead movers_ahead;
  std::vector<uint32_t> slots;
  FilteredSights filtered;
  std::vector<glm::ivec3> cells;
  std::vector<uint8_t> members;
  Composer composer;
  std::vector<uint32_t> off_grid_visible;  // of the candidates beside a pair volume's
  ShotSearch shot;
  GoalSearch goal;
  GroupScratch group_scratch;
  Groups groups;  // strategy robust only
  ShelterScratch shelter_scratch;
  std::vector<uint32_t> shelter_squared;  // by candidate; strategy robust only
  std::vector<double> cost;               // by candidate; strategy robust only
  ChoiceScratch choice_scratch;
  std::vector<glm::vec3> picked;
  std::vector<uint64_t> target_ids;
};

// Puts the camera at `pose` with velocity zero, as at the start or at a cut: the desired place, the escape and the survey are
// forgotten.
void place_camera(StepMemory& memory, const Pose& pose, const glm::dvec3& velocity_mps);

struct TargetSight {
  uint64_t id = 0;
  double visible_share = 0.0;  // sampled points seen from the returned pose, in this step
  // The estimate of its visible pixels / its pixels: of the sampled points in the picture, over the steps of a short time (see
  // ShareWindow). While none of them is in the picture, visible_share.
  double filtered_share = 0.0;
  bool filtered_visible = false;  // what the filter makes of it
  bool in_picture = false;
  double distance_m = 0.0;
  uint64_t occluder_id = 0;  // what hides it; 0: nothing
};

struct StepFlags {
  bool dt_capped = false;        // dt was over kMaxStepS: the camera moved for kMaxStepS
  bool used_cube_map = false;  // cube faces were taken for some target
  bool body_overlap = false;
};

struct StepResult {
  CameraState camera;
  double vertical_fov_rad = 0.0;
  MoveStatus status = MoveStatus::kHolding;
  MoveReason reason = MoveReason::kNoTargets;
  Volume volume = Volume::kLattice;
  // Why the pair volumes were not used although asked for; empty when they were, or were not asked for.
  bool pair_asked = false;
  bool pair_needs_two = false;  // there are fewer targets than that
  PairGap pair_gap = PairGap::kNone;
  InlineVector<TargetSight, kMaxTargets> targets;  // in the order of the input
  int chosen_candidate = -1;
  StepFlags flags;
  std::array<int64_t, kStageCount> stage_ns{};
};

// A step between its halves: the inputs, and the answer that grows stage by stage. Made by `begin_step`; what it refers to must
// outlive it. Opaque to callers.
struct StepWork {
  StepMemory& memory;
  StepInput input;
  StepResult result;
  double move_s = 0;     // for how long the camera moves
  uint32_t steered = 0;  // bit i: target i has a weight
  Lens lens;             // as it is now, zoom included
  bool pair = false;     // the candidates are those of the memory's chain of pair volumes
  bool on_lattice =
      false;  // the candidates before the camera's own place are the lattice's cells, not the pair volume's
  size_t own_candidate = 0;  // index of the camera's own place among the candidates
};

// The first half: bound, and which maps to take (memory.requests; maybe none). Taking them, into memory.maps, lies between the
// halves, so that the maps of many sessions can be taken together; the second half aggregates and moves. A step whose maps cannot
// be taken is dropped: the memory's camera is where it was.
StepWork begin_step(StepMemory& memory, const StepInput& input, const StageClock& clock);
StepResult finish_step(StepWork work, const StageClock& clock);

// Both halves, and the maps taken by `sampler` between them. Fails only when the sampler does (kUnavailable); the memory's camera
// is then where it was.
Result<StepResult> take_step(StepMemory& memory, const StepInput& input, Sampler& sampler,
                             const StageClock& clock);

}  // namespace sightline
