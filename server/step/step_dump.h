// The results of a step, stage by stage. They stay readable until the next step begins, so that they can be dumped,
// drawn and tested.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <vector>

#include "server/aggregate/candidates.h"
#include "server/aggregate/compose.h"
#include "server/aggregate/hidden_ahead.h"
#include "server/base/camera.h"
#include "server/base/inline_vector.h"
#include "server/bound/bound.h"
#include "server/move/body.h"
#include "server/move/decision.h"
#include "server/move/far_way.h"
#include "server/move/motion.h"
#include "server/move/summed_gain.h"
#include "server/paper/pair_chain.h"
#include "server/sample/depth_map.h"
#include "server/scene/clearance.h"
#include "server/scene/target.h"
#include "server/step/tracking.h"

namespace sightline {

using TargetIds = InlineVector<uint64_t, kMaxTargets>;
class ExtentTable;

// An instance that counts as the target: its own, or a part.
struct TargetPiece {
  uint32_t slot = 0;                   // mirror slot
  const ExtentTable* table = nullptr;  // of its shape; null: its surface is not sampled
};

// Before the first stage: the targets as they are now. Lists are in the order of the input.
struct TargetsNow {
  std::vector<TrackedTarget> tracked_targets;
  std::vector<uint64_t> ids;
  std::vector<double> sight_weights;                 // weight of seeing each target
  std::vector<std::vector<uint32_t>> ignored_slots;  // mirror slots of instances that never occlude each target
  std::vector<std::vector<TargetPiece>> pieces;      // of each target; at least one
  uint32_t weighted = 0;                             // bit i: target i has a weight
  // Bit i: the camera moves for target i. Targets with a weight that stand too far apart from the others are given up;
  // their weight in `tracked_targets` and `sight_weights` is 0.
  uint32_t steered = 0;
};

// Surface points of the targets, and the maps that are taken from them. A point has one or more maps that cover the
// bound. A sight is a map of a single texel towards the camera's own position.
struct Sampled {
  std::vector<glm::dvec3> points_m;     // world
  std::vector<MapRange> maps_of_point;  // over the bound
  std::vector<MapRange> points_of_target;
  // The points of the sights. They are as many as the points above. Those were picked for a viewer at the bound's
  // centre, these for a viewer at the camera's position. Predicted targets have no sights; with strategy kMinCost the
  // maps of their points are of a
  // single texel towards SamplePlan::camera_ahead_m.
  std::vector<glm::dvec3> sights_m;
  std::vector<MapRange> sights_of_target;
  uint32_t first_sight = 0;  // sight k is map first_sight + k

