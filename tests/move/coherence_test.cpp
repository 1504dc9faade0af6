#include "server/move/coherence.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "server/base/random.h"
#include "server/move/choose.h"

namespace sightline {
namespace {

constexpr double kPi = std::numbers::pi;

// Two targets about a centre, a camera 6 m off at the centre's height, looking at the centre; a candidate
// that starts as the shot itself.
struct Shot {
  std::vector<TargetView> targets;
  std::vector<float> now_share{0.8f, 0.6f}, share{0.8f, 0.6f};
  glm::dvec3 center{0.0};
  glm::dvec3 offset{0, 0, 6};
  Lens lens;
  ShotState now;
  ShotCandidate candidate;

  Shot() {
    add({-1, 0, 0}, 1.0), add({1, 0, 0}, 1.0);
    capture();
  }
  void add(const glm::dvec3& at, double weight) {
    TargetView t;
    t.aim_m = at, t.radius_m = 0.5, t.weight = weight;
    targets.push_back(t);
  }
  Pose looking_from(const glm::dvec3& from_center) const {
    return {center + from_center, look_rotation(glm::normalize(-from_center), {0, 1, 0}, {1, 0, 0})};
  }
  void capture() {
    center = weighted_center_m(targets);
    capture_shot(looking_from(offset), lens, targets, now_share, now);
    go(offset);
  }
  void go(const glm::dvec3& from_center) { candidate.world_from_camera = looking_from(from_center); }
  CoherenceTerms terms() {
    candidate.seen_share = share;
    return coherence_terms(candidate, now, targets);
  }
  double cost(const CoherenceSettings& settings = {}) {
    candidate.seen_share = share;
    return coherence_cost(candidate, now, targets, settings);
  }
  double whole_cost(const CoherenceSettings& settings) {
    candidate.seen_share = share;
    return shot_cost(candidate, now, targets, settings);
  }
};

// A camera at `distance` and `height` over the centre, turned by `azimuth` about the vertical.
glm::dvec3 around(double distance, double height, double azimuth) {
  const double flat = std::sqrt(distance * distance - height * height);
  return {flat * std::sin(azimuth), height, flat * std::cos(azimuth)};
}

TEST(Coherence, KeepingTheShotCostsNothing) {
  Shot shot;
  const CoherenceTerms t = shot.terms();
  EXPECT_EQ(t.visibility, 0.0);
  EXPECT_EQ(t.view_angle, 0.0);
  EXPECT_EQ(t.height, 0.0);
  EXPECT_EQ(t.distance, 0.0);
  EXPECT_NEAR(t.screen, 0.0, 1e-12);
  EXPECT_NEAR(shot.cost(), 0.0, 1e-12);
}

TEST(Coherence, GoingAlongWithTheTargetsCostsNothing) {
  Shot shot;
  for (TargetView& t : shot.targets) t.aim_m += glm::dvec3(7, 1, -3);
  shot.candidate.world_from_camera.position_m += glm::dvec3(7, 1, -3);
  EXPECT_NEAR(shot.cost(), 0.0, 1e-12);
}

// Checks that `term` grows with each step of `change` and gives the cost of the last one.
double grows(Shot& shot, double CoherenceTerms::*term, int steps, const std::function<void(int)>& change) {
  double last = shot.terms().*term;
  EXPECT_NEAR(last, 0.0, 1e-12);
  for (int i = 1; i <= steps; ++i) {
    change(i);
    const double next = shot.terms().*term;
    EXPECT_GT(next, last) << "step " << i;
    last = next;
  }
  return last;
}

TEST(Coherence, LosingSightOfATargetCostsByItsShareAndNothingElseChanges) {
  Shot shot;
  const double last =
      grows(shot, &CoherenceTerms::visibility, 6, [&](int i) { shot.share[1] = 0.6f - 0.1f * i; });
  EXPECT_NEAR(last, 0.3, 1e-6) << "0.6 of one of two equal targets";
  const CoherenceTerms t = shot.terms();
  EXPECT_EQ(t.view_angle + t.height + t.distance, 0.0);
  EXPECT_NEAR(t.screen, 0.0, 1e-12);
}

TEST(Coherence, SeeingMoreCostsNothing) {
  Shot shot;
  shot.share = {1.0f, 1.0f};
  EXPECT_EQ(shot.terms().visibility, 0.0);
}

TEST(Coherence, OneTargetGainedDoesNotPayForAnotherLost) {
  Shot shot;
  shot.share = {1.0f, 0.4f};
  EXPECT_NEAR(shot.terms().visibility, 0.1, 1e-6);
}

TEST(Coherence, TurningAboutTheVerticalChangesTheViewAngleByJustThat) {
  Shot shot;
  shot.offset = around(6, 0, 0);
  shot.capture();
  grows(shot, &CoherenceTerms::view_angle, 12, [&](int i) { shot.go(around(6, 0, kPi / 12 * i)); });
  EXPECT_NEAR(shot.terms().view_angle, kPi, 1e-7);
  shot.go(around(6, 0, 0.7));
  EXPECT_NEAR(shot.terms().view_angle, 0.7, 1e-12);
  EXPECT_NEAR(shot.terms().height, 0.0, 1e-12);
  EXPECT_NEAR(shot.terms().distance, 0.0, 1e-12);
}

TEST(Coherence, ASmallAngleIsNotRoundedAway) {
  Shot shot;
  shot.go(around(6, 0, 1e-9));
  EXPECT_NEAR(shot.terms().view_angle, 1e-9, 1e-15);
}

TEST(Coherence, HeightCostsByTheDistanceNow) {
  Shot shot;
  const double last =
      grows(shot, &CoherenceTerms::height, 10, [&](int i) { shot.go(around(6, 0.3 * i, 0)); });
  EXPECT_NEAR(last, 3.0 / 6.0, 1e-12);
  EXPECT_NEAR(shot.terms().distance, 0.0, 1e-12) << "higher at one distance";
  shot.go(around(6, -3, 0));
  EXPECT_NEAR(shot.terms().height, 0.5, 1e-12) << "lower costs as much as higher";
}

TEST(Coherence, DistanceCostsByTheRatioAndChangesNeitherAngleNorHeight) {
  Shot shot;
  grows(shot, &CoherenceTerms::distance, 10, [&](int i) { shot.go({0, 0, 6.0 + i}); });
  EXPECT_EQ(shot.terms().view_angle, 0.0);
  EXPECT_EQ(shot.terms().height, 0.0);
  shot.go({0, 0, 12});
  EXPECT_NEAR(shot.terms().distance, std::log(2.0), 1e-12);
  shot.go({0, 0, 3});
  EXPECT_NEAR(shot.terms().distance, std::log(2.0), 1e-12) << "half as far costs as much as twice as far";
}

TEST(Coherence, TurningTheCameraOnItsPlaceChangesTheScreenAlone) {
  Shot shot;
  const glm::dquat ahead = shot.candidate.world_from_camera.rotation;
  const auto turn = [&](double angle) {
    shot.candidate.world_from_camera.rotation = ahead * glm::angleAxis(angle, glm::dvec3(1, 0, 0));
  };
  grows(shot, &CoherenceTerms::screen, 20, [&](int i) { turn(0.1 * i); });
  const CoherenceTerms t = shot.terms();
  EXPECT_EQ(t.view_angle + t.height + t.distance + t.visibility, 0.0);
}

TEST(Coherence, ATargetInTheMiddleThatMovesToTheEdgeCostsOneOnTheScreen) {
  Shot shot;
  shot.targets.resize(1), shot.now_share.resize(1), shot.share.resize(1);
  shot.capture();
  const glm::dquat ahead = shot.candidate.world_from_camera.rotation;
  shot.candidate.world_from_camera.rotation =
      ahead * glm::angleAxis(shot.lens.vertical_fov_rad / 2, glm::dvec3(1, 0, 0));
  EXPECT_NEAR(shot.terms().screen, 1.0, 1e-12);
}

TEST(Coherence, CrossingTheLineOfActionSwapsTheSidesOnTheScreen) {
  Shot shot;
  shot.go({0, 0, -6});
  const double each = 2 * std::atan(1.0 / 6) / (shot.lens.vertical_fov_rad / 2);
  EXPECT_NEAR(shot.terms().screen, each, 1e-9);
}

Shot random_shot(CounterRandom& random) {
  const auto near = [&](double size) {
    return glm::dvec3(random.next_in(-size, size), random.next_in(-size, size), random.next_in(-size, size));
  };
  Shot shot;
  shot.targets.clear();
  for (int i = 0; i < 3; ++i) shot.add(near(2), random.next_in(0.1, 2.0));
  shot.now_share = {random.next_unit(), random.next_unit(), random.next_unit()};
  shot.share = {random.next_unit(), random.next_unit(), random.next_unit()};
  shot.offset = near(6) + glm::dvec3(0, 0, 8);
  shot.capture();
  shot.go(shot.offset + near(2));
  return shot;
}

TEST(Coherence, TheScaleOfTheSceneChangesNoTerm) {
  for (uint64_t seed = 0; seed < 50; ++seed) {
    CounterRandom random(seed, 0, RandomPurpose::kTest);
    Shot shot = random_shot(random);
    const CoherenceTerms metres = shot.terms();
    const Pose pose = shot.candidate.world_from_camera;
    for (TargetView& t : shot.targets) t.aim_m *= 40.0;
    shot.offset *= 40.0;
    shot.capture();
    shot.candidate.world_from_camera = {pose.position_m * 40.0, pose.rotation};
    const CoherenceTerms scaled = shot.terms();
    EXPECT_NEAR(metres.visibility, scaled.visibility, 1e-12);
    EXPECT_NEAR(metres.view_angle, scaled.view_angle, 1e-12);
    EXPECT_NEAR(metres.height, scaled.height, 1e-12);
    EXPECT_NEAR(metres.distance, scaled.distance, 1e-12);
    EXPECT_NEAR(metres.screen, scaled.screen, 1e-12);
  }
}

TEST(Coherence, TheScaleOfTheWeightsChangesNoCost) {
  CounterRandom random(1, 0, RandomPurpose::kTest);
  Shot shot = random_shot(random);
  CoherenceSettings s{.visibility = 1, .view_angle = 2, .height = 3, .distance = 4, .screen = 5};
  const double before = shot.cost(s);
  s.visibility *= 7, s.view_angle *= 7, s.height *= 7, s.distance *= 7, s.screen *= 7;
  EXPECT_NEAR(shot.cost(s), before, 1e-12);
  for (TargetView& t : shot.targets) t.weight *= 3;
  EXPECT_NEAR(shot.cost(s), before, 1e-9);
}

TEST(Coherence, OneWeightAloneIsItsTermAlone) {
  CounterRandom random(2, 0, RandomPurpose::kTest);
  Shot shot = random_shot(random);
  const CoherenceTerms t = shot.terms();
  CoherenceSettings none{.visibility = 0, .view_angle = 0, .height = 0, .distance = 0, .screen = 0};
  const auto alone = [&](double CoherenceSettings::*weight) {
    CoherenceSettings s = none;
    s.*weight = 3.0;
    return shot.cost(s);
  };
  EXPECT_DOUBLE_EQ(alone(&CoherenceSettings::visibility), t.visibility);
  EXPECT_DOUBLE_EQ(alone(&CoherenceSettings::view_angle), t.view_angle);
  EXPECT_DOUBLE_EQ(alone(&CoherenceSettings::height), t.height);
  EXPECT_DOUBLE_EQ(alone(&CoherenceSettings::distance), t.distance);
  EXPECT_DOUBLE_EQ(alone(&CoherenceSettings::screen), t.screen);
}

TEST(Coherence, ATargetOfNoWeightHasNoSay) {
  Shot shot;
  shot.add({50, 20, -9}, 0.0);
  shot.now_share.push_back(1.0f), shot.share.push_back(1.0f);
  shot.capture();
  shot.share[2] = 0.0f;
  shot.targets[2].aim_m = {-80, 0, 0};
  EXPECT_NEAR(shot.cost(), 0.0, 1e-12);
  EXPECT_NEAR(hidden_share(shot.targets, shot.share), 0.3, 1e-6);
}

TEST(Coherence, ACameraAtTheTargetsHasAFiniteCost) {
  Shot shot;
  shot.candidate.world_from_camera.position_m = shot.center;
  EXPECT_TRUE(std::isfinite(shot.cost()));
  shot.candidate.world_from_camera.position_m = shot.targets[0].aim_m;
  EXPECT_TRUE(std::isfinite(shot.cost()));
  shot.offset = {0, 1e-12, 0};
  capture_shot({shot.center, {1, 0, 0, 0}}, shot.lens, shot.targets, shot.now_share, shot.now);
  EXPECT_TRUE(std::isfinite(shot.cost()));
}

TEST(ShotCost, IsBetweenZeroAndOneWhateverIsAsked) {
  for (uint64_t seed = 0; seed < 100; ++seed) {
    CounterRandom random(seed, 2, RandomPurpose::kTest);
    Shot shot = random_shot(random);
    CoherenceSettings s;
    s.responsiveness = random.next_unit(), s.predictive_power = random.next_unit(),
    s.view_angle = random.next_in(0, 100);
    shot.candidate.depth_share = random.next_unit(), shot.candidate.hidden_ahead = random.next_unit();
    const double cost = shot.whole_cost(s);
    ASSERT_GE(cost, 0.0);
    ASSERT_LE(cost, 1.0);
  }
}

TEST(ShotCost, StaysBelowOneHoweverFarTheShotIsChangedAndStillGrows) {
  Shot shot;
  const CoherenceSettings s{.responsiveness = 0};
  double last = 0;
  for (int i = 1; i <= 10; ++i) {
    shot.go({0, 0, 6 * std::exp2(8 * i)});
    EXPECT_GT(shot.whole_cost(s), last);
    EXPECT_LT(shot.whole_cost(s), 1.0);
    last = shot.whole_cost(s);
  }
  EXPECT_GT(shot.cost(s), 1.0);
}

TEST(ShotCost, ResponsivenessChoosesBetweenSeeingNowAndKeepingTheShot) {
  Shot stays, goes;
  stays.share = stays.now_share = {0.2f, 0.2f}, stays.capture();
  goes.now_share = stays.now_share, goes.capture();
  goes.share = {1.0f, 1.0f}, goes.go(around(6, 2, 1.5));
  const auto prefers_going = [&](double responsiveness) {
    CoherenceSettings s;
    s.responsiveness = responsiveness, s.predictive_power = 0;
    return goes.whole_cost(s) < stays.whole_cost(s);
  };
  EXPECT_FALSE(prefers_going(0.0));
  EXPECT_FALSE(prefers_going(0.1));
  EXPECT_TRUE(prefers_going(0.9));
  EXPECT_TRUE(prefers_going(1.0));
}

TEST(ShotCost, PredictivePowerChoosesBetweenSeeingNowAndStayingSheltered) {
  Shot rim, deep;
  rim.share = {1.0f, 1.0f}, rim.candidate.depth_share = 0.2;
  deep.share = {0.9f, 0.9f}, deep.candidate.depth_share = 1.0;
  const auto prefers_deep = [&](double power) {
    CoherenceSettings s;
    s.responsiveness = 1, s.predictive_power = power;
    return deep.whole_cost(s) < rim.whole_cost(s);
  };
  EXPECT_FALSE(prefers_deep(0.0));
  EXPECT_TRUE(prefers_deep(0.5));
  EXPECT_TRUE(prefers_deep(1.0));
}

TEST(ShotCost, WhatIsForetoldToBeHiddenCostsMoreAndDepthCostsLess) {
  Shot shot;
  const CoherenceSettings s;
  double last = -1;
  for (int i = 0; i <= 10; ++i) {
    shot.candidate.hidden_ahead = i / 10.0;
    EXPECT_GT(shot.whole_cost(s), last);
    last = shot.whole_cost(s);
  }
  shot.candidate.hidden_ahead = 0;
  for (int i = 0; i <= 10; ++i) {
    shot.candidate.depth_share = i / 10.0;
    EXPECT_LT(shot.whole_cost(s), last + (i == 0 ? 1e-12 : 0));
    last = shot.whole_cost(s);
  }
}

TEST(ShotCost, SharesOfAMaskAreItsBits) {
  std::vector<float> share(3);
  shares_from_mask(0b101, share);
  EXPECT_EQ(share, (std::vector<float>{1, 0, 1}));
}

}  // namespace
}  // namespace sightline
