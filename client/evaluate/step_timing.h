// What a step costs, stage by stage, on the city (280 K triangles): Table 1 of the paper. Two targets walk, the maps have
// r x r texels, and there are about r^3 candidates.
//
// Times are wall-clock times of this thread. Nothing else should run meanwhile.
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

// The settings that are timed; the resolution and the number of candidates are set over them.
//   paper: preset paper with Basic, one point a target, without filter and prediction, as the paper's Table 1
//   sightline: the default settings, with the points of the targets' surfaces
struct TimedSettings {
  std::string_view name;
  StepSettings settings;
};
std::vector<TimedSettings> timed_settings();
inline constexpr int kTimedResolutions[] = {5, 7, 10, 15};

// EGL where a context can be made, and Embree. `no_egl`, if not null, is told why there is no EGL; else it is emptied.
// In a program that renders in software, see prepare_software_rendering first.
std::vector<std::unique_ptr<SamplerDevice>> timed_samplers(std::string* no_egl);

// The city, loaded once for any number of timings. One thread at a time.
struct TimedCity {
  GeometryStore store;
  EmbreeDevice device;
  ExtentCache extents;
  std::unique_ptr<Scenario> scenario;
  std::vector<std::shared_ptr<const ExtentTable>> tables;  // by target
  static Result<std::unique_ptr<TimedCity>> load();
};

struct Percentiles {
  double p50_ms = 0.0, p95_ms = 0.0;
};
struct StepTiming {
  size_t frames = 0;
  size_t samples = 0;  // places judged in a step: the median
  Percentiles sample, aggregate, move;
  Percentiles total;  // the whole step
};

// One sampler under one setting, frame after frame at 60 Hz; at the city's end from its start again, with the camera put back.
class StepTimer {
 public:
  // Both must outlive it. `resolution`: r, [2, 64].
  static Result<std::unique_ptr<StepTimer>> make(TimedCity& city, SamplerDevice& device,
                                                 StepSettings settings, int resolution);
  // Takes the next frame's step; the city's own movement is not measured. Returns how long it took, milliseconds; of the
  // first kWarmUpSteps nothing is kept: they bring the scene to the sampler. Fails when the sampler does.
  Result<double> step();
  StepTiming timing() const;  // of the steps kept; all 0 without any

  static constexpr int kWarmUpSteps = 5;

 private:
  StepTimer(TimedCity& city, SamplerDevice& device, StepSettings settings,
            std::unique_ptr<ScenarioWorld> world);
  void to_next_frame();

  TimedCity& city_;
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
