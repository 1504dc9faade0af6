#include "scenes/level_stage.h"

#include <cmath>

#include "scenes/exact.h"

namespace sightline::scenes {

LevelRandom::LevelRandom(uint64_t seed)
    : plan(seed, 0, RandomPurpose::kSceneGeneration),
      walls(seed, 1, RandomPurpose::kSceneGeneration),
      furniture(seed, 2, RandomPurpose::kSceneGeneration),
      walk(seed, 3, RandomPurpose::kSceneGeneration) {}

double choose_speed_mps(CounterRandom& random) {
  return random.next_in(1.5, 2.0);
}

LevelCamera camera_behind(const LevelPath& path, double behind_m) {
  const glm::dvec2 start = path.corners[0], forward = (path.corners[1] - start) / length(path.corners[1] - start);
  const double base = path.heights_m.empty() ? 0.0 : path.heights_m[0];
  const glm::dvec2 eye = start - forward * behind_m, at = start + forward;
  return {{eye.x, base + 2.0, eye.y}, {at.x, base + 1.1, at.y}};
}

std::vector<glm::dvec2> points_in_use(const std::vector<Motion>& walks, const LevelCamera& camera, double base_m) {
  constexpr size_t kEvery = 6;             // keys: 0.2 m apart at most
  constexpr double kStoreyReach_m = 2.25;  // of a walker's feet above or below the floor
  std::vector<glm::dvec2> points{{camera.eye_m.x, camera.eye_m.z}};
  for (const Motion& motion : walks)
    for (size_t k = 0; k < motion.positions_m.size(); k += kEvery) {
      const glm::dvec3& p = motion.positions_m[k];
      if (std::abs(p.y - base_m) <= kStoreyReach_m) points.emplace_back(p.x, p.z);
    }
  return points;
}

void add_actors(ScenarioBuilder& scene, const std::vector<Motion>& walks, const LevelCamera& camera) {
  scene.add_camera(camera.eye_m, camera.at_m);
  for (size_t k = 0; k < walks.size(); ++k) scene.add_character(numbered("target", static_cast<int>(k) + 1), walks[k]);
}

}  // namespace sightline::scenes
