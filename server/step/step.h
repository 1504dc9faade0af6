// One step of Sightline. READ THIS FIRST: the method is the bodies of `Stepper::begin` and `Stepper::finish` in
// step.cpp,
//   bound -> sample -> aggregate -> move    (paper sections 3.1 - 3.4).
//
// A step is a pure function of the carried state and the inputs: it reads no clock, no random device and no global. The
// same state and inputs give the same result, bit for bit, on one sampler.
//   carried_state.h  the state that is carried from step to step
//   step_dump.h      the results that each stage hands to the next
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "server/aggregate/compose.h"
#include "server/base/camera.h"
#include "server/base/error.h"
#include "server/base/inline_vector.h"
#include "server/bound/bound.h"
#include "server/move/asked_shot.h"
#include "server/move/choose.h"
#include "server/move/framing.h"
#include "server/move/picture_worth.h"
#include "server/sample/extent.h"
#include "server/sample/plan.h"
#include "server/sample/sampler.h"
#include "server/scene/mirror.h"
#include "server/scene/target.h"
#include "server/settings/step_settings.h"
#include "server/step/carried_state.h"
#include "server/step/step_dump.h"

namespace sightline {

// All inputs of a step except the carried state. The referenced objects must outlive the step.
struct StepInput {
  const SceneMirror& scene;
  std::span<const Target> targets;  // at most kMaxTargets; each an instance of the scene
  const CameraLimits& limits;
  const StepSettings& settings;
  Lens lens;
  uint64_t seed = 0;
  uint64_t tick = 0;
  double dt_s = 0.0;  // >= 0; 0: paused
  // The sample table of each target's shape. If the list is empty, or an entry is null, only the target's aim point is
  // sampled.
  std::span<const ExtentTable* const> extents = {};
  // The sample tables of the parts' shapes: those of the first target, in the order of its part_ids, then those of the
  // second, and so on. The entry of a part that the scene does not hold is null. If the list is empty, no part is
  // sampled.
  std::span<const ExtentTable* const> part_extents = {};
  const AskedShot* shot = nullptr;  // the client's shot; null: it has sent none
};

// Measures the stages: returns nanoseconds, monotonic. Passed in, so that tests and replays need no clock.
using StageClock = std::function<int64_t()>;

enum class Stage { kBound, kSample, kAggregate, kMove };
inline constexpr size_t kStageCount = 4;

// An instance that hides a part of a target.
struct Occlusion {
  uint64_t id = 0;
  double share = 0.0;  // sampled points that it hides from the returned pose / all sampled points
};
inline constexpr size_t kMaxOcclusions = 8;  // of one target: those that hide most

// The expected view of a target when the time of the prediction has passed, if the camera goes on as now.
struct SightForecast {
  double ahead_s = 0.0;     // time of the prediction
  double share = 0.0;       // expected share of the target that is visible then, [0, 1]
  double confidence = 0.0;  // of the prediction of this target's motion, [0, 1] (see MotionPredictor::confidence)
  // time until the target's share falls below the visibility threshold; empty: it does not within ahead_s
  std::optional<double> loss_s;
};

struct TargetSight {
  uint64_t id = 0;
  double visible_share = 0.0;  // seen from the returned pose in this step / sampled points
  // Estimate of its visible pixels / its pixels, from the sampled points in the picture over a short time (see
  // ShareWindow). It equals visible_share while no sampled point is in the picture.
  double filtered_share = 0.0;
  double picture_share = 0.0;     // part of the target's image that lies inside the picture, hidden or not, [0, 1]
  bool filtered_visible = false;  // visible from the camera's position after the temporal filter
  bool in_picture = false;        // the aim point is
  // the camera does not try to show it, because it stands too far apart from other targets
  bool given_up = false;
  double distance_m = 0.0;
  InlineVector<Occlusion, kMaxOcclusions> occlusions;  // greatest share first; of equal ones the lower mirror slot
  std::optional<SightForecast> forecast;               // empty: nothing is predicted in this step

