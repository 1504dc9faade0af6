// A session: one camera over one mirrored scene, in canonical units. It applies ticks, each completely or not at all,
// and computes steps. It does not depend on gRPC: server/wire converts requests to these types and answers back. Its
// errors nevertheless name the fields of the client's messages ("open.targets[2].weight", "tick.transforms.ids[7]").
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "server/base/camera.h"
#include "server/base/error.h"
#include "server/sample/sampler.h"
#include "server/scene/mirror.h"
#include "server/scene/target.h"
#include "server/session/checks.h"
#include "server/session/convention.h"
#include "server/session/motion_track.h"
#include "server/session/turn_track.h"
#include "server/step/step.h"

namespace sightline {

// Greater speeds are refused, because their squares and products would leave a position no significant digit.
inline constexpr double kMaxSentSpeedMps = 1e6;
inline constexpr double kMaxSentTurnRadps = 1000.0;
// Times and time steps that are greater are refused. Any count of nanoseconds in 64 bits is less.
inline constexpr double kFarthestTimeS = 1e20;
// A shorter dt counts as 0, because rates derived over it are noise.
inline constexpr double kShortestStepS = 1e-6;
// A longer dt, after the longest of pauses, counts as so long.
inline constexpr double kLongestStepS = 1e6;
// An instance whose positions imply a greater speed counts as teleported, and its derived velocity is 0. Clients send
// the velocity of faster instances.
inline constexpr double kTeleportSpeedMps = 100.0;
inline constexpr size_t kMaxLabelBytes = 64;
// Number of files of the newest meshes that a session keeps loaded, so that adding such a mesh again does not read
// its file.
inline constexpr size_t kHeldAssets = 16;

// The intermediate results that the client wants in every reply.
struct DiagnosticsWanted {
  bool candidates = false;
  bool depth_maps = false;
};

struct SessionOptions {
  Convention convention;
  uint64_t seed = 0;
  // The scene file, kept loaded so that other sessions find it by its hash while this one lives; null: none.
  std::shared_ptr<const SceneAsset> scene;
  // Files that meshes of `instances` came from; see kHeldAssets.
  std::vector<std::shared_ptr<const SceneAsset>> mesh_assets;
  std::vector<NewInstance> instances;  // the instances of the scene file, then the client's
  size_t scene_instances = 0;          // number of instances of the scene file
  std::vector<Target> targets;
  Pose camera;
  Lens lens;
  CameraLimits limits;
  StepSettings settings;
  AskedShot shot;  // number 0: the client sent none
  DiagnosticsWanted diagnostics;
  std::string label;
  ExtentCache*
      extents = nullptr;  // tables of the targets' shapes; must outlive the session. Null: only aim points are sampled
};

struct ObservedCamera {
  Pose pose;
  glm::dvec3 velocity_mps{0.0};  // at most kMaxSentSpeedMps
  bool cut = false;
  glm::dvec3 angular_velocity_radps{0.0};  // at most kMaxSentTurnRadps
};

struct TickInput {
  uint64_t sequence = 0;       // greater than in every earlier tick; any number in the first
  double time_s = 0.0;         // within kFarthestTimeS, never goes back
  std::optional<double> dt_s;  // [0, kFarthestTimeS]; absent: time since the last tick, 0 for the first
  // If `keeps_rotations`, the rotations of the transforms are ignored and the instances keep theirs.
  TransformUpdate transforms;
  bool keeps_rotations = false;
  SceneDelta delta;
  std::vector<std::shared_ptr<const SceneAsset>> mesh_assets;  // files of the meshes of delta.add
  std::optional<std::vector<Target>> targets;
  std::optional<ObservedCamera> observed_camera;
  // New values from this tick on. Each is complete: the session's former values with the tick's changes applied.
  std::optional<Lens> lens;
  std::optional<StepSettings> settings;
  std::optional<CameraLimits> limits;
  std::optional<AskedShot> shot;  // replaces the former one as a whole; its number is set by the session
  // By how much the client's world has moved (contract: Tick.world_shift). The origin of the session's convention moves
  // along, so the session's own coordinates stay. All positions of the tick are in the session's coordinates.
  glm::dvec3 world_shift_m{0.0};
  int64_t arrival_ns = 0;  // by the stage clock, for the queue time only; 0: not known
};

struct SessionAnswer {
  uint64_t sequence = 0;
  double time_s = 0.0;
  double pose_time_s = 0.0;
  double moved_s = 0.0;  // the time that the step took the camera on for, of all merged ticks, at most kMaxStepS
  StepResult step;
  Lens lens;  // as used, zoom included
  std::optional<uint64_t> relative_target_id;
  // When relative_target_id is set: the camera in the frame of that target, and in a frame at the target's origin with
  // the axes of the world.
  Pose target_from_camera, unrotated_from_camera;
  bool cut = false;
  uint32_t merged_ticks = 0;
  // Quality level of the step (server/step/quality_level.h), and the settings that it used if the level changed any.
  int quality_level = 0;
  std::optional<StepSettings> degraded;
  uint64_t revision = 0;
  uint64_t hash = 0;
  int64_t queue_ns = 0, scene_ns = 0;
};

// Single-threaded: one thread at a time, any thread.
//
// Velocities that the client does not send are derived from successive positions over the tick's dt (motion_track.h).
// They are 0 for an instance that the tick adds or that was teleported (kTeleportSpeedMps). An instance that a tick no
// longer names is where it was, so it has stopped, unless its positions are held for several ticks. Angular velocities
// are derived from rotations likewise (turn_track.h). When dt is 0, an instance whose position is unchanged keeps its
// velocity, and the velocity of any other becomes 0.
class Session {
 public:
  // Checks all options: ids, targets, the camera's pose, and the ranges of settings and limits. The body must contain
  // the near plane's corners at the widest zoom. Fields are paths in the open request: "open.instances[2].id",
  // "open.targets[0].weight", "open.limits.max_speed_mps", "open.tuning.bound.horizon_s".
  static Result<std::unique_ptr<Session>> open(SessionOptions options, std::unique_ptr<Sampler> sampler,
                                               StageClock clock);

