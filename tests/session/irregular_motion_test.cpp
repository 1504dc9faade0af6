// Targets as games really send them: positions that are held for several ticks, late or noisy, without velocities. The
// camera should film as it does with clean ones.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "server/move/motion.h"
#include "tests/session/game.h"

namespace sightline {
namespace {

using test::Game;
using test::kAnn;

constexpr double kTick = 1.0 / 60, kDurationS = 24.0;

struct Sending {
  double rate_hz = 60, noise_m = 0;
  double late_share = 0;  // of the ticks, by up to 0.1 s: they reach the daemon together with later ones
};

struct Filmed {
  std::vector<glm::dvec3> camera_m;
  std::vector<glm::dvec2> picture;  // the target's true middle, in lines of a picture of 1,080 lines
  std::vector<double> jerks_mps3;   // after 4 s
};

// Walks round two corners, stands from 12 to 16 s, and goes back.
glm::dvec3 place_at(double time_s, double speed_mps) {
  const auto leg = [&](double from_s, double to_s) { return speed_mps * (std::clamp(time_s, from_s, to_s) - from_s); };
  return {leg(0, 5) - leg(16, 24), 1, leg(5, 12)};
}

Filmed filmed(double speed_mps, const Sending& sending, uint64_t seed) {
  Game game([&](SessionOptions& options) {
    options.settings = preset_settings(Preset::kSightline);
    options.camera.position_m = {0, 2.6, 6};
    options.targets = {Game::target(kAnn)};
    for (NewInstance& instance : options.instances)
      instance.pose.position_m = instance.id == kAnn ? glm::dvec3(0, 1, 0) : glm::dvec3(0, -500, 0);
  });
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0, 1);
  std::uniform_real_distribution<double> unit(0, 1);
  Filmed film;
  glm::dvec3 sent_m(0, 1, 0);
  double next_s = 0, late_until_s = -1;
  const CameraState* before = nullptr;
  CameraState last;
  for (int k = 0; k < static_cast<int>(kDurationS / kTick); ++k) {
    const double time_s = k * kTick;
    if (time_s + 1e-9 >= next_s) {
      sent_m = place_at(next_s, speed_mps) +
               sending.noise_m * glm::dvec3(normal(random), normal(random), normal(random));
      next_s += 1 / sending.rate_hz;
    }
    game.apply(game.tick(kTick).move(kAnn, sent_m));
    if (time_s >= late_until_s && unit(random) < sending.late_share / 3) late_until_s = time_s + 0.1 * unit(random);
    if (time_s < late_until_s) continue;  // the reply comes with a later tick
    const SessionAnswer answer = game.answer();
    const CameraState& camera = answer.step.camera;
    const glm::dvec3 in_view_m = inverse_transform_point(camera.pose, place_at(time_s, speed_mps));
    film.camera_m.resize(static_cast<size_t>(k) + 1, camera.pose.position_m);
    film.picture.resize(static_cast<size_t>(k) + 1,
                        glm::dvec2(in_view_m) / -in_view_m.z * (540 / std::tan(answer.lens.vertical_fov_rad / 2)));
    if (before && time_s > 4 && sending.late_share == 0)
      film.jerks_mps3.push_back(glm::distance(camera.acceleration_mps2, last.acceleration_mps2) / kTick);
    last = camera, before = &last;
  }
  return film;
}

struct Difference {
  double mean_m = 0, shake_lines = 0;
};
Difference difference(const Filmed& clean, const Filmed& other) {
  Difference found;
  const size_t count = std::min(clean.camera_m.size(), other.camera_m.size());
  double squares = 0;
  for (size_t k = 60; k < count; ++k) {
    found.mean_m += glm::distance(clean.camera_m[k], other.camera_m[k]) / static_cast<double>(count - 60);
    const glm::dvec2 jump = (other.picture[k] - clean.picture[k]) - (other.picture[k - 1] - clean.picture[k - 1]);
    squares += glm::dot(jump, jump) / static_cast<double>(count - 60);
  }
  found.shake_lines = std::sqrt(squares);
  return found;
}

double jerk(const Filmed& film, double p) {
  std::vector<double> sorted = film.jerks_mps3;
  if (sorted.empty()) return 0;
  std::sort(sorted.begin(), sorted.end());
  return sorted[std::min(sorted.size() - 1, static_cast<size_t>(p * static_cast<double>(sorted.size())))];
}

class IrregularMotion : public testing::TestWithParam<double> {
 protected:
  // Walks may differ by 0.1 m, runs by 0.3 m.
  const double speed_mps_ = GetParam(), tolerated_m_ = GetParam() > 2 ? 0.3 : 0.1;
  const Filmed clean_ = filmed(speed_mps_, {}, 1);
};
INSTANTIATE_TEST_SUITE_P(Speeds, IrregularMotion, testing::Values(1.5, 5.0));

TEST_P(IrregularMotion, HeldPositionsAreFilmedLikeCleanOnes) {
  for (const double rate_hz : {50.0, 30.0, 20.0, 10.0}) {
    const Difference found = difference(clean_, filmed(speed_mps_, {.rate_hz = rate_hz}, 1));
    EXPECT_LT(found.mean_m, tolerated_m_ / 2) << rate_hz;
    EXPECT_LT(found.shake_lines, 1.0) << rate_hz;
  }
}

TEST_P(IrregularMotion, NoisyPositionsAreFilmedLikeCleanOnes) {
  for (const double noise_m : {0.003, 0.05}) {
    const Difference found = difference(clean_, filmed(speed_mps_, {.noise_m = noise_m}, 1));
    EXPECT_LT(found.mean_m, tolerated_m_) << noise_m;
    EXPECT_LT(found.shake_lines, 1.0) << noise_m;
  }
  const Difference wild = difference(clean_, filmed(speed_mps_, {.noise_m = 0.15}, 1));
  EXPECT_LT(wild.mean_m, 0.25);
  EXPECT_LT(wild.shake_lines, 1.5);
}

TEST_P(IrregularMotion, HeldAndNoisyPositionsOfWhichSomeComeLateAreFilmedLikeCleanOnes) {
  const Filmed other = filmed(speed_mps_, {.rate_hz = 30, .noise_m = 0.01, .late_share = 0.2}, 1);
  EXPECT_LT(difference(clean_, other).mean_m, tolerated_m_);
}

// A client that names only what has changed: a runner whose positions are held for two ticks is named in every second
// one, until it stands.
TEST(IrregularMotionOfOne, WhoIsNoLongerNamedHasStopped) {
  Game game;
  for (int k = 1; k <= 60; ++k) {
    test::TickMaker tick = game.tick(kTick);
    if (k % 2 == 0) tick.move(kAnn, {-1 + 0.05 * k, 1, 0});
    game.play(tick);
  }
  EXPECT_GT(glm::length(game.instance(kAnn).velocity_mps), 1.0);
  for (int k = 0; k < 30; ++k) game.play(game.tick(kTick));
  EXPECT_EQ(game.instance(kAnn).velocity_mps, glm::dvec3(0.0));
  EXPECT_EQ(game.instance(kAnn).correction_m, glm::dvec3(0.0));
}

// The camera does not follow the noise of a standing target: it moves gently, and the picture is calm.
TEST(IrregularMotionOfOne, WhoStandsIsFilmedCalmlyInSpiteOfNoise) {
  const Filmed clean = filmed(0.0, {}, 1);
  for (const double noise_m : {0.003, 0.01}) {
    const Filmed other = filmed(0.0, {.noise_m = noise_m}, 1);
    EXPECT_LT(difference(clean, other).mean_m, 1.2 * noise_m) << noise_m;
    EXPECT_LT(difference(clean, other).shake_lines, 0.1) << noise_m;
    EXPECT_LT(jerk(other, 0.99), CameraLimits{}.max_jerk_mps3 / 4) << noise_m;
  }
  EXPECT_LT(difference(clean, filmed(0.0, {.noise_m = 0.15}, 1)).mean_m, 0.2);
}

}  // namespace
}  // namespace sightline
