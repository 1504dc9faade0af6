// Steps over a moving scene, timed one after another, and the tables that are made of the times.
#pragma once

#include <cstdio>
#include <string>
#include <vector>

#include "server/step/step.h"

namespace sightline::bench {

double now_ms();

// The times of one contender, frame by frame.
struct Track {
  std::string name;
  std::vector<double> total_ms, sample_ms, aggregate_ms, move_ms, scene_ms;
  size_t candidates = 0;
  // The share of the candidates x targets on which a peer agrees with the step of the same frame. Candidates that lie
  // on a surface do not count. For the second, every candidate is moved onto the nearest ray of the map. -1: not
  // measured.
  double agreement = -1, agreement_on_rays = -1;
};

// The scene of the steps. References must outlive the steps.
struct TimedScene {
  const SceneMirror& mirror;
  const std::vector<Target>& targets;
  const std::vector<const ExtentTable*>& tables;
  Lens lens;
};

// One camera. The first kWarmUpFrames are not kept.
class TimedSteps {
 public:
  static constexpr int kWarmUpFrames = 20;

  TimedSteps(std::string name, const TimedScene& scene, const StepSettings& settings, SamplerDevice& device);
  // Places the camera for the steps from the next one on.
  void place(const Pose& camera) { stepper_.place_camera(camera, glm::dvec3(0.0)); }
  // Takes the next frame; `scene_ms` is the time that the mirror needed for it.
  void step(double scene_ms = 0.0);

  const StepDump& dump() const { return stepper_.dump(); }
  const Track& track() const { return track_; }
  bool warm() const { return frame_ > kWarmUpFrames; }

 private:
  const TimedScene scene_;
  const StepSettings settings_;
  const CameraLimits limits_;
  const std::unique_ptr<Sampler> sampler_;
  Stepper stepper_;
  int frame_ = 0;
  Track track_;
};

// rows.csv and ratios.csv in a folder.
class Tables {
 public:
  // False when they cannot be written.
  bool open(const std::string& folder);
  ~Tables();

  void row(const std::string& section, double x, const Track& track);
  // The time of the other divided by the time of `ours`: median of ten runs of frames, with the least and the greatest.
  void ratio(const std::string& section, double x, const Track& ours, const Track& other);

 private:
  std::FILE* rows_ = nullptr;
  std::FILE* ratios_ = nullptr;
};

}  // namespace sightline::bench
