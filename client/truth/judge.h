// Judges a camera's path through a scenario, frame by frame, whoever made the path: a session or a baseline.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "client/scenario/scenario_world.h"
#include "client/truth/truth.h"

namespace sightline {

// One frame of a path: where the camera was while the scene was as at `time_s`. Times never go back.
struct CameraFrame {
  double time_s = 0.0;
  Pose camera;
  Lens lens;
  // The path need not obey the limits on the way to this frame: a declared cut, or a gap longer than a step
  // may move.
  bool jump = false;
};

struct FrameTruth {
  BodyTruth body;
  // Where each target's centre is in the picture, in picture heights from its middle, right and up; none:
  // outside. In the order of ScenarioWorld::targets(); of every frame.
  std::vector<std::optional<glm::dvec2>> centers;
  std::optional<PictureTruth> picture;  // of every picture_every-th frame
};

// What there is at one frame, whoever moves it. Refers to what is handed over.
struct JudgedScene {
  const SceneMirror& mirror;
  std::span<const Target> targets;  // instances of the mirror
  const EmbreeScene& occluders;     // both have taken in the mirror
  const EmbreeScene& colliders;
};
// `before_m`: where the camera was at the frame before. `picture_size` 0: no picture. Thread-safe.
FrameTruth judge_frame(const JudgedScene& scene, const glm::dvec3& before_m, const CameraFrame& frame, int picture_size);

struct JudgeOptions {
  int picture_every = 1;  // >= 1; 0: no pictures, bodies only
  int picture_size = kTruthSize;
  int threads = 1;
  // Called on any of the threads, one call at a time, with the number of frames done.
  std::function<void(size_t)> progress;
};

// In the order of `frames`. Fails only when the scenario's scene cannot be made.
Result<std::vector<FrameTruth>> judge(const Scenario& scenario, GeometryStore& store, EmbreeDevice& device,
                                      std::span<const CameraFrame> frames, const JudgeOptions& options);

}  // namespace sightline
