// The complete state that one camera carries from step to step. Two cameras with equal states give equal results for
// equal inputs, bit for bit. A replay that starts from this state therefore needs no earlier data.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <vector>

#include "server/aggregate/doors.h"
#include "server/aggregate/hidden_ahead.h"
#include "server/aggregate/lattice.h"
#include "server/aggregate/occlusion_smoother.h"
#include "server/aggregate/share_window.h"
#include "server/aggregate/temporal_volume.h"
#include "server/aggregate/viewpoint_map.h"
#include "server/base/camera.h"
#include "server/base/inline_vector.h"
#include "server/move/asked_shot.h"
#include "server/move/far_way.h"
#include "server/move/motion.h"
#include "server/move/predict.h"
#include "server/move/summed_gain.h"
#include "server/paper/pair_history.h"
#include "server/scene/target.h"
#include "server/step/suggested_path.h"
#include "server/step/tracking.h"

namespace sightline {

struct ZoomState {
  double vertical_fov_rad = 0.0;  // of the lens as it is now; 0 before the first step
  double lens_fov_rad = 0.0;      // of the input's lens at the last step
};

// The asked shot in its frame (move/asked_shot.h).
struct ShotFrameState {
  uint64_t number = 0;      // AskedShot::number
  double yaw_rad = 0.0;     // of the frame
  double age_s = 0.0;       // since the shot began
  PlaceInFrame from, to;    // the blend leads from the one to the other
  PlaceInFrame now;         // the wanted place at the last step
  uint64_t travels_id = 0;  // FRAME_TRAVEL: the instance whose direction it is
  // the horizontal direction in which the picture leaves room, world; as long as the share of the room, at most 1
  glm::dvec3 lead{0.0};
};

// An instance that is expected to hide a target from the asked place.
struct Foreseen {
  double in_s = 0.0;  // from now
  uint64_t by = 0;
};

// What is seen of a target from the asked place, lately and soon.
struct AskedSight {
  uint64_t target_id = 0;
  double hidden = 0.0;                    // share of it, [0, 1]
  uint64_t by = 0;                        // the instance that hid it last
  bool is_hidden = false;                 // at the last look
  InlineVector<Foreseen, kSlices> ahead;  // the slices at which it is expected to be hidden, in any order
};

// The shot that the camera tries to keep: its position relative to the weighted centre of one set of targets.
struct WantedShot {
  bool is_set = false;             // false: the next step takes the shot from where the camera is
  uint64_t target_set = 0;         // hash over the ids of the steered targets to which the shot belongs
  glm::dvec3 offset_m{0.0};        // from the targets' centre to the camera, world axes
  glm::dvec3 asked_offset_m{0.0};  // the same for the client's shot, before any search for a better one
  glm::dvec3 asked_m{0.0};         // the place of the client's shot at the last step, world
  ShotFrameState frame;            // of the client's shot; it counts only if it has sent one
  // from the targets' centre to the middle of the shot's subjects, from which its side, height and size are measured
  glm::dvec3 subjects_m{0.0};
  double weight = 1.0, tolerance = 1.0;  // as in AskedShot
  std::optional<glm::dvec2> place;       // of the targets in the first picture, if they are to stay there
  double up_yaw_rad = 0.0;               // yaw of the picture while the camera looks down from right above
  double cut_s = 0.0;                    // the camera may cut to the shot for this time
  InlineVector<AskedSight, kMaxTargets> at_asked;
  size_t asked_viewpoint = 0;           // the viewpoint that is nearest to the client's shot
  double asked_seen_s = 0.0;            // hardly anything has been hidden there for this time
  std::optional<size_t> viewpoint;      // the viewpoint that the search chose
  std::optional<glm::dvec3> in_line_m;  // the offset in place of offset_m while targets are far apart (far_apart.h)
  glm::dvec3 line_end_m{0.0};           // the end of the line that was chosen; it counts only with in_line_m
  // the camera does not turn into line for this time, since the targets are hidden from there
  double line_closed_s = 0.0;
  double all_kept_s = 0.0;  // no target has been given up for this time

