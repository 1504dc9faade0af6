// The simplest settings, so that a test sees one effect at a time. The nearest candidate is chosen. Nothing is
// predicted, smoothed, filtered or searched for. The aim point of each target is its only sample.
#pragma once

#include "server/settings/step_settings.h"

namespace sightline::test {

inline StepSettings plain_settings() {
  StepSettings settings;
  settings.bound.horizon_s = 0.5;
  settings.bound.target_reach_m = 0;
  settings.aggregate.candidates = 343;
  settings.sample.points = 0;
  settings.aggregate.filter.mode = FilterMode::kNone;
  settings.aggregate.filter.min_occlusion_s = 0.15;
  settings.move.strategy = Strategy::kBasic;
  settings.move.cost.steadiness = 0;
  settings.move.prediction_s = 0;
  settings.move.turn_probability = 0;
  settings.move.move_response_s = 0;
  settings.move.search_viewpoints = false;
  return settings;
}

}  // namespace sightline::test
