#include "client/check/level_play.h"

#include <algorithm>
#include <thread>

#include "client/check/wandering.h"
#include "client/evaluate/evaluation.h"
#include "server/settings/step_settings.h"

namespace sightline {
namespace {

constexpr uint64_t kSeed = 1;

Result<Scenario> scenario_for(const Level& level, bool wander) {
  if (!wander) return Scenario::from_asset(level.asset);
  return wandering_in(level, standing_places(level), kSeed);
}

}  // namespace

Result<LevelPlay> play_level(const Level& level) {
  LevelPlay play;
  play.wandered = std::ranges::none_of(level.actors, &ScenarioActor::is_target);
  auto scenario = scenario_for(level, play.wandered);
  if (scenario && !play.wandered && !(scenario->duration_s() > 0)) {  // nothing moves in it
    play.wandered = true;
    scenario = scenario_for(level, true);
  }
  if (!scenario) return tl::unexpected(scenario.error());
  play.duration_s = scenario->duration_s();
  const SceneCase scene{"the level", kSeed, [&](GeometryStore&) -> Result<Scenario> { return *scenario; }};
  EvaluationOptions options;
  options.picture_every = 15;
  options.picture_size = 256;
  options.jobs = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  const PolicyEntry camera = step_policy("sightline", preset_settings(Preset::kSightline));
  const auto runs = evaluate(std::span(&scene, 1), std::span(&camera, 1), options);
  if (!runs) return tl::unexpected(runs.error());
  play.metrics = runs->front().metrics;
  return play;
}

}  // namespace sightline
