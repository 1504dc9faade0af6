// A session: one camera over one mirrored scene, in canonical units. It takes ticks, each whole or not at all, and answers
// steps. Knows nothing of gRPC: `receive` translates requests into these types, `reply` translates answers back.
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
#include "server/session/convention.h"
#include "server/step.h"

namespace sightline {

struct SessionOptions {
  Convention convention;
  uint64_t seed = 0;
  std::vector<NewInstance> instances;  // from the scene file and from the client
  std::vector<Target> targets;
  Pose camera;
  Lens lens;
  CameraLimits limits;
  StepSettings settings;
  std::string label;
};

struct ObservedCamera {
  Pose pose;
  glm::dvec3 velocity_mps{0.0};
  bool cut = false;
};

struct TickInput {
  uint64_t sequence = 0;
  double time_s = 0.0;
  std::optional<double> dt_s;
  // Transforms without rotations keep the instances' own: `keeps_rotations` says so.
  TransformUpdate transforms;
  bool keeps_rotations = false;
  SceneDelta delta;
  std::optional<std::vector<Target>> targets;
  std::optional<ObservedCamera> observed_camera;
  std::optional<Lens> lens;
  int64_t arrival_ns = 0;  // by the stage clock; for queue time only
};

struct SessionAnswer {
  uint64_t sequence = 0;
  double time_s = 0.0;
  double pose_time_s = 0.0;
  StepResult step;
  Lens lens;                         // as used, zoom included
  std::optional<uint64_t> relative_target_id;
  Pose target_from_camera;           // when relative_target_id is set
  bool cut = false;
  uint32_t merged_ticks = 0;
  uint64_t revision = 0;
  uint64_t hash = 0;
  int64_t queue_ns = 0, scene_ns = 0;
};

// Single-threaded: one thread at a time, any thread.
class Session {
 public:
  // Checks everything; fields are relative to the open request: "instances[2].id", "targets[0].weight",
  // "limits.max_speed_mps", "settings.bound.horizon_s".
  static Result<std::unique_ptr<Session>> open(SessionOptions options, std::unique_ptr<Sampler> sampler,
                                               StageClock clock);

  // Applies a tick whole, or answers what is wrong (field "tick....") and leaves the session as it was. Several ticks may be
  // applied before one step: they merge.
  Status apply(const TickInput& tick);

  // One step for the newest applied tick. Fails only when the sampler does.
  Result<SessionAnswer> step();

  const SceneMirror& mirror() const { return mirror_; }
  const Convention& convention() const { return options_.convention; }
  const std::vector<Target>& targets() const { return options_.targets; }
  // Intermediates of the last step, for dumps.
  const StepMemory& memory() const { return memory_; }
  const CameraLimits& limits() const { return options_.limits; }

 private:
  Session(SessionOptions options, std::unique_ptr<Sampler> sampler, StageClock clock);
  Status check(const TickInput& tick) const;
  Result<double> step_length_s(const TickInput& tick) const;

  SessionOptions options_;
  std::unique_ptr<Sampler> sampler_;
  StageClock clock_;
  SceneMirror mirror_;
  StepMemory memory_;

  bool ticked_ = false;          // a tick was applied since the session opened
  uint64_t sequence_ = 0;        // of the newest applied tick
  double time_s_ = 0.0;
  double pending_dt_s_ = 0.0;    // sum over the ticks applied since the last step
  uint32_t pending_ticks_ = 0;
  uint64_t steps_ = 0;
  bool pending_cut_ = false;
  bool pending_observed_ = false;
  int64_t newest_arrival_ns_ = 0;
  int64_t pending_scene_ns_ = 0;
};

// Checks a target list against a mirror: "targets[i].id" unknown or twice, weights, counts over kMaxTargets.
Status check_targets(const std::vector<Target>& targets, const SceneMirror& mirror);

}  // namespace sightline
