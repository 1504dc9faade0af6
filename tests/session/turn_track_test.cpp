// Angular velocities from rotations: clean, held for several ticks, noisy, stopped; and what a session makes of them.
#include "server/session/turn_track.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/session/game.h"

namespace sightline {
namespace {

constexpr double kTick = 1.0 / 60;

glm::dquat turned(double angle_rad, const glm::dvec3& axis = {0, 1, 0}) {
  return glm::angleAxis(angle_rad, glm::normalize(axis));
}

// The estimates after each tick of a rotation that is given by the time.
template <typename Rotation>
std::vector<glm::dvec3> estimates(int ticks, const Rotation& rotation) {
  TurnTrack track;
  std::vector<glm::dvec3> found;
  glm::dquat before = rotation(0.0);
  for (int k = 1; k <= ticks; ++k) {
    const glm::dquat now = rotation(k * kTick);
    found.push_back(track.observe(kTick, before, now));
    before = now;
  }
  return found;
}

TEST(TurnTrack, ASteadyTurnIsKnownAfterTwoTicks) {
  const glm::dvec3 axis = glm::normalize(glm::dvec3(1, 2, 0.5));
  const auto found = estimates(30, [&](double time_s) { return turned(2.5 * time_s, axis); });
  EXPECT_EQ(found[0], glm::dvec3(0.0)) << "one change may be a jump";
  for (size_t k = 1; k < found.size(); ++k) EXPECT_LT(glm::distance(found[k], 2.5 * axis), 1e-9) << k;
}

TEST(TurnTrack, HeldRotationsTurnAtTheSameRate) {
  for (const double rate_hz : {30.0, 20.0, 12.0}) {
    const auto found = estimates(
        60, [&](double time_s) { return turned(1.5 * std::floor(time_s * rate_hz + 1e-6) / rate_hz); });
    for (size_t k = 20; k < found.size(); ++k)
      EXPECT_LT(glm::distance(found[k], glm::dvec3(0, 1.5, 0)), 1e-6) << rate_hz << " " << k;
  }
}

TEST(TurnTrack, ATurnThatEndsIsOverSoon) {
  const auto found = estimates(40, [](double time_s) { return turned(3 * std::min(time_s, 20 * kTick)); });
  EXPECT_NEAR(found[18].y, 3, 1e-9);
  for (size_t k = 22; k < found.size(); ++k) EXPECT_EQ(found[k], glm::dvec3(0.0)) << k;
}

TEST(TurnTrack, NoiseIsNoTurn) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 0.01);
  const auto found = estimates(2000, [&](double) { return turned(noise(random)); });
  glm::dvec3 sum(0.0);
  double size = 0;
  for (const glm::dvec3& rate : found) sum += rate, size += glm::length(rate);
  EXPECT_LT(glm::length(sum) / 2000, 0.05);
  EXPECT_LT(size / 2000, 0.25) << "successive differences alone would say 0.68";
}

TEST(TurnTrack, AJumpIsNoTurn) {
  TurnTrack track;
  EXPECT_EQ(track.observe(1e-5, turned(0), turned(0.1)), glm::dvec3(0.0));
  EXPECT_EQ(track.observe(1e-5, turned(0.1), turned(0.2)), glm::dvec3(0.0));
}

TEST(TurningInstances, ASessionDerivesAngularVelocitiesOrTakesThoseThatAreSent) {
  test::Game game;
  const auto turn = [&](double angle_rad, bool sends) {
    test::TickMaker tick = game.tick(kTick);
    tick.move(test::kCrate, {0, 0.5, -4});
    tick.transforms.poses[0].rotation = turned(angle_rad);
    if (sends) tick.transforms.angular_velocities_radps = {{0, 7, 0}};
    game.play(tick);
    return game.instance(test::kCrate).angular_velocity_radps;
  };
  for (int k = 1; k <= 5; ++k) turn(0.02 * k, false);
  EXPECT_LT(glm::distance(turn(0.12, false), glm::dvec3(0, 0.02 / kTick, 0)), 1e-6);
  EXPECT_EQ(turn(0.14, true), glm::dvec3(0, 7, 0));
  game.play(game.tick(kTick));
  EXPECT_EQ(game.instance(test::kCrate).angular_velocity_radps, glm::dvec3(0, 7, 0)) << "what was sent stays";
  turn(0.16, false), turn(0.18, false), turn(0.2, false);
  EXPECT_GT(game.instance(test::kCrate).angular_velocity_radps.y, 1.0);
  for (int k = 0; k < 5; ++k) game.play(game.tick(kTick));
  EXPECT_EQ(game.instance(test::kCrate).angular_velocity_radps, glm::dvec3(0.0))
      << "what is no longer named has stopped";
}

TEST(TurningInstances, WrongAngularVelocitiesAreRefusedByName) {
  test::Game game;
  test::TickMaker tick = game.tick(kTick).move(test::kCrate, {0, 0.5, -4});
  tick.transforms.angular_velocities_radps = {{0, 2000, 0}};
  EXPECT_EQ(game.session->apply(tick).error().field, "tick.transforms.angular_velocities[0]");
  tick.transforms.angular_velocities_radps.resize(2);
  EXPECT_FALSE(game.session->apply(tick));
}

}  // namespace
}  // namespace sightline
