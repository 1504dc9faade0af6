// What one camera carries from step to step: all of it, and nothing else. Two cameras whose carried states are equal answer equal
// inputs with equal bits, so a replay that starts from this state needs nothing that came before.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <vector>

#include "server/aggregate/lasting.h"
#include "server/aggregate/lattice.h"
#include "server/aggregate/share_window.h"
#include "server/aggregate/survey.h"
#include "server/aggregate/temporal_volume.h"
#include "server/base/camera.h"
#include "server/move/motion.h"
#include "server/move/predict.h"
#include "server/move/trail.h"

namespace sightline {

struct ZoomState {
  double vertical_fov_rad = 0.0;  // of the lens as it is now; 0 before the first step
  double told_fov_rad = 0.0;      // of the input's lens at the last step
};

// The shot that the camera wants: its place relative to the weighted centre of one set of targets.
struct WantedShot {
  bool is_set = false;             // false: the next step takes the shot from where the camera is
  uint64_t target_set = 0;         // hash over the ids of the steered targets that it holds for
  glm::dvec3 offset_m{0.0};        // from the targets' centre to the camera, world axes
  glm::dvec3 asked_offset_m{0.0};  // the same of the shot that the client gave, before any search for a better one
  size_t asked_viewpoint = 0;      // the viewpoint of the search that is most like the shot that the client gave
  std::optional<size_t> viewpoint; // the viewpoint that the search chose
};

// What has been seen from each candidate in the last steps.
struct CandidateMemory {
  Lattice lattice;
  TemporalVolume volume;   // which targets were seen from the lattice's cells
  LastingShares smoother;  // how much of them moving occluders have hidden there
};

// The past poses of one target, from which its motion is predicted.
struct TargetPast {
  uint64_t id = 0;
  MotionPredictor predictor;
};

// Plain members, all of them values. Limits, settings and the lens may differ at every step: nothing here depends on what they
// were, except for the way that the camera has gone.
struct CarriedState {
  CameraState camera;
  TurnState turn;
  ZoomState zoom;
  double horizon_s = 0.0;  // grows while no candidate sees all targets
  WantedShot shot;
  Survey viewpoints;  // what the search for better viewpoints has learnt
  std::vector<TargetPast> pasts;
  Trail trail;  // where the targets' centre has been
  CandidateMemory candidates;
  std::optional<glm::dvec3> goal_m;  // strategy kMinCost: the last step's goal
  ShareWindow shares;                // how much of the targets the camera has seen lately
};

// Puts the camera at `pose`, as at the start or at a cut. The wanted shot, the grown horizon, the goal and what the viewpoint search
// has learnt are forgotten.
void place_camera(CarriedState& state, const Pose& pose, const glm::dvec3& velocity_mps);
// Puts the camera at `pose` without a cut: it still wants the same shot.
void observe_camera(CarriedState& state, const Pose& pose, const glm::dvec3& velocity_mps);

}  // namespace sightline