  void clear() {
    points_m.clear(), maps_of_point.clear(), points_of_target.clear();
    sights_m.clear(), sights_of_target.clear();
  }
};

// The targets as they may be at a slice of the flight plan whose expected shares are renewed in this step.
struct SampledSlice {
  DueSlice due;
  InlineVector<glm::dvec3, kMaxTargets> aim_m;  // where they are then; by target
  bool turned = false;                          // they are taken to turn to one side
  Sampled sampled;
};

// Use of pair volumes, and the reason if they were requested but not used.
struct PairPlan {
  bool asked = false;
  bool needs_two = false;      // there are fewer than two targets
  bool needs_lattice = false;  // the strategy or the filter needs candidates that keep their places
  PairGap gap = PairGap::kNone;
  bool used = false;
};

// A single ray from where a target will be to where the place of the client's shot will be then.
struct SightAhead {
  size_t target = 0;        // index
  uint32_t map = 0;         // index of the map of a single texel
  double ahead_s = 0.0;     // when, from the step's present
  glm::dvec3 place_m{0.0};  // of the shot then; world
};

// The maps that the viewpoint search takes in all directions from one target. Empty when the search is off.
struct ViewpointLook {
  bool searches = false;
  size_t target = 0;
  MapRange maps;
  uint32_t asked_sight = 0;  // a map of a single texel towards the place of the client's shot
  // the same for each target at the slices that are renewed in this step, if the targets go on as they do
  InlineVector<SightAhead, kSlices* kMaxTargets> ahead = {};
};

// A place that the camera may jump to, with sights of every target from there, as in Sampled.
struct CutPlace {
  glm::dvec3 position_m{0.0};
  std::optional<size_t> viewpoint;  // empty: the wanted shot
  std::vector<glm::dvec3> sights_m;
  std::vector<MapRange> sights_of_target;
  uint32_t first_sight = 0;
};
inline constexpr size_t kCutPlaces = 8;  // examined in one step

// The places that are examined in this step, because a cut is due; best first.
struct CutPlan {
  bool due = false;
  InlineVector<CutPlace, kCutPlaces> places;
  size_t next_rank = 0;  // see CutState
  bool examined_all = false;
};

// Result of the sample stage: the maps to take.
struct SamplePlan {
  Sampled now;           // the targets at their present poses
  Sampled ahead;         // the targets at their predicted poses; empty without a prediction
  double ahead_s = 0.0;  // time of that prediction; 0: no prediction in this step
  double ahead_confidence = 0.0;
  glm::dvec3 camera_ahead_m{0.0};              // where the camera is expected to be at that time; in the bound
  InlineVector<SampledSlice, kSlices> slices;  // strategy kMinCost
  PairPlan pair;
  std::vector<glm::dvec3> chained_m;  // one point of each target, when pair volumes are asked for
  PairChain chain;                    // of these points; valid when pair.used
  ViewpointLook look;
  CutPlan cut;
  bool used_cube_map = false;  // cube faces are taken for some target
  std::vector<MapView> views;
  std::vector<MapRequest> requests;  // parallel to the views
};

// Result of the aggregate stage: the targets that each candidate sees.
struct CandidateSights {
  CandidateSet candidates;
  size_t own_candidate = 0;  // index of the camera's own position among the candidates
  bool on_lattice = false;   // the first candidates are the lattice's cells rather than a pair volume's
  // of a pair volume: (u, v, w) of every candidate. One outside the volume has texels without a neighbour.
  std::vector<glm::ivec3> texels;
  // of the candidates, listed; empty for strategy kBasic. For kMinCost where the body fits (clearance_cache.h)
  std::vector<glm::dvec3> position_m;
  std::vector<float> clearance_m;  // strategy kMinCost: by candidate, to static colliders, within a limit
  std::vector<double> hidden;      // strategy kMinCost: by candidate, the hidden share of the targets, [0, 1]
  SightCounts counts;
};

// Colliders near the camera, now and soon.
struct Surroundings {
  ClearanceField colliders;
  MoversAhead movers_ahead;
};

// Where the camera should be `at_s` after the step's present.
struct PlanPoint {
  double at_s = 0.0;
  glm::dvec3 position_m{0.0};
};

// Result of the move stage: the camera's next pose, with the reason.
struct Decision {
  MoveStatus status = MoveStatus::kHolding;
  MoveReason reason = MoveReason::kNoTargets;         // of what the camera does in this step
  MoveReason course_reason = MoveReason::kNoTargets;  // of the course, whatever kept the body from it
  ComparedCourses courses;
  HeldFacts facts;
  int chosen_candidate = -1;  // -1: none
  // Length of the way to the first candidate on it that is expected to see a target. Empty: the camera goes to none.
  std::optional<double> view_way_m;
  bool sees_none = false;                    // no candidate that can be reached sees any target
  std::optional<glm::dvec3> nearest_view_m;  // then: the nearest candidate that does see one
  glm::dvec3 wanted_mps{0.0};                // the velocity that leads to the goal, before collisions are avoided
  bool body_overlap = false, evading = false, deflected = false;  // as StepFlags
  bool cut = false;                                               // the camera jumps
  CameraState camera;                                             // at the end of the step
  TurnState turn;
  double vertical_fov_rad = 0.0;
  double horizon_s = 0.0;
  std::optional<glm::dvec3> goal_m;  // see kGoalS (stages.h)
  bool follows = false;              // the goal is the desired position
  Tracking tracking;                 // how later steps carry it out
  // what the change between following and another course would gain; empty: they were not compared
  std::optional<SummedGain> change;
  BlindState blind;                             // strategy kMinCost
  InlineVector<PlanPoint, kSlices + 2> plan_m;  // the flight plan; empty unless the camera flies by one
  TargetIds not_aimed_at;                       // steered targets that the picture cannot hold together with the others
};

// Between two decisions `bound`, the maps of the candidates and `sights.candidates` are empty or as they were.
struct StepDump {
  bool decided = true;
  TargetsNow targets;
  Bound bound;
  SamplePlan plan;
  std::vector<DepthMap> maps;  // by request of the plan
  CandidateSights sights;
  bool new_shot = false;  // as StepFlags::new_shot
  Surroundings surroundings;
  Decision decision;
};

}  // namespace sightline