  // Applies a tick completely, or returns an error (field "tick....") and leaves the session unchanged. Several ticks
  // may be applied before one step, which merges them. The dt of merged ticks adds up. An observed camera that
  // starts the position again restarts the sum, because the position is known at that tick. The newest settings, limits
  // and lens are used.
  //
  // If a tick lowers a limit below the camera's present value, the camera brakes as hard as the new acceleration
  // allows. The camera kept room only for its former acceleration and body. After a lower acceleration or a larger
  // body it may therefore touch a collider, which is flagged as `body_overlap`.
  Status apply(const TickInput& tick);

  // One step for the newest applied tick; without a new one, a paused step. Fails when the sampler does; the
  // next step then covers the applied ticks. kInternal: a number of the step is not finite, which is a defect. Then the
  // session must end, since its state may hold such numbers as well. `quality_level`, [0, kLowestQualityLevel], is an
  // input like the ticks, so the same levels give the same answers.
  Result<SessionAnswer> step(int quality_level = 0);

  // The same in two halves, so that the maps of many sessions are taken together (SamplerDevice::take_all). The job
  // refers to data of the session; `taken` is its result. Call no other function between the halves.
  TakeJob begin_step(int quality_level = 0);
  Result<SessionAnswer> finish_step(const Status& taken);

  const SceneMirror& mirror() const { return mirror_; }
  const Convention& convention() const { return options_.convention; }
  const std::vector<Target>& targets() const { return options_.targets; }
  const CameraLimits& limits() const { return options_.limits; }
  const StepSettings& settings() const { return options_.settings; }
  const Lens& lens() const { return options_.lens; }  // as last sent, without zoom
  const DiagnosticsWanted& diagnostics() const { return options_.diagnostics; }
  const std::string& label() const { return options_.label; }
  uint64_t sequence() const { return sequence_; }  // of the newest applied tick; 0 before the first
  // True if a table of the instance's shape must be built before its surface points can be sampled. That takes 10 ms
  // for a capsule and seconds for a million triangles (ExtentTable::build). Settings may make tables unnecessary;
  // this function ignores them.
  bool lacks_table(uint64_t instance_id) const;
  // The state that is carried to the next step, the camera included, and the results of the last step's stages.
  const CarriedState& carried() const { return stepper_.carried(); }
  const StepDump& dump() const { return stepper_.dump(); }