  glm::dvec3 shown_offset_m() const { return in_line_m.value_or(offset_m); }
  // The chosen viewpoint; empty while the client's shot is kept.
  std::optional<size_t> other_viewpoint() const {
    return viewpoint && *viewpoint != asked_viewpoint ? viewpoint : std::nullopt;
  }
};

// Visibility from each candidate over the last steps.
struct CandidateMemory {
  Lattice lattice;
  TemporalVolume volume;       // which targets were seen from the lattice's cells
  PairHistory pairs;           // the pair volumes of the last steps
  OcclusionSmoother smoother;  // share of the targets that moving occluders have hidden there
  HiddenAhead ahead;           // share of the targets that is expected to be hidden there
  uint64_t ahead_targets = 0;  // hash over the ids of the steered targets to which `ahead` belongs
};

// The past poses of one target, from which its motion is predicted.
struct TargetPast {
  uint64_t id = 0;
  MotionPredictor predictor;
};

// The data that decide about cuts (Settings.cut_after_s).
struct CutState {
  double since_s = 0.0;   // since the camera was placed or cut
  double unseen_s = 0.0;  // since a required target was last seen in the picture
  // a required target has jumped, and the camera is neither near its shot of it nor has it cut since
  bool target_jumped = false;
  size_t next_rank = 0;        // of the ranked places (cut_stage.cpp), the first that was not examined yet
  double most_seen = 0.0;      // of all places examined so far, the greatest weight of required targets that one sees
  bool takes_partial = false;  // every place was examined and none sees all required targets
};

// All members are values. Limits, settings and the lens may differ at every step. The state keeps none of their former
// values, although the camera's path so far depends on them.
struct CarriedState {
  CameraState camera;
  TurnState turn;
  ZoomState zoom;
  double horizon_s = 0.0;  // grows while no candidate sees all targets
  WantedShot shot;
  ViewpointMap viewpoints;  // results of the viewpoint search so far
  std::vector<TargetPast> pasts;
  CandidateMemory candidates;
  Doors doors;
  std::optional<glm::dvec3> goal_m;  // strategy kMinCost: the last step's goal
  bool follows = false;              // it was the desired position
  // what a change between following and another course would gain; empty: they were not compared
  std::optional<SummedGain> change;
  BlindState blind;  // strategy kMinCost
  DecisionInForce in_force;
  ShareWindow shares;  // recent visible shares of the targets
  // Targets that the camera does not try to show, because they stand too far apart from others (see
  // move/keep_together.h):
  InlineVector<uint64_t, kMaxTargets> given_up;      // from any position that it may take
  InlineVector<uint64_t, kMaxTargets> not_aimed_at;  // from where it is; holds `given_up`
  SuggestedPath path;                                // poses of the last half second
  CutState cut;
  glm::dvec3 pull_mps{0.0};  // added to the next step's velocity: towards the camera that was observed
};

// Where the viewer's camera is.
struct ViewerCamera {
  Pose pose;
  glm::dvec3 velocity_mps{0.0}, angular_velocity_radps{0.0};  // a roll is left out
  double rounding_m = 0.0;  // how far `pose` may be from a pose that was returned, since the client rounded it
};

// Puts the camera there, as at the start or at a cut. Resets the wanted shot, the horizon, the lattice's
// spacing, the goal, the path, the targets that were given up and the results of the viewpoint search.
void place_camera(CarriedState& state, const ViewerCamera& viewer);
// Compares the camera with the path, by position and by rotation. Either may be near the path and go on from where it
// is, or far from it and start again from the viewer's camera (contract: ObservedCamera in session.proto). The wanted
// shot and the horizon stay. Returns true if the position starts again.
bool observe_camera(CarriedState& state, const ViewerCamera& viewer);

}  // namespace sightline
