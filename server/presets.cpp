#include "server/presets.h"

namespace sightline {
namespace {

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
  return preset == Preset::kPaper ? paper_settings() : StepSettings{};
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
