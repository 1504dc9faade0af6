#include "scenes/level_walk.h"

#include <cmath>

#include "scenes/exact.h"

namespace sightline::scenes {
namespace {

constexpr double kHalfGap_m = 0.5;    // between each target of a pair and the middle of the pair
constexpr double kRowGap_s = 0.8;     // between the targets of a row
constexpr double kFourGap_s = 1.0;    // between the two pairs of four
constexpr double kCrossingGap_s = 1;  // between targets that change sides

// Distances to the left of the path: `side_m` at the first door, -side_m at the next, and so on; 0 at the corners
// between.
std::vector<double> changing_sides(const LevelPath& path, double side_m) {
  std::vector<double> distances(path.corners.size(), 0.0);
  distances.front() = side_m;
  for (size_t k = 0; k < path.first_corner_of_door.size(); ++k)
    distances[path.first_corner_of_door[k]] = distances[path.first_corner_of_door[k] + 1] = k % 2 == 0 ? side_m
                                                                                                       : -side_m;
  return distances;
}

LevelPath beside(LevelPath path, double distance_m) {
  path.corners = parallel(path.corners, distance_m);
  return path;
}

}  // namespace

std::vector<double> even_times_s(const LevelPath& path, double speed_mps, double first_time_s) {
  std::vector<double> times_s{first_time_s};
  for (size_t k = 1; k < path.corners.size(); ++k) {
    const double along = length(path.corners[k] - path.corners[k - 1]);
    const double up = path.heights_m.empty() ? 0.0 : path.heights_m[k] - path.heights_m[k - 1];
    times_s.push_back(times_s.back() + std::sqrt(along * along + up * up) / speed_mps);
  }
  return times_s;
}

Motion walk_one(const LevelPath& path, const std::vector<double>& times_s, double duration_s) {
  Motion motion = walk({path.corners, times_s}, duration_s);
  if (path.heights_m.empty()) return motion;
  Polyline heights;
  for (const double height : path.heights_m) heights.emplace_back(height, 0.0);
  const TimedPath height(heights, times_s);
  for (size_t i = 0; i < motion.times_s.size(); ++i) {
    motion.positions_m[i].y = height.position_m(motion.times_s[i]).x;
    motion.positions_m[i] = snap_key(motion.positions_m[i]);
  }
  return motion;
}

std::vector<Motion> walk_along(const LevelPath& path, LevelWalk walk, double speed_mps, double duration_s) {
  const auto motion = [&](const LevelPath& own, double ahead_s) {
    return walk_one(own, even_times_s(path, speed_mps, -ahead_s), duration_s);
  };
  switch (walk) {
    case LevelWalk::kOne:
      return {motion(path, 0)};
    case LevelWalk::kRow:
      return {motion(path, kRowGap_s), motion(path, 0)};
    case LevelWalk::kBeside:
      return {motion(beside(path, kHalfGap_m), 0), motion(beside(path, -kHalfGap_m), 0)};
    case LevelWalk::kCrossing: {
      LevelPath left = path, right = path;
      left.corners = parallel(path.corners, changing_sides(path, kHalfGap_m));
      right.corners = parallel(path.corners, changing_sides(path, -kHalfGap_m));
      return {motion(left, kCrossingGap_s), motion(right, 0)};
    }
    case LevelWalk::kFour:
      break;
  }
  const LevelPath left = beside(path, kHalfGap_m), right = beside(path, -kHalfGap_m);
  return {motion(left, kFourGap_s), motion(right, kFourGap_s), motion(left, 0), motion(right, 0)};
}

}  // namespace sightline::scenes
