// Decisions at a pace of their own: how often, what is decided at once, and what the steps between do.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "tests/support/filming.h"

namespace sightline::test {
namespace {

// A person walks round a pillar and past a wall.
struct Walk : Filming {
  explicit Walk(double decide_every_s) {
    settings.move.decide_every_s = decide_every_s;
    add_box(50, {0, 2, 2}, {0.5, 2, 0.5});
    add_box(51, {-4, 2, -2}, {2, 2, 0.2});
    add_target(1, {-3, 1, 0});
    place({-3, 1.8, 6}, {-3, 1, 0});
  }
  void walk_to(double time_s) {
    const double angle = 0.6 * time_s;
    move(1, {-3 * std::cos(angle), 1, 3 * std::sin(angle)}, {1.8 * std::sin(angle), 0, 1.8 * std::cos(angle)});
  }
  bool decided() const { return dump().decided; }
};

struct Filmed {
  std::vector<glm::dvec3> camera_m;  // 10 times a second
  int decisions = 0, maps = 0;
  double seen = 0;
};

Filmed filmed(double rate_hz, double decide_every_s, double duration_s = 12) {
  Walk world(decide_every_s);
  Watch watch(world);
  Filmed film;
  const int ticks = static_cast<int>(duration_s * rate_hz);
  for (int i = 0; i < ticks; ++i) {
    world.walk_to(i / rate_hz);
    StepResult result;
    world.step_in(watch, result, 1 / rate_hz);
    film.decisions += world.decided();
    film.seen += result.targets[0].visible_share / ticks;
    if (std::floor((i + 1) * 10 / rate_hz) > std::floor(i * 10 / rate_hz))
      film.camera_m.push_back(world.camera().pose.position_m);
  }
  film.maps = static_cast<int>(world.maps_taken());
  return film;
}

TEST(Pace, TheNumberOfDecisionsDoesNotGrowWithTheRateOfTheTicks) {
  for (const double rate_hz : {60.0, 72.0, 90.0, 120.0, 144.0, 240.0, 1000.0}) {
    const double decided_hz = filmed(rate_hz, 0.033, 3).decisions / 3.0;
    EXPECT_NEAR(decided_hz, 1 / 0.033, 1.0) << rate_hz;
  }
  for (const double rate_hz : {10.0, 20.0, 30.0})
    EXPECT_EQ(filmed(rate_hz, 0.033, 3).decisions, static_cast<int>(3 * rate_hz)) << "slow ticks all decide";
  EXPECT_EQ(filmed(144, 0.0, 3).decisions, 3 * 144);
}

TEST(Pace, TheCameraGoesMuchAsIfEveryTickDecided) {
  const Filmed every = filmed(60, 0.0);
  for (const double rate_hz : {60.0, 144.0}) {
    const Filmed paced = filmed(rate_hz, 0.033);
    double apart_m = 0;
    const size_t count = std::min(every.camera_m.size(), paced.camera_m.size());
    for (size_t i = 0; i < count; ++i)
      apart_m += glm::distance(every.camera_m[i], paced.camera_m[i]) / static_cast<double>(count);
    EXPECT_LT(apart_m, 1.0) << rate_hz;
    EXPECT_GT(paced.seen, every.seen - 0.03) << rate_hz;
  }
}

// A decision at the ticks between would say the same of where the camera is.
TEST(Pace, EveryReplyTellsWhatIsSeenFromItsOwnPose) {
  Walk world(0.033);
  Watch watch(world);
  int between = 0, partly = 0;
  for (int i = 0; i < 900; ++i) {
    world.walk_to(i / 60.0);
    StepResult result;
    world.step_in(watch, result);
    if (world.decided()) continue;
    ++between;
    EXPECT_GT(result.targets[0].occlusions.size() + static_cast<size_t>(result.targets[0].visible_share == 1.0), 0u)
        << i;
    partly += result.targets[0].visible_share < 1;
    EXPECT_TRUE(world.dump().sights.candidates.position_m.size() == 0);
    EXPECT_GT(world.counts().total, 100u) << "of the last decision";
    EXPECT_TRUE(i < 30 || result.targets[0].forecast) << i;
    EXPECT_TRUE(result.shot);
  }
  EXPECT_GT(between, 400);
  EXPECT_GT(partly, 5);
}

TEST(Pace, WhatADecisionCouldNotKnowIsDecidedAtOnce) {
  const std::pair<const char*, std::function<void(Walk&)>> causes[] = {
      {"another shot", [](Walk& world) { world.shot.number = 1, world.shot.height_rad = 0.5; }},
      {"another target",
       [](Walk& world) {
         world.add_target(2, {-2, 1, 0});
       }},
      {"no target", [](Walk& world) { world.targets.clear(); }},
      {"a jump",
       [](Walk& world) {
         world.move(1, {-3, 1, 40});
       }},
      {"the camera elsewhere",
       [](Walk& world) {
         world.stepper.observe_camera({.pose = Pose{{3, 2, 9}, glm::dquat(1, 0, 0, 0)}});
       }},
      {"a cut",
       [](Walk& world) {
         world.place({3, 2, 9}, {-3, 1, 0});
       }},
  };
  for (const auto& [name, cause] : causes) {
    Walk world(0.2);
    world.step(1.0 / 60), world.step(1.0 / 60);
    EXPECT_FALSE(world.decided()) << name;
    cause(world);
    world.step(1.0 / 60);
    EXPECT_TRUE(world.decided()) << name;
  }
}

TEST(Pace, APauseChangesNothing) {
  Walk paused(0.05), played(0.05);
  for (int i = 0; i < 120; ++i) {
    for (Walk* world : {&paused, &played}) world->walk_to(i / 60.0);
    if (i % 7 == 3) paused.step(0.0), --paused.tick;
    const StepResult a = paused.step(1.0 / 60), b = played.step(1.0 / 60);
    EXPECT_EQ(paused.decided(), played.decided()) << i;
    EXPECT_LT(glm::distance(a.camera.pose.position_m, b.camera.pose.position_m), 0.2) << i;
    EXPECT_NE(a.reason, MoveReason::kPaused) << i;
  }
}

// Most maps belong to decisions.
TEST(Pace, TheStepsBetweenTakeFewMaps) {
  Walk world(0.1);
  uint64_t deciding = 0, between = 0, decisions = 0, others = 0;
  for (int i = 0; i < 240; ++i) {
    world.walk_to(i / 60.0);
    const uint64_t before = world.maps_taken();
    world.step(1.0 / 60);
    (world.decided() ? deciding : between) += world.maps_taken() - before;
    ++(world.decided() ? decisions : others);
  }
  ASSERT_GT(others, 150u);
  const size_t rays = static_cast<size_t>(world.settings.sample.points) + 3;
  EXPECT_LE(between, others * rays);
  EXPECT_GT(deciding, decisions * rays);
}

// The targets take turns in the viewpoint search, whatever the rate of the ticks.
TEST(Pace, EachTargetIsLookedAtAsOften) {
  for (const double rate_hz : {5.0, 10.0, 15.0, 20.0, 30.0, 60.0, 144.0})
    for (const size_t people : {2u, 3u}) {
      Filming world;
      for (size_t i = 0; i < people; ++i) world.add_target(1 + i, {1.2 * static_cast<double>(i), 1, 0});
      world.place({1, 1.8, 7}, {1, 1, 0});
      std::vector<int> looks(people);
      for (int i = 0; i < 10 * rate_hz; ++i) {
        world.step(1 / rate_hz);
        if (world.dump().decided) ++looks[world.dump().plan.look.target];
      }
      const auto [least, most] = std::ranges::minmax(looks);
      EXPECT_LE(most - least, 3) << rate_hz << " Hz, " << people << " targets";
    }
}

}  // namespace
}  // namespace sightline::test
