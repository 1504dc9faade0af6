// Judges a camera's path through a scenario frame by frame, whether a session or a baseline made the path.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "client/scenario/scenario_world.h"
#include "client/truth/truth.h"

namespace sightline {

// One frame of a path: the camera's pose at `time_s` of the scenario. Times never decrease.
struct CameraFrame {
  double time_s = 0.0;
  Pose camera;
  Lens lens;
  // The camera was allowed to jump here: a declared cut, or a gap that is longer than the longest step.
  bool jump = false;
};

struct FrameTruth {
  BodyTruth body;
  // Each target's centre in the picture, in picture heights from the middle, right and up; none when it is outside the
  // picture. Filled for every frame, in the order of ScenarioWorld::targets().
  std::vector<std::optional<glm::dvec2>> centers;
  bool other_targets = false;           // than at the frame before
  std::optional<PictureTruth> picture;  // only at every picture_every-th frame
};

// The scene at one frame. Holds references.
struct JudgedScene {
  const SceneMirror& mirror;
  std::span<const Target> targets;  // each an instance of the mirror
  const EmbreeScene& occluders;     // both have taken in the mirror
  const EmbreeScene& colliders;
};
// `before_m`: the camera's position at the previous frame. `picture_size` 0: no picture. Thread-safe.
FrameTruth judge_frame(const JudgedScene& scene, const glm::dvec3& before_m, const CameraFrame& frame,
                       int picture_size);

struct JudgeOptions {
  int picture_every = 1;  // every n-th frame gets a picture; 0: no pictures, only bodies
  int picture_size = kTruthSize;
  int threads = 1;
  // Called with the number of frames done, on any of the threads, one call at a time.
  std::function<void(size_t)> progress;
};

// One result a frame, in the order of `frames`. Fails only when the scenario's scene cannot be made.
Result<std::vector<FrameTruth>> judge(const Scenario& scenario, GeometryStore& store, EmbreeDevice& device,
                                      std::span<const CameraFrame> frames, const JudgeOptions& options);

}  // namespace sightline
