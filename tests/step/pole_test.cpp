// Targets that pass under and over the camera: it never turns past straight up or straight down.
#include <gtest/gtest.h>

#include <cmath>

#include "server/base/random.h"
#include "tests/support/watch.h"

namespace sightline::test {
namespace {

class Pole : public testing::TestWithParam<Preset> {};

// A target that flies straight through a point near the camera's axis of yaw, above or below the camera, again and
// again.
struct Pass {
  glm::dvec3 from_m, velocity_mps;
  double left_s = 0;
};

Pass random_pass(CounterRandom& random, const glm::dvec3& camera_m) {
  const auto within = [&](double most) { return random.next_in(-most, most); };
  const double height = random.next_in(1.0, 8.0) * (random.next_below(2) == 0 ? 1 : -1);
  const glm::dvec3 over = camera_m + glm::dvec3(within(0.5), height, within(0.5));
  const glm::dvec3 velocity(within(12), within(3), within(12));
  return {over - velocity * 0.7, velocity, random.next_in(0.7, 2.0)};
}

CameraLimits random_limits(CounterRandom& random) {
  CameraLimits limits;
  limits.max_angular_speed_radps = random.next_in(0.5, 12.0);
  limits.max_angular_acceleration_radps2 = random.next_in(1.0, 40.0);
  return limits;
}

void film_passes(Preset preset, uint64_t seed) {
  CounterRandom random(seed, 0, RandomPurpose::kTest);
  World world;
  world.settings = preset_settings(preset);
  world.settings.framing.aim_response_s = random.next_in(0.0, 0.6);
  if (seed % 2 == 0) world.settings.move.follow = Follow::kStay;
  world.limits = random_limits(random);
  world.seed = seed;
  const size_t count = 1 + random.next_below(4);
  for (uint64_t id = 1; id <= count; ++id) world.add_target(id, {2.0 * static_cast<double>(id), -2, -4});
  world.place({0, 0, 0}, {random.next_in(-1, 1), random.next_in(-3, 3), -1});
  Watch watch(world);
  std::vector<Pass> passes(count);
  for (int i = 0; i < 240; ++i) {
    const double dt = random.next_in(1.0 / 240, 1.0 / 15);
    for (uint64_t id = 1; id <= count; ++id) {
      Pass& pass = passes[id - 1];
      if (pass.left_s <= 0) pass = random_pass(random, world.camera().pose.position_m);
      pass.from_m += pass.velocity_mps * dt, pass.left_s -= dt;
      world.move(id, pass.from_m, pass.velocity_mps);
    }
    watch.step(dt);
  }
}

TEST_P(Pole, NoReplyIsUpsideDownOrBreaksALimitWhereverTheTargetsPass) {
  for (uint64_t seed = 1; seed <= 40 && !testing::Test::HasFailure(); ++seed) {
    SCOPED_TRACE(seed);
    film_passes(GetParam(), seed);
  }
}

TEST_P(Pole, ACameraPutStraightDownAndStraightUpStaysUpright) {
  for (const double height : {-6.0, 6.0}) {
    World world;
    world.settings = preset_settings(GetParam());
    world.add_target(1, {0, height, 0});
    world.stepper.place_camera({{0, 0, 0}, rotation_from_angles({0.4, std::copysign(1.5707963267948966, height), 0})},
                               {});
    Watch watch(world);
    for (int i = 0; i < 120; ++i) {
      world.move(1, {0.02 * i, height, 0.01 * i}, {1.2, 0, 0.6});
      watch.step();
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Presets, Pole, testing::Values(Preset::kSightline, Preset::kPaper), [](const auto& preset) {
  return std::string(preset.param == Preset::kPaper ? "paper" : "sightline");
});

}  // namespace
}  // namespace sightline::test
