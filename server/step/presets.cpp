#include "server/step/presets.h"

namespace sightline {
namespace {

// Chosen by measurement: see tests/results.
StepSettings sightline_settings() {
  StepSettings settings;
  settings.bound.towards_m = 5.0;
  settings.sample.points = 8;
  settings.aggregate.filter.mode = FilterMode::kPerTarget;
  settings.aggregate.filter.min_occlusion_s = 0.1;
  settings.move.strategy = Strategy::kBlend;
  settings.move.blend.steadiness = 0.5;
  settings.move.prediction_s = 0.5;
  settings.move.turn_share = 0.2;
  settings.move.response_s = 0.15;
  settings.move.survey.enabled = true;
  return settings;
}

StepSettings paper_settings() {
  StepSettings settings;
  settings.bound.mode = BoundMode::kPaper;
  settings.sample.points = 1;
  settings.sample.jitter_texels = false;
  settings.aggregate.volume = Volume::kPair;
  settings.aggregate.filter.mode = FilterMode::kJoint;
  settings.aggregate.filter.alpha = 0.6;
  settings.aggregate.filter.n = 10;
  settings.move.strategy = Strategy::kRobust;
  settings.move.prediction_s = 0.3;
  return settings;
}

}  // namespace

StepSettings preset_settings(Preset preset) {
  return preset == Preset::kPaper ? paper_settings() : sightline_settings();
}

std::string_view name_of(Preset preset) {
  return preset == Preset::kPaper ? "paper" : "sightline";
}

StepSettings paper_row(Strategy strategy, double prediction_s) {
  StepSettings settings = paper_settings();
  settings.aggregate.filter.mode = FilterMode::kNone;
  settings.move.strategy = strategy;
  settings.move.prediction_s = prediction_s;
  return settings;
}

StepSettings paper_stability(int a, int n) {
  StepSettings settings = paper_row(Strategy::kBasic, 0.0);
  if (n == 0) return settings;
  settings.aggregate.filter.mode = FilterMode::kJoint;
  settings.aggregate.filter.alpha = static_cast<double>(a) / n;
  settings.aggregate.filter.n = n;
  return settings;
}

}  // namespace sightline
