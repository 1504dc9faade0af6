// A session: one camera over one mirrored scene, in canonical units. It takes ticks, each whole or not at
// all, and answers steps. Knows nothing of gRPC: `receive` translates requests into these types, `reply`
// translates answers back. Its errors speak the client's vocabulary all the same ("open.targets[2].weight",
// "tick.transforms.ids[7]").
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/base/camera.h"
#include "server/base/error.h"
#include "server/sample/sampler.h"
#include "server/scene/mirror.h"
#include "server/scene/target.h"
#include "server/session/checks.h"
#include "server/session/convention.h"
#include "server/step/step.h"

namespace sightline {

// Speeds beyond it are refused: squared and multiplied, they would leave no digit of a position.
inline constexpr double kMaxToldSpeedMps = 1e6;
// A shorter dt counts as 0: rates over it are noise.
inline constexpr double kShortestStepS = 1e-6;
// An instance whose positions imply more than this was teleported: its derived velocity is 0. Faster things
// exist; they send their velocity.
inline constexpr double kTeleportSpeedMps = 100.0;
inline constexpr size_t kMaxLabelBytes = 64;
// A session holds the files that its newest meshes came from, so that spawning a mesh again does not read its
// file again.
inline constexpr size_t kHeldAssets = 16;

// Which intermediates the client wants in every reply.
struct DiagnosticsWanted {
  bool candidates = false;
  bool depth_maps = false;
};

struct SessionOptions {
  Convention convention;
  uint64_t seed = 0;
  // The scene file, held so that others find it by its hash as long as this session lives; null: none.
  std::shared_ptr<const SceneAsset> scene;
  // Files that meshes of `instances` came from; see kHeldAssets.
  std::vector<std::shared_ptr<const SceneAsset>> mesh_assets;
  std::vector<NewInstance> instances;  // first those of the scene file, then those of the client
  size_t scene_instances = 0;          // how many are of the scene file
  std::vector<Target> targets;
  Pose camera;
  Lens lens;
  CameraLimits limits;
  StepSettings settings;
  DiagnosticsWanted diagnostics;
  std::string label;
  ExtentCache* extents =
      nullptr;  // tables of the targets' shapes; must outlive the session. Null: aim points alone
};

struct ObservedCamera {
  Pose pose;
  glm::dvec3 velocity_mps{0.0};  // at most kMaxToldSpeedMps
  bool cut = false;
};

struct TickInput {
  uint64_t sequence = 0;       // greater than that of every tick before; the first may be any
  double time_s = 0.0;         // finite, never goes back
  std::optional<double> dt_s;  // finite, >= 0; absent: time since the former tick, 0 for the first
  // Transforms without rotations keep the instances' own: `keeps_rotations` says so.
  TransformUpdate transforms;
  bool keeps_rotations = false;
  SceneDelta delta;
  std::vector<std::shared_ptr<const SceneAsset>> mesh_assets;  // files that meshes of delta.add came from
  std::optional<std::vector<Target>> targets;
  std::optional<ObservedCamera> observed_camera;
  // From this tick on, each whole: what the session had, with what the tick changes put over it. Nothing of the former
  // ones remains but the way that the camera has gone.
  std::optional<Lens> lens;
  std::optional<StepSettings> settings;
  std::optional<CameraLimits> limits;
  int64_t arrival_ns = 0;  // by the stage clock, for the queue time only; 0: not known
};

struct SessionAnswer {
  uint64_t sequence = 0;
  double time_s = 0.0;
  double pose_time_s = 0.0;
  StepResult step;
  Lens lens;  // as used, zoom included
  std::optional<uint64_t> relative_target_id;
  Pose target_from_camera;  // when relative_target_id is set
  bool cut = false;
  uint32_t merged_ticks = 0;
  // At which level of economy the step was taken (server/step/quality_level.h), and with which settings, if that changed any of
  // them.
  int quality_level = 0;
  std::optional<StepSettings> degraded;
  uint64_t revision = 0;
  uint64_t hash = 0;
  int64_t queue_ns = 0, scene_ns = 0;
};

// Single-threaded: one thread at a time, any thread.
//
// Velocities that the client does not send are derived from successive positions over the tick's dt. They are
// 0 for an instance that the tick adds or that was teleported (kTeleportSpeedMps). An instance that moved and
// is then no longer named stays, so its derived velocity ends. When dt is 0 nothing is derived: what stands
// where it stood keeps its velocity, what jumped has none.
class Session {
 public:
  // Checks everything: settings and limits in their ranges, ids, targets, the camera's pose, and that the
  // body contains the near plane's corners at the widest zoom. Fields are paths in the open request:
  // "open.instances[2].id", "open.targets[0].weight", "open.limits.max_speed_mps",
  // "open.tuning.bound.horizon_s".
  static Result<std::unique_ptr<Session>> open(SessionOptions options, std::unique_ptr<Sampler> sampler,
                                               StageClock clock);

