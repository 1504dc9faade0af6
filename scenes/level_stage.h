// The steps that all kinds of level share: the camera's start, the places that furniture leaves free, and the targets.
#pragma once

#include <vector>

#include "scenes/level_layout.h"
#include "scenes/levels.h"

namespace sightline::scenes {

// The streams of random numbers of a level: the same plan and walks for both sets of parts, with and without a ceiling.
struct LevelRandom {
  explicit LevelRandom(uint64_t seed);
  CounterRandom plan, walls, furniture, walk;
};

double choose_speed_mps(CounterRandom& random);

// Where the camera starts: `behind_m` behind the last target on a path, 2 m high, looking at the targets.
struct LevelCamera {
  glm::dvec3 eye_m, at_m;
};
LevelCamera camera_behind(const LevelPath& path, double behind_m);

// The points of the storey at `base_m` that the targets and the camera need.
std::vector<glm::dvec2> points_in_use(const std::vector<Motion>& walks, const LevelCamera& camera, double base_m);

// Adds the camera and the targets, "target-1" and so on.
void add_actors(ScenarioBuilder& scene, const std::vector<Motion>& walks, const LevelCamera& camera);

}  // namespace sightline::scenes
