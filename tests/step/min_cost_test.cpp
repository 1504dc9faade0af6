// The default preset: goals by hidden shares, routes around geometry, the viewpoint search.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>

#include "server/base/random.h"
#include "tests/support/filming.h"

namespace sightline::test {
namespace {

constexpr double kTick = 1.0 / 60;

// A corridor 2.4 m wide that turns right and left, under a roof. The target runs round its corners faster than the
// camera can follow.
TEST(MinCost, ATargetThatWentRoundACornerIsFoundAgainByAWayThroughTheLevel) {
  Filming world;
  world.limits.max_speed_mps = 2.5;
  world.add_box(10, {-1.4, 2, 0}, {0.2, 3, 9});
  world.add_box(11, {1.4, 2, 2.6}, {0.2, 3, 6.6});
  world.add_box(12, {3.6, 2, -6.6}, {5, 3, 0.2});
  world.add_box(13, {6.2, 2, -3.8}, {5, 3, 0.2});
  world.add_box(14, {8.6, 2, -14}, {0.2, 3, 7.6});
  world.add_box(15, {11.2, 2, -12}, {0.2, 3, 9});
  world.add_box(16, {5, 3.2, -6}, {12, 0.2, 16});
  world.add_box(17, {5, -0.2, -6}, {12, 0.2, 16});
  glm::dvec3 at(0, 0.95, 2);
  world.add_target(1, at);
  world.place({0, 1.6, 6}, at);
  Watch watch(world);
  StepResult r;
  int lost = 0, on_far_way = 0;
  for (int i = 0; i < 60 * 16; ++i) {
    const bool turns = at.z <= -5.2 && at.x < 9.9;
    const glm::dvec3 way = turns ? glm::dvec3(6, 0, 0) : at.z > -16 ? glm::dvec3(0, 0, -6) : glm::dvec3(0.0);
    world.move(1, at += way * kTick, way);
    world.step_in(watch, r);
    lost += r.targets[0].visible_share == 0.0;
    on_far_way += r.reason == MoveReason::kFarWay;
  }
  EXPECT_GT(lost, 20) << "it was lost indeed";
  EXPECT_GT(on_far_way, 0);
  EXPECT_GT(r.targets[0].visible_share, 0.5);
  EXPECT_TRUE(r.targets[0].in_picture);
}

// The straight line to the goal runs into the same pillar that hides the target.
TEST(MinCost, ATargetBehindAPillarIsFoundByARouteRoundIt) {
  OneFilmed world({0, 1.4, 4.6});
  world.add_box(10, {0, 1.5, 2.6}, {1.6, 6, 0.8});
  world.settings.move.decide_every_s = 0;  // so that every step has a plan
  Watch watch(world);
  StepResult r;
  int round_about = 0, steps = 0;
  do {
    world.step_in(watch, r);
    const auto& plan = world.stepper.dump().decision.plan_m;
    StraightWays ways(world.stepper.dump().surroundings.colliders, world.camera().pose.position_m,
                      world.limits.body_radius_m);
    round_about += !plan.empty() && !ways.is_free(plan[plan.size() - 1].position_m);
  } while (r.targets[0].visible_share < 1.0 && ++steps < 300);
  EXPECT_LT(steps, 240) << "within four seconds";
  EXPECT_GT(round_about, 0) << "the straight line was blocked";
}

// Two targets have walked on behind a wall that the camera touches. Costs are interpolated across the wall, and a plan
// over it begins in the camera's own cell: neither may keep the camera where it is.
TEST(MinCost, ACameraAtAWallGoesOverItAtOnce) {
  for (const double height_m : {1.3, 1.8, 2.3}) {
    Filming world;
    world.add_box(10, {0, 1.25, 0}, {12, 1.25, 0.15});
    glm::dvec3 first(0.4, 0.95, -3.5), second(-0.4, 0.95, -2);
    const glm::dvec3 walk(0, 0, -1.4);
    world.add_target(1, first);
    world.add_target(2, second);
    world.place({0, height_m, 0.15 + world.limits.body_radius_m + 0.02}, first);
    Watch watch(world);
    StepResult r;
    int steps = 0;
    do {
      world.move(1, first += walk * kTick, walk);
      world.move(2, second += walk * kTick, walk);
      world.step_in(watch, r);
    } while ((r.targets[0].visible_share < 1.0 || r.targets[1].visible_share < 1.0) && ++steps < 300);
    EXPECT_LT(steps, 45) << height_m
                         << ": at full acceleration, 34 steps take the camera from the lowest place to above the wall";
  }
}

// Screens on three sides and above: only from the far side is the target seen.
TEST(MinCost, TheSurveyTurnsToTheOpenSide) {
  OneFilmed world({0, 1.6, 5});
  const InstanceAttributes screen{.collides = false};
  world.add_box(10, {0, 1, 0.65}, {0.65, 1.5, 0.05}, screen);
  world.add_box(11, {0.65, 1, 0}, {0.05, 1.5, 0.65}, screen);
  world.add_box(12, {-0.65, 1, 0}, {0.05, 1.5, 0.65}, screen);
  world.add_box(13, {0, 2.5, 0}, {0.65, 0.05, 0.65}, screen);
  Watch watch(world);
  StepResult r;
  for (int i = 0; i < 600; ++i) world.step_in(watch, r);
  EXPECT_LT(world.stepper.carried().shot.offset_m.z, 0.0);
  EXPECT_LT(world.camera().pose.position_m.z, -1.0);
  EXPECT_EQ(r.targets[0].visible_share, 1.0);
}

TEST(MinCost, AShotInPlainSightIsKept) {
  OneFilmed world;
  Watch watch(world);
  StepResult r;
  for (int i = 0; i < 240; ++i) world.step_in(watch, r);
  EXPECT_LT(glm::distance(world.camera().pose.position_m, glm::dvec3(0, 1.6, 6)), 0.05);
  EXPECT_EQ(r.status, TrackingStatus::kTracking);
}

// Pillars hide a walking target from the asked shot now and then. After each, the camera comes back to that shot.
TEST(MinCost, TheCameraComesBackToTheAskedShotOfAWalkingTarget) {
  constexpr double kMps = 1.4, kPillarsEveryM = 15, kHalfPillarM = 0.35;
  const glm::dvec3 asked_m(0, 0.6, 6);
  OneFilmed world;
  for (uint64_t i = 1; i <= 3; ++i)
    world.add_box(10 + i, {kPillarsEveryM * static_cast<double>(i), 2, 3}, {kHalfPillarM, 2, kHalfPillarM});
  Watch watch(world);
  StepResult r;
  int elsewhere = 0, returns = 0;
  bool was_away = false;
  for (int i = 0; i < 60 * 40; ++i) {
    const double x_m = kMps * kTick * i;
    world.move(1, {x_m, 1, 0}, {kMps, 0, 0});
    world.step_in(watch, r);
    const double away_m = glm::distance(world.camera().pose.position_m, glm::dvec3(x_m, 1, 0) + asked_m);
    elsewhere += away_m > 0.5;
    returns += was_away && away_m < 0.2;
    was_away = was_away ? away_m >= 0.2 : away_m > 2;
  }
  EXPECT_EQ(returns, 3) << "once for each pillar";
  EXPECT_LT(elsewhere, 60 * 25);
}

// Posts hide less of the standing targets than ViewpointSearchSettings::keep_shot_below, so the camera does not chase
// the gaps between them.
TEST(MinCost, AShotThatIsHiddenALittleIsKeptWhileTheTargetsStand) {
  OneFilmed world;
  world.add_target(2, {1.2, 1, 0});
  for (int i = -10; i <= 10; ++i)
    world.add_box(100 + static_cast<uint64_t>(i + 10), {0.5 * i, 1, 3}, {0.015, 4, 0.015}, {.collides = false});
  Watch watch(world);
  StepResult r;
  double way_m = 0, hidden = 0;
  for (int i = 0; i < 600; ++i) {
    const glm::dvec3 before_m = world.camera().pose.position_m;
    world.step_in(watch, r);
    way_m += glm::distance(before_m, world.camera().pose.position_m);
    const CandidateSights& sights = world.dump().sights;
    hidden += sights.hidden[sights.own_candidate] / 600;
  }
  EXPECT_GT(hidden, 0.02);
  EXPECT_LT(hidden, world.settings.move.viewpoint_search.keep_shot_below);
  EXPECT_LT(way_m, 1.0);
}

// Four stand in a row. A post before the camera hides one of them: a quarter of all, or less. However many others there
// are, that one is not left behind it.
TEST(MinCost, OneOfFourWhoStandIsNotLeftBehindAPost) {
  for (const double half_post_m : {0.1, 0.16}) {
    Filming world;
    for (uint64_t k = 0; k < 4; ++k) world.add_target(k + 1, {-2.25 + 1.5 * static_cast<double>(k), 1, 0});
    world.add_box(100, {-0.47, 1.5, 3}, {half_post_m, 3, half_post_m});
    world.place({0, 1.6, 8}, {0, 1, 0});
    Watch watch(world);
    StepResult r;
    double hidden_first = 0, hidden_last = 0;
    for (int i = 0; i < 480; ++i) {
      world.step_in(watch, r);
      const CandidateSights& sights = world.dump().sights;
      const double hidden = sights.hidden[sights.own_candidate];
      if (i < 10) hidden_first += hidden / 10;
      if (i >= 360) hidden_last += hidden / 120;
    }
    EXPECT_GT(hidden_first, 0.05) << half_post_m;
    EXPECT_LT(hidden_first, 0.3) << half_post_m;
    EXPECT_LT(hidden_last, 0.02) << half_post_m;
  }
}

struct WoodWalk {
  int changes = 0;    // steps at which the camera changes between following and another course
  int follows = 0;    // steps at which it follows
  double seen = 0.0;  // mean visible share
};
WoodWalk walk_in_wood(uint64_t seed) {
  Filming world;
  world.settings.move.keep_shot = 0;
  world.settings.move.decide_every_s = 0;  // with 30 decisions a second there are 5 changes instead of 4
  CounterRandom random(seed, 0, RandomPurpose::kTest);
  for (uint64_t k = 0; k < 150; ++k) {
    const double aside_m = random.next_in(1.2, 8);
    world.add_box(100 + k, {random.next_in(2, 32), 3, k % 2 ? aside_m : -aside_m}, {0.2, 3, 0.2});
  }
  world.add_target(1, {0, 1, 0});
  world.add_target(2, {1.5, 1, 0});
  world.place({0, 1.6, 7}, {0, 1, 0});
  Watch watch(world);
  StepResult r;
  WoodWalk walk;
  bool follows = false;
  for (int i = 0; i < 1200; ++i) {
    const double x_m = 1.4 * kTick * i;
    world.move(1, {x_m, 1, 0}, {1.4, 0, 0});
    world.move(2, {x_m + 1.5, 1, 0}, {1.4, 0, 0});
    world.step_in(watch, r);
    walk.changes += i > 0 && world.dump().decision.follows != follows;
    walk.follows += follows = world.dump().decision.follows;
    for (const auto& target : r.targets) walk.seen += target.visible_share / 2400;
  }
  return walk;
}

// Among trees, first one course costs less and then another, from step to step.
TEST(MinCost, ACameraInAWoodKeepsToItsCourse) {
  int changes = 0, follows = 0;
  for (uint64_t seed = 1; seed <= 4; ++seed) {
    const WoodWalk walk = walk_in_wood(seed);
    changes += walk.changes, follows += walk.follows;
    EXPECT_GT(walk.seen, 0.9) << "wood " << seed;
  }
  EXPECT_LE(changes, 4);
  EXPECT_GT(follows, 0);
}

// A wall comes between the camera and the target within one step. A wall that moves may soon be gone, so it counts
// little at first.
TEST(MinCost, WhatMovesHidesLittleAtFirstAndWhatStaysAllAtOnce) {
  const auto hidden_after = [](bool moves, int steps) {
    OneFilmed world({0, 1, 6});
    world.settings.move.decide_every_s = 0;  // so that every step looks at the candidates
    world.settings.aggregate.filter.mode = FilterMode::kPerTarget;
    world.settings.aggregate.filter.min_occlusion_s = 0.15;
    world.limits.max_acceleration_mps2 = 1e-6;
    if (moves) world.add_box(10, {50, 1, 4}, {3, 3, 0.05}, {.collides = false}), world.move(10, {50, 1, 4});
    for (int i = 0; i < 10; ++i) world.step(kTick);
    if (moves)
      world.move(10, {0, 1, 4});
    else
      world.add_box(10, {0, 1, 4}, {3, 3, 0.05}, {.collides = false});
    for (int i = 0; i < steps; ++i) world.step(kTick);
    const CandidateSights& sights = world.dump().sights;
    return sights.hidden[sights.own_candidate];
  };
  EXPECT_NEAR(hidden_after(false, 1), 1.0, 1e-6);
  EXPECT_LT(hidden_after(true, 1), 0.3);
  EXPECT_GT(hidden_after(true, 60), 0.9) << "after a second";
}

// Two targets walk about a field of pillars, at irregular rates. At every step the path keeps the limits and is free of
// collisions.
void walk_among_pillars(Filming& world, uint64_t seed, const std::function<void(const StepResult&)>& each) {
  CounterRandom random(seed, 0, RandomPurpose::kTest);
  for (uint64_t k = 0; k < 40; ++k) {
    const glm::dvec3 at(random.next_in(-10, 10), 1.5, random.next_in(-10, 10));
    if (std::abs(at.z) > 1.2 && glm::distance(at, glm::dvec3(0, 1.5, 5)) > 1.5)
      world.add_box(10 + k, at, {random.next_in(0.2, 0.5), 1.5, random.next_in(0.2, 0.5)});
  }
  world.add_target(1, {-1, 0.9, 0}), world.add_target(2, {1, 0.9, 0});
  world.place({0, 1.6, 5}, {0, 1, 0});
  Watch watch(world);
  StepResult r;
  double time = 0;
  for (int i = 0; i < 500; ++i) {
    const double dt = random.next_in(1.0 / 120, 1.0 / 20);
    time += dt;
    world.move(1, {-1 + 5 * std::sin(0.3 * time), 0.9, 0.6 * std::sin(time)},
               {1.5 * std::cos(0.3 * time), 0, 0.6 * std::cos(time)});
    world.move(2, {1 + 5 * std::sin(0.3 * time), 0.9, 0}, {1.5 * std::cos(0.3 * time), 0, 0});
    world.step_in(watch, r, dt);
    EXPECT_FALSE(r.flags.body_overlap);
    each(r);
  }
}

class MinCostWalk : public testing::TestWithParam<uint64_t> {};
TEST_P(MinCostWalk, KeepsTheLimitsAndTouchesNothing) {
  Filming world;
  int seen = 0;
  walk_among_pillars(world, GetParam(), [&](const StepResult& r) {
    seen += r.targets[0].visible_share > 0.5 && r.targets[1].visible_share > 0.5;
  });
  EXPECT_GT(seen, 250) << "and they are seen most of the time";
}
INSTANTIATE_TEST_SUITE_P(Fields, MinCostWalk, testing::Values(1, 2, 3));

TEST(MinCost, EqualInputsGiveEqualResultsBitForBit) {
  const auto run = [] {
    Filming world;
    std::vector<CameraState> path;
    walk_among_pillars(world, 4, [&](const StepResult& r) { path.push_back(r.camera); });
    return path;
  };
  const auto first = run(), second = run();
  ASSERT_EQ(first.size(), second.size());
  EXPECT_EQ(0, std::memcmp(first.data(), second.data(), first.size() * sizeof first[0]));
}

TEST(MinCost, ATargetThatJumpsIsFollowedWithoutAJump) {
  OneFilmed world;
  Watch watch(world);
  StepResult r;
  for (int i = 0; i < 30; ++i) world.step_in(watch, r);
  world.move(1, {40, 1, 0});
  for (int i = 0; i < 900; ++i) world.step_in(watch, r);
  EXPECT_LT(glm::distance(r.camera.pose.position_m, glm::dvec3(40, 1.6, 6)), 0.3);
}

TEST(MinCost, APauseChangesNothing) {
  OneFilmed world;
  Watch watch(world);
  StepResult r;
  for (int i = 0; i < 20; ++i) {
    world.move(1, {0.05 * i, 1, 0}, {3, 0, 0});
    world.step_in(watch, r);
  }
  const CameraState before = world.camera();
  for (int i = 0; i < 5; ++i) world.step_in(watch, r, 0.0);
  EXPECT_EQ(r.reason, MoveReason::kPaused);
  EXPECT_EQ(r.camera.pose.position_m, before.pose.position_m);
  EXPECT_EQ(r.camera.pose.rotation, before.pose.rotation);
  EXPECT_EQ(r.camera.velocity_mps, before.velocity_mps);
}

// A sum of what leaving the desired position would gain must not later count for the way back.
TEST(MinCost, GainsAreSummedOverAPauseButNotOverAStepWithoutTargets) {
  OneFilmed world;
  for (int i = 0; i < 20; ++i) world.move(1, {0.05 * i, 1, 0}, {3, 0, 0}), world.step(kTick);
  ASSERT_TRUE(world.stepper.carried().change);
  const double sum_metre_s = world.stepper.carried().change->sum_metre_s;
  world.step(0.0);
  ASSERT_TRUE(world.stepper.carried().change);
  EXPECT_EQ(world.stepper.carried().change->sum_metre_s, sum_metre_s);
  world.targets[0].weight = 0;
  world.step(kTick);
  EXPECT_FALSE(world.stepper.carried().change);
}

TEST(MinCost, AddingATargetOrItsWeightMakesNoPop) {
  OneFilmed world;
  Watch watch(world);
  StepResult r;
  for (int i = 0; i < 60; ++i) world.step_in(watch, r);
  world.add_target(2, {1, 1, 0});
  const glm::dvec3 before = r.camera.pose.position_m;
  for (int i = 0; i < 120; ++i) {
    if (i == 60) world.targets[1].weight = 0;
    world.step_in(watch, r);
  }
  EXPECT_LT(glm::distance(r.camera.pose.position_m, before), 0.1) << "all are seen from where it is";
}

}  // namespace
}  // namespace sightline::test