  // Applies a tick whole, or answers what is wrong (field "tick....") and leaves the session as it was.
  // Several ticks may be applied before one step: they merge. The dt of merged ticks adds up; an observed
  // camera starts it anew, since the camera is known to be there at that tick. Of settings, limits and lenses
  // the newest hold.
  //
  // Lower limits than the camera is at: it brakes, as hard as the new acceleration allows, and is within them
  // from then on. A lower acceleration or a larger body than the room in front of the camera was left for may
  // bring it to touch a collider, flagged as `body_overlap`.
  Status apply(const TickInput& tick);

  // One step for the newest applied tick; without a new one, a paused step. Fails only when the sampler does: what was
  // applied is then part of the next step. `quality_level`, [0, kLowestQualityLevel], says what this one step leaves out;
  // it is an input as the ticks are, so that the same levels give the same answers.
  Result<SessionAnswer> step(int quality_level = 0);

  // The same in two halves, so that the maps of many sessions are taken together (SamplerDevice::take_all). The job
  // refers into the session; `taken` is what became of it. Nothing else may be called between the halves.
  TakeJob begin_step(int quality_level = 0);
  Result<SessionAnswer> finish_step(const Status& taken);

  const SceneMirror& mirror() const { return mirror_; }
  const Convention& convention() const { return options_.convention; }
  const std::vector<Target>& targets() const { return options_.targets; }
  const CameraLimits& limits() const { return options_.limits; }
  const StepSettings& settings() const { return options_.settings; }
  const Lens& lens() const { return options_.lens; }  // as last told, not zoomed
  const DiagnosticsWanted& diagnostics() const { return options_.diagnostics; }
  const std::string& label() const { return options_.label; }
  // Whether sampling surface points of this instance would first have to build a table of its shape: 10 ms for a
  // capsule, seconds for a million triangles (ExtentTable::build). Points or not is a setting.
  bool lacks_table(uint64_t instance_id) const;
  // What is carried to the next step, the camera included, and what the stages of the last step made.
  const CarriedState& carried() const { return stepper_.carried(); }
  const StepDump& dump() const { return stepper_.dump(); }
  size_t triangle_count() const;  // as instanced, hidden ones too

 private:
  Session(SessionOptions options, std::unique_ptr<Sampler> sampler, StageClock clock);
  Status add_first_instances();
  Status check(const TickInput& tick, const IdsAfter& ids) const;
  Status check_clock(const TickInput& tick) const;
  Status check_camera(const TickInput& tick) const;
  Status check_terms(const TickInput& tick) const;
  double step_length_s(const TickInput& tick) const;
  void fill_update(const TickInput& tick, const IdsAfter& ids);
  glm::dvec3 derived_velocity_mps(const Instance* before, const glm::dvec3& now_m, double dt_s) const;
  void stop_unnamed(const IdsAfter& ids);
  void commit(const TickInput& tick);
  void take_extents();
  void hold(const std::vector<std::shared_ptr<const SceneAsset>>& assets);
  void remember_derived(const TickInput& tick, double dt_s);
  void observe(const ObservedCamera& observed, double dt_s);
  void describe_relative(SessionAnswer& answer) const;

  SessionOptions options_;  // targets, lens, settings and limits as last told
  std::unique_ptr<Sampler> sampler_;
  StageClock clock_;
  std::vector<std::shared_ptr<const ExtentTable>> extents_;  // by target
  std::vector<const ExtentTable*> extent_views_;             // the same, as a step takes them
  SceneMirror mirror_;
  Stepper stepper_;
  StepSettings degraded_;       // of the present step, which refers to them
  int quality_level_ = 0;         // of it; 0: those told
  int64_t step_start_ns_ = 0, take_start_ns_ = 0;

  bool ticked_ = false;    // a tick was applied since the session opened
  uint64_t sequence_ = 0;  // of the newest applied tick
  double time_s_ = 0.0;
  uint64_t steps_ = 0;

  // Since the last step:
  double pending_dt_s_ = 0.0;
  uint32_t pending_ticks_ = 0;
  bool pending_cut_ = false;
  int64_t pending_scene_ns_ = 0;
  int64_t newest_arrival_ns_ = 0;

  std::vector<uint64_t> derived_moving_;  // instances with a derived velocity that is not 0
  std::vector<uint64_t> former_ids_;      // named by the tick that derived them
  TransformUpdate update_;                // scratch memory, reused
};

}  // namespace sightline