  uint64_t main_occluder_id() const { return occlusions.empty() ? 0 : occlusions[0].id; }
};

enum class ShotLimit { kMinDistance, kMaxDistance, kMinElevation, kMaxElevation, kPicture };

// The shot in force, and what of it the returned pose gives up (contract: ShotReport).
struct ShotReport {
  PlaceInFrame asked, now;
  ShotDeviation deviation;                      // each at most 1
  double asked_roll_rad = 0.0, roll_rad = 0.0;  // as ViewAngles::roll_rad
  double roll_deviation = 0.0;                  // [0, 1]
  // where all targets together are wanted in the picture: by the shot, or as in the first picture; half pictures
  glm::dvec2 group_place{0.0};
  double off_place = 0.0;  // half pictures; infinite with a target behind the camera
  double sight_loss = 0.0, worth = 0.0;
  uint32_t limits = 0;        // bit i: ShotLimit i is broken at the place of the shot
  double hidden_share = 0.0;  // of the targets from the place of the shot, lately
  uint64_t hidden_by = 0, hidden_target = 0;
  glm::dvec3 place_m{0.0};  // of the shot, within the limits; world
  // the instance that is expected to hide a target from there next; 0: none is expected to
  uint64_t soon_by = 0;
  uint64_t soon_target = 0;  // that target
  double soon_s = 0.0;       // when, from now, [0, 1.2]
};

struct StepFlags {
  bool dt_capped = false;      // dt was over kMaxStepS: the camera moved for kMaxStepS
  bool used_cube_map = false;  // cube faces were taken for some target
  bool body_overlap = false;   // the body touches a collider or is inside one
  bool evading = false;        // the camera moves aside for a moving collider
  bool deflected = false;      // colliders changed or stopped the camera's motion
  // the camera keeps another shot: the viewpoint search chose it, or targets are far apart
  bool new_shot = false;
  bool distance_given_up = false;  // the returned pose breaks a limit of distance (BrokenLimits)
  bool elevation_given_up = false;
};

struct StepResult {
  CameraState camera;
  double vertical_fov_rad = 0.0;
  TrackingStatus status = TrackingStatus::kHolding;
  // kSeeking: estimated time until the camera sees a target, if it moves and turns as fast as its limits allow.
  std::optional<double> view_s;
  uint64_t blocked_by = 0;  // kBlocked: the instance in the way; 0: none alone
  MoveReason reason = MoveReason::kNoTargets;
  ComparedCourses courses;  // of the newest decision
  Volume volume = Volume::kLattice;
  // The reason why pair volumes were not used although they were requested.
  bool pair_asked = false;
  bool pair_needs_two = false;      // there are fewer than two targets
  bool pair_needs_lattice = false;  // the strategy or the filter needs candidates that keep their places
  PairGap pair_gap = PairGap::kNone;
  InlineVector<TargetSight, kMaxTargets> targets;  // in the order of the input
  std::optional<ShotReport> shot;                  // empty: no target is steered, or no shot is kept
  int chosen_candidate = -1;
  bool cut = false;  // the camera jumped (MoveReason::kCut)
  StepFlags flags;
  std::array<int64_t, kStageCount> stage_ns{};
};

// The maps that a step needs, and the list that receives them. Valid until the step is finished, or another begins.
struct MapOrder {
  std::span<const MapRequest> requests;  // may be empty
  std::vector<DepthMap>* maps;           // maps[i] answers requests[i]; empty when nothing is requested
};

// Steps one camera. Not thread-safe. Once its memory has grown to what the steps need, a step allocates nothing.
struct StepContext;

class Stepper {
 public:
  Stepper();
  ~Stepper();
  Stepper(Stepper&&) noexcept;
  Stepper& operator=(Stepper&&) noexcept;

  // Say where the camera is, with effect from the next step. carried_state.h describes them.
  void place_camera(const Pose& pose, const glm::dvec3& velocity_mps);
  void place_camera(const ViewerCamera& viewer);
  bool observe_camera(const ViewerCamera& viewer);

  // The first half of a step: it computes the bound and plans the maps. The maps are taken between the halves, so that
  // those of many sessions can be taken together. The carried state does not change. If the maps cannot be taken,
  // another `begin` drops the step without a trace.
  MapOrder begin(const StepInput& input, const StageClock& clock);
  // The second half: aggregate and move. Call it after `begin`, once the maps have been taken.
  StepResult finish(const StageClock& clock);

  // Both halves, with the maps taken by `sampler` between them. Fails only when the sampler does (kUnavailable).
  Result<StepResult> take(const StepInput& input, Sampler& sampler, const StageClock& clock);

  const CarriedState& carried() const { return carried_; }
  // Goes on from the state of another camera, which was stepped so far with the same inputs.
  void resume(CarriedState carried) { carried_ = std::move(carried); }
  const StepDump& dump() const { return dump_; }  // of the last step

 private:
  struct Work;
  void begin_at_cut(const CutPlace& place);
  void keep_decision(const StepContext& step);

  CarriedState carried_;
  StepDump dump_;
  std::unique_ptr<Work> work_;  // data between the halves of a step, and memory that is reused
};

}  // namespace sightline
