#include "server/paper/choose_place.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "server/base/random.h"
#include "server/paper/robust_costs.h"
#include "tests/move/target_at.h"

namespace sightline {
namespace {

const Reachable kAlways = [](const glm::dvec3&) { return true; };

struct Case {
  CandidateSet candidates;
  std::vector<TrackedTarget> targets;
  glm::dvec3 desired{0, 0, 5};
  MoveSettings settings;
  ChoiceScratch scratch;
  std::vector<double> costs;
  double ahead_weight = 0;

  void place(const glm::dvec3& at, uint32_t visible) { candidates.add(at, visible); }
  Choice choose(const Reachable& reachable = kAlways) {
    basic_costs(candidates.position_m, desired, costs);
    return choose_place(candidates, targets, costs, desired, ahead_weight, settings, reachable, scratch);
  }
};

Case two_targets() {
  Case c;
  c.targets = {target_at({-1, 0, 0}), target_at({1, 0, 0})};
  return c;
}

TEST(Choose, TakesTheNearestCandidateThatSeesAll) {
  Case c = two_targets();
  c.place({0, 0, 5.1}, 0b01);
  c.place({0, 0, 6}, 0b11);
  c.place({0, 0, 5.5}, 0b11);
  const Choice choice = c.choose();
  EXPECT_EQ(choice.candidate, 2);
  EXPECT_EQ(choice.status, MoveStatus::kTracking);
  EXPECT_EQ(choice.reason, MoveReason::kNearestAllVisible);
}

TEST(Choose, SaysWhenItIsTheDesiredPlaceItself) {
  Case c = two_targets();
  c.place({0, 0, 5}, 0b11);
  EXPECT_EQ(c.choose().reason, MoveReason::kAtDesiredPlace);
}

// By brute force over random sets: no candidate that sees all targets, is reachable and keeps the limits is nearer.
TEST(Choose, AgreesWithBruteForceOnRandomSets) {
  CounterRandom random(61, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 500; ++trial) {
    Case c = two_targets();
    for (int i = 0; i < 20; ++i)
      c.place({random.next_in(-3, 3), random.next_in(-1, 1), random.next_in(3, 7)}, random.next_below(4));
    const Choice choice = c.choose();
    int best = -1;
    for (int i = 0; i < 20; ++i) {
      if (c.candidates.visible_targets[i] != 0b11) continue;
      const auto rank = [&](int k) {
        return std::make_pair(!within_limits(c.candidates.position_m[k], c.targets, c.settings),
                              glm::distance(c.candidates.position_m[k], c.desired));
      };
      if (best < 0 || rank(i) < rank(best)) best = i;
    }
    if (best >= 0) {
      EXPECT_EQ(choice.candidate, best);
    } else {
      EXPECT_NE(choice.status, MoveStatus::kTracking);
    }
  }
}

// Searching outwards from the desired position must find the same candidate as trying all of them. The random sets have
// runs and single candidates, optional targets, targets without weight, limits, predictions, ties, and candidates that
// cannot be reached.
TEST(Choose, SearchingOutwardsFindsWhatTryingAllFinds) {
  CounterRandom random(64, 0, RandomPurpose::kTest);
  std::array<int, 4> reasons{};
  for (int trial = 0; trial < 3000; ++trial) {
    Case c;
    for (int i = 0; i < 1 + trial % 3; ++i)
      c.targets.push_back(target_at({random.next_in(-2, 2), random.next_in(0, 2), random.next_in(-2, 2)},
                                    i == 2 ? 0.0 : random.next_in(0.5, 2), random.next_unit() < 0.7));
    const double spacing = trial % 5 == 0 ? 1.0 : random.next_in(0.1, 2);
    std::vector<PlaceRun> runs;
    uint32_t count = 0;
    for (int z = 2; z < 7; ++z)
      for (int y = -1; y < 3; ++y) {
        if (random.next_unit() < 0.2) continue;
        runs.push_back({{static_cast<int>(random.next_in(-6, 0)), y, z}, count});
        count += 1 + random.next_below(9);
      }
    if (trial % 7 != 0) c.candidates.position_m.set_runs(spacing, runs, count);
    for (int k = 0; k < trial % 4; ++k)
      c.candidates.position_m.push_back({random.next_in(-3, 3), random.next_in(-1, 3), random.next_in(1, 7)});
    const double seen = random.next_unit();
    for (size_t i = 0; i < c.candidates.size(); ++i)
      c.candidates.visible_targets.push_back(random.next_unit() < seen ? 0b111u
                                                                       : random.next_below(trial % 6 == 0 ? 1 : 8));
    if (trial % 3 == 0)
      for (size_t i = 0; i < c.candidates.size(); ++i) c.candidates.ahead_targets.push_back(random.next_below(8));
    c.ahead_weight = trial % 3 == 0 ? random.next_unit() : 0.0;
    c.desired = glm::dvec3(random.next_in(-9, 9), random.next_in(-3, 6), random.next_in(-3, 14));
    if (trial % 5 == 0) c.desired = glm::round(c.desired);
    c.settings.min_distance_m = random.next_in(0, 4);
    const double blocked = trial % 2 == 0 ? 0.0 : random.next_in(0.3, 1.01);
    const Reachable reachable = [&](const glm::dvec3& p) {
      const double noise = std::sin(1e4 * (p.x + 3 * p.y + 7 * p.z));
      return 0.5 + 0.5 * noise >= blocked;
    };
    const Choice over_all = c.choose(reachable),
                 outwards = choose_basic(c.candidates, c.targets, c.desired, c.ahead_weight, c.settings, reachable,
                                         c.scratch);
    ASSERT_EQ(outwards.candidate, over_all.candidate) << trial;
    ASSERT_EQ(outwards.status, over_all.status);
    ASSERT_EQ(outwards.reason, over_all.reason);
    ++reasons[outwards.status == MoveStatus::kTracking  ? 0
              : outwards.status == MoveStatus::kPartial ? 1
              : outwards.candidate < 0                  ? 2
                                                        : 3];
  }
  for (int k = 0; k < 4; ++k) EXPECT_GT(reasons[static_cast<size_t>(k)], 20) << k;
}

TEST(Choose, SkipsCandidatesThatTheBodyCannotReach) {
  Case c = two_targets();
  c.place({0, 0, 5}, 0b11);
  c.place({0, 0, 6}, 0b11);
  EXPECT_EQ(c.choose([](const glm::dvec3& p) { return p.z > 5.5; }).candidate, 1);
}

TEST(Choose, FallsToTheBestPartialRequiredBeforeOptional) {
  Case c;
  c.targets = {target_at({-1, 0, 0}, 1.0, true), target_at({1, 0, 0}, 100.0, false), target_at({0, 0, 0}, 1.0, true)};
  c.place({0, 0, 5}, 0b010);  // sees the heavy optional one alone, and is the desired position
  c.place({0, 0, 6}, 0b001);  // sees one required target
  c.place({0, 0, 7}, 0b011);  // sees one required target and the optional one
  const Choice choice = c.choose();
  EXPECT_EQ(choice.candidate, 2);
  EXPECT_EQ(choice.status, MoveStatus::kPartial);
  EXPECT_EQ(choice.reason, MoveReason::kBestPartial);
}

TEST(Choose, HeavierRequiredTargetWinsAPartialView) {
  Case c;
  c.targets = {target_at({-1, 0, 0}, 1.0), target_at({1, 0, 0}, 2.0)};
  c.place({0, 0, 5}, 0b01);
  c.place({0, 0, 6}, 0b10);
  EXPECT_EQ(c.choose().candidate, 1);
}

TEST(Choose, EscapesWhenNothingIsSeen) {
  Case c = two_targets();
  c.place({0, 0, 5}, 0);
  EXPECT_EQ(c.choose().status, MoveStatus::kEscaping);
  EXPECT_EQ(c.choose().reason, MoveReason::kHorizonGrown);
}

TEST(Choose, HoldsWhenEverySeeingCandidateIsOutOfReach) {
  Case c = two_targets();
  c.place({0, 0, 5}, 0b11);
  c.place({0, 0, 6}, 0b01);
  const Choice choice = c.choose([](const glm::dvec3&) { return false; });
  EXPECT_EQ(choice.candidate, -1);
  EXPECT_EQ(choice.status, MoveStatus::kHolding);
  EXPECT_EQ(choice.reason, MoveReason::kBlockedByGeometry);
}

TEST(Choose, TargetsWithoutWeightAreNotSteeredFor) {
  Case c;
  c.targets = {target_at({-1, 0, 0}), target_at({1, 0, 0}, 0.0)};
  c.place({0, 0, 5}, 0b01);
  EXPECT_EQ(c.choose().status, MoveStatus::kTracking);
  c.targets[0].weight = 0;
  EXPECT_EQ(c.choose().reason, MoveReason::kNoTargets);
}

TEST(Choose, CandidatesOutsideTheLimitsComeLast) {
  Case c = two_targets();
  c.desired = {0, 0, 0.5};
  c.settings.min_distance_m = 1.5;
  c.place({0, 0, 0.1}, 0b11);  // too near the targets
  c.place({0, 0, 4}, 0b11);
  EXPECT_EQ(c.choose().candidate, 1);
  c.candidates.filtered_targets = {0b11, 0};
  EXPECT_EQ(c.choose().candidate, 0);
}

// Both candidates see all targets now, but only one of them will see them where they are going.
TEST(Choose, PrefersTheCandidateThatKeepsSeeingAllTargets) {
  Case c = two_targets();
  c.place({0, 0, 5}, 0b11);
  c.place({0, 0, 6}, 0b11);
  c.candidates.ahead_targets = {0b01, 0b11};
  EXPECT_EQ(c.choose().candidate, 0) << "without prediction the nearest";
  c.ahead_weight = 0.5;
  EXPECT_EQ(c.choose().candidate, 1);
}

// The status follows what is seen now: a candidate that sees all targets only by prediction is not in S_V.
TEST(Choose, PredictionNeverReplacesTheRealTarget) {
  Case c = two_targets();
  c.place({0, 0, 5}, 0b01);
  c.candidates.ahead_targets = {0b11};
  c.ahead_weight = 0.9;
  EXPECT_EQ(c.choose().status, MoveStatus::kPartial);
}

}  // namespace
}  // namespace sightline
