// How one to four targets walk along one path.
#pragma once

#include <vector>

#include "scenes/path.h"
#include "scenes/scenario_builder.h"

namespace sightline::scenes {

enum class LevelWalk {
  kOne,       // one target
  kRow,       // two, one behind the other
  kBeside,    // two, side by side, 1 m apart
  kCrossing,  // two, one behind the other, that change sides between two doors, each time in the opposite direction
  kFour,      // two pairs, one behind the other
};

// A path with a height at each corner; `doors` as in RoutePath.
struct LevelPath {
  Polyline corners;
  std::vector<double> heights_m;  // of the same number; empty: all 0
  std::vector<size_t> first_corner_of_door;
};

// Walked at an even speed in 3D. The last target is at corner 0 at time 0. Those that walk beside one another keep to
// the same times at the corners. The first motion belongs to a target in front.
std::vector<Motion> walk_along(const LevelPath& path, LevelWalk walk, double speed_mps, double duration_s);

// The times at the corners of `path`, walked at an even speed, corner 0 at `first_time_s`.
std::vector<double> even_times_s(const LevelPath& path, double speed_mps, double first_time_s);
// One target along `path` with these times.
Motion walk_one(const LevelPath& path, const std::vector<double>& times_s, double duration_s);

}  // namespace sightline::scenes