  // Appends all that later replies depend on beyond what ticks say: the carried state, the exact transforms and the
  // clock (server/session/session_memory.cpp). Call it after a step, before the next tick.
  void write_memory(std::string& out) const;
  // Goes on from such bytes, in a session with the same scene, targets, settings and limits: every later reply has the
  // same bits as that of the session that wrote them. The next tick must be the one that followed. kInvalidArgument
  // (field "memory") when the bytes are damaged, of another scene or of another layout. The session is then as it was,
  // except that instances may have moved.
  Status resume(uint64_t layout, std::string_view memory);
  // Identifies the fields of the bytes. Programs with other fields have another number.
  static uint64_t memory_layout();
  size_t triangle_count() const;  // as instanced, hidden ones too

 private:
  friend struct StateFields;  // lists its fields, to write and read them as bytes (server/session/state_fields.h)
  // How an instance has moved so far.
  struct Track {
    MotionTrack motion;
    TurnTrack turn;
  };
  // The motion of an instance as a tick gives it; null: it does not.
  struct SentMotion {
    const glm::dvec3 *velocity_mps = nullptr, *angular_velocity_radps = nullptr;
  };
  Session(SessionOptions options, std::unique_ptr<Sampler> sampler, StageClock clock);
  Status add_first_instances();
  Status check(const TickInput& tick, const IdsAfter& ids) const;
  Status check_clock(const TickInput& tick) const;
  Status check_camera(const TickInput& tick) const;
  Status check_terms(const TickInput& tick) const;
  double step_length_s(const TickInput& tick) const;
  void fill_update(const TickInput& tick, const IdsAfter& ids);
  void stay_if_rounded(const Instance& before, const glm::dvec3& world_shift_m, glm::dvec3& position_m) const;
  Track track_of(uint64_t id, const Instance* before, const glm::dvec3& now_m) const;
  void add_motion(uint64_t id, const Instance* before, const Pose& now, const SentMotion& sent, double dt_s);
  void add_motion(const MotionEstimate& estimate, const glm::dvec3& angular_velocity_radps);
  void add_unnamed(const IdsAfter& ids, double dt_s);
  void commit(const TickInput& tick);
  void take_extents();
  const ExtentTable* extent_of(const Instance& instance);
  void hold(const std::vector<std::shared_ptr<const SceneAsset>>& assets);
  void remember_motion(const TickInput& tick, double dt_s);
  void observe(const ObservedCamera& observed, double dt_s);
  void describe_relative(SessionAnswer& answer) const;

  SessionOptions options_;  // with the newest targets, lens, settings and limits
  std::unique_ptr<Sampler> sampler_;
  StageClock clock_;
  std::vector<std::shared_ptr<const ExtentTable>> extents_;           // of the shapes of targets and parts
  std::vector<const ExtentTable*> extent_views_, part_extent_views_;  // the same, as a step takes them
  SceneMirror mirror_;
  Stepper stepper_;
  StepSettings degraded_;  // settings of the present step, which refers to them
  int quality_level_ = 0;  // of the present step; 0: options_.settings are used
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

  std::unordered_map<uint64_t, Track> tracks_;          // of instances that ticks have named
  std::vector<std::pair<uint64_t, Track>> new_tracks_;  // of the tick that is being applied
  // instances with a derived velocity, angular velocity or correction that is not 0
  std::vector<uint64_t> derived_moving_;
  // named by the tick that derived them, or added to it because they still moved
  std::vector<uint64_t> former_ids_;
  TransformUpdate update_;  // scratch memory, reused
};

}  // namespace sightline
