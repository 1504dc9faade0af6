// A camera with the default settings, tried in a level: `sightline check --play`.
#pragma once

#include "client/check/level.h"
#include "client/truth/metrics.h"

namespace sightline {

struct LevelPlay {
  bool wandered = false;  // two people wandered; else the level's own scenario was played
  double duration_s = 0.0;
  RunMetrics metrics;  // of four pictures a second
};

// Takes some seconds. Fails as wandering_in and evaluate do.
Result<LevelPlay> play_level(const Level& level);

}  // namespace sightline
