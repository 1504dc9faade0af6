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

}  // namespace sightline
