// Times a step, stage by stage, on a generated scene. On the city (280 K triangles, two walking targets) that is Table
// 1 of the paper: the maps have r x r texels, and there are about r^3 candidates.
//
// Times are wall-clock times of the calling thread. Nothing else should run on the machine.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "client/scenario/scenario_world.h"
#include "server/sample/extent.h"
#include "server/sample/sampler.h"
#include "server/step/step.h"

namespace sightline {

// The settings that are timed; resolution and number of candidates are set on top of them.
//   paper: preset paper with Basic and one point for each target, without filter and prediction, as in the paper's
//   Table 1 sightline: the default settings, with several points on each target's surface default: the same, with its
//   own number of candidates, at its own resolution alone
struct TimedSettings {
  std::string_view name;
  StepSettings settings;
  bool as_they_are = false;  // with their own resolution and number of candidates
};
// The number of candidates that a step with these settings is timed with at a resolution; 0: it is not timed at it.
int timed_candidates(const TimedSettings& timed, int resolution);
std::vector<TimedSettings> timed_settings();
inline constexpr int kTimedResolutions[] = {5, 7, 10, 15};

// EGL, where a context can be made, and Embree. `no_egl`, if not null, receives the reason why EGL is missing, or "".
// A program that may render in software must call prepare_software_rendering first.
std::vector<std::unique_ptr<SamplerDevice>> timed_samplers(std::string* no_egl);

// A scene of the catalogue, loaded once for any number of timings. Used by one thread at a time.
struct LoadedScene {
  GeometryStore store;
  EmbreeDevice device;
  ExtentCache extents;
  std::unique_ptr<Scenario> scenario;
  std::vector<std::shared_ptr<const ExtentTable>> tables;  // one for each target
  // kNotFound when no scene has this name.
  static Result<std::unique_ptr<LoadedScene>> load(const std::string& name);
};

struct Percentiles {
  double p50_ms = 0.0, p95_ms = 0.0;
};
struct StepTiming {
  size_t frames = 0;
  size_t samples = 0;  // candidates judged in a step: the median
  Percentiles sample, aggregate, move;
  Percentiles total;  // the whole step
};

// One sampler under one setting, frame after frame at 60 Hz. After the last frame of the scene it starts again from the
// first, with the camera at its start.
class StepTimer {
 public:
  // Both must outlive it. `resolution`: r, [2, 64]. `candidates`: about as many, [27, 32768].
  static Result<std::unique_ptr<StepTimer>> make(LoadedScene& scene, SamplerDevice& device, StepSettings settings,
                                                 int resolution, int candidates);
  // Takes the next frame's step and returns its duration in milliseconds, without the scene's own movement. The first
  // kWarmUpSteps load the scene into the sampler and do not count in timing(). Fails when the sampler fails.
  Result<double> step();
  StepTiming timing() const;  // all 0 before the first step that counts

  static constexpr int kWarmUpSteps = 5;

 private:
  StepTimer(LoadedScene& scene, SamplerDevice& device, StepSettings settings, std::unique_ptr<ScenarioWorld> world);
  void to_next_frame();

  LoadedScene& scene_;
  const StepSettings settings_;
  const std::unique_ptr<ScenarioWorld> world_;
  const std::unique_ptr<Sampler> sampler_;
  const CameraLimits limits_;
  std::vector<const ExtentTable*> tables_;
  Stepper stepper_;
  uint64_t tick_ = 0;
  std::vector<double> sample_ms_, aggregate_ms_, move_ms_, total_ms_, samples_;
};

}  // namespace sightline
