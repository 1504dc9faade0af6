// The settings that the peers' rays answer: one point for each target and the nearest visible candidate. The service's
// plain loads have the same (tests/results/speed/make.sh).
#pragma once

#include "server/paper/paper_settings.h"

namespace sightline::bench {

inline StepSettings plain_settings(int resolution, int candidates, int points = 0) {
  StepSettings settings = paper_row(Strategy::kBasic, 0.0);
  settings.aggregate.volume = Volume::kLattice;
  // The horizon, not n dt^2 a, which explodes with a late tick. The rest of the bound is the paper's: it does not reach
  // towards the targets as the default's does.
  settings.bound.mode = BoundMode::kHorizon;
  settings.sample.resolution = resolution;
  settings.sample.points = points;
  settings.aggregate.candidates = candidates;
  return settings;
}

}  // namespace sightline::bench
