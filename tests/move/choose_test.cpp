#include "server/move/choose.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "server/base/random.h"
#include "server/move/framing.h"
#include "tests/move/target_at.h"

namespace sightline {
namespace {

struct Case {
  CandidateSet candidates;
  std::vector<TrackedTarget> targets;
  glm::dvec3 desired{0, 0, 5};
  MoveSettings settings;

  void place(const glm::dvec3& at, uint32_t visible) { candidates.add(at, visible); }
};

Case two_targets() {
  Case c;
  c.targets = {target_at({-1, 0, 0}), target_at({1, 0, 0})};
  return c;
}

TEST(DesiredPlace, KeepsTheOffsetWhenTheGroupFits) {
  const Case c = two_targets();
  EXPECT_LT(glm::distance(desired_place_m(c.targets, {1, 2, 8}, {}, 0.1, {}), glm::dvec3(1, 2, 8)), 1e-9);
}

// Returns whether every sphere lies within the picture of a camera at `place` that looks at `center`. The picture's
// sides stand at (1 - margin) of the half angles.
bool is_within(const glm::dvec3& place, const glm::dvec3& center, const std::vector<TrackedTarget>& targets,
               const Lens& lens, double margin) {
  const glm::dvec3 ahead = glm::normalize(center - place),
                   right = glm::normalize(glm::cross(ahead, glm::dvec3(0, 1, 0)));
  const glm::dvec3 up = glm::cross(right, ahead);
  const double half_y = lens.vertical_fov_rad / 2, half_x = std::atan(std::tan(half_y) * lens.aspect);
  for (const TrackedTarget& target : targets) {
    const glm::dvec3 from = target.aim_m - place;
    for (const auto& [side, half] :
         {std::pair(right, half_x), std::pair(-right, half_x), std::pair(up, half_y), std::pair(-up, half_y)}) {
      const double angle = half * (1 - margin);
      // Signed distance from the side's plane.
      if (glm::dot(from, ahead) * std::sin(angle) - glm::dot(from, side) * std::cos(angle) < target.radius_m)
        return false;
    }
  }
  return true;
}

TEST(DesiredPlace, BacksOffUntilTheGroupFitsThePicture) {
  CounterRandom random(62, 0, RandomPurpose::kTest);
  const Lens lens;
  for (int trial = 0; trial < 500; ++trial) {
    std::vector<TrackedTarget> targets;
    for (int i = 0; i < 3; ++i)
      targets.push_back(target_at({random.next_in(-5, 5), random.next_in(-1, 1), random.next_in(-5, 5)}));
    const glm::dvec3 center = weighted_center_m(targets);
    const glm::dvec3 offset = {random.next_in(-0.5, 0.5), 0.2, 1};
    const double margin = trial % 2 == 0 ? 0.1 : 0.0;
    MoveSettings settings;
    settings.min_distance_m = 0;
    const glm::dvec3 place = desired_place_m(targets, offset, lens, margin, settings);
    const glm::dvec3 outwards = place - center;
    EXPECT_NEAR(glm::dot(glm::normalize(outwards), glm::normalize(offset)), 1, 1e-12);
    // It fits there, and a thousandth nearer it does not.
    EXPECT_TRUE(is_within(center + outwards * 1.000001, center, targets, lens, margin));
    if (glm::length(outwards) > glm::length(offset) + 1e-6) {
      EXPECT_FALSE(is_within(center + outwards * 0.999, center, targets, lens, margin));
    }
    FramingSettings framing;
    framing.dead_zone = 0;
    EXPECT_TRUE(aim_at(place, targets, {}, {}, {.framing = framing}).fits);
  }
}

// Both stand on the line of sight, so the picture holds them from anywhere on it.
TEST(DesiredPlace, KeepsTheLeastDistanceFromTheNearestTarget) {
  const std::vector<TrackedTarget> targets = {target_at({0, 0, 3}), target_at({0, 0, -3})};
  MoveSettings settings;
  settings.min_distance_m = 4;
  EXPECT_LT(glm::distance(desired_place_m(targets, {0, 0, 0.5}, {}, 0.1, settings), glm::dvec3(0, 0, 7)), 1e-9);
  EXPECT_LT(glm::distance(desired_place_m(targets, {0, 0, 8}, {}, 0.1, settings), glm::dvec3(0, 0, 8)), 1e-9);
}

TEST(DesiredPlace, ObeysDistanceAndElevationLimits) {
  const Case c = two_targets();
  MoveSettings settings;
  settings.max_distance_m = 10;
  settings.max_elevation_rad = 0.5;
  const glm::dvec3 place = desired_place_m(c.targets, {0, 50, 50}, {}, 0.1, settings);
  EXPECT_NEAR(glm::length(place), 10, 1e-9);
  EXPECT_NEAR(std::atan2(place.y, place.z), 0.5, 1e-9);
}

TEST(ChoiceOf, SaysWhatTheCandidateSees) {
  Case c = two_targets();
  c.place({0, 0, 5}, 0b11), c.place({1, 0, 5}, 0b11), c.place({2, 0, 5}, 0b10), c.place({3, 0, 5}, 0b00);
  const auto of = [&](uint32_t candidate) { return choice_of(candidate, c.candidates, c.targets); };
  Choice choice = of(0);
  EXPECT_EQ(choice.candidate, 0);
  EXPECT_EQ(choice.status, MoveStatus::kTracking);
  choice = of(1);
  EXPECT_EQ(choice.candidate, 1);
  EXPECT_EQ(choice.status, MoveStatus::kTracking);
  choice = of(2);
  EXPECT_EQ(choice.candidate, 2);
  EXPECT_EQ(choice.status, MoveStatus::kPartial);
  choice = of(3);
  EXPECT_EQ(choice.candidate, 3);
  EXPECT_EQ(choice.status, MoveStatus::kEscaping);
}

// What each reason claims (diagnostics.proto), checked for all that a goal, and all that the other candidates may see.
TEST(ReasonOf, ClaimsOnlyWhatIsSo) {
  for (const FlightCourse course :
       {FlightCourse::kFollow, FlightCourse::kStay, FlightCourse::kPlan, FlightCourse::kToView, FlightCourse::kApproach,
        FlightCourse::kFarWay, FlightCourse::kToShot})
    for (const uint32_t from_goal : {0b00u, 0b01u, 0b11u})
      for (const bool somewhere_all : {false, true})
        for (const auto& [other_shot, keeps_shot] :
             {std::pair(false, false), std::pair(false, true), std::pair(true, false), std::pair(true, true)}) {
          if (from_goal == 0b11 && !somewhere_all) continue;
          const MoveReason reason = reason_of(course, {from_goal, 0b11, somewhere_all, other_shot, keeps_shot});
          const bool keeps = course == FlightCourse::kFollow ? !other_shot
                                                             : course == FlightCourse::kPlan && keeps_shot;
          EXPECT_EQ(reason == MoveReason::kAtDesiredPlace, from_goal == 0b11 && keeps);
          EXPECT_TRUE(reason != MoveReason::kOtherShot ||
                      (from_goal == 0b11 && other_shot && course == FlightCourse::kFollow));
          EXPECT_TRUE(reason != MoveReason::kBestAllVisible ||
                      (from_goal == 0b11 && course == FlightCourse::kPlan && !keeps_shot));
          EXPECT_TRUE(reason != MoveReason::kBestPartial || (!somewhere_all && from_goal != 0));
          EXPECT_TRUE(reason != MoveReason::kBestSoon || from_goal != 0b11u);
          EXPECT_EQ(reason == MoveReason::kNearestView, course == FlightCourse::kToView);
          EXPECT_EQ(reason == MoveReason::kFarViewpoint, course == FlightCourse::kToShot);
          EXPECT_EQ(reason == MoveReason::kStays, course == FlightCourse::kStay);
          EXPECT_EQ(reason == MoveReason::kHorizonGrown, course == FlightCourse::kApproach);
          EXPECT_EQ(reason == MoveReason::kFarWay, course == FlightCourse::kFarWay);
          EXPECT_FALSE(explain(reason).empty());
        }
}

TEST(ChoiceOf, HoldsWithoutTargets) {
  Case c = two_targets();
  c.place({0, 0, 5}, 0b11);
  for (TrackedTarget& t : c.targets) t.weight = 0;
  EXPECT_EQ(choice_of(0, c.candidates, c.targets).reason, MoveReason::kNoTargets);
  EXPECT_EQ(choice_of(0, c.candidates, {}).candidate, -1);
}

TEST(ChoiceOf, ATargetWithoutWeightCountsForNothing) {
  for (const auto& [seen, status] : {std::pair(0b01u, MoveStatus::kTracking), std::pair(0b11u, MoveStatus::kTracking),
                                     std::pair(0b10u, MoveStatus::kEscaping)}) {
    Case c = two_targets();
    c.targets[1].weight = 0;
    c.place({1, 0, 5}, seen);
    EXPECT_EQ(choice_of(0, c.candidates, c.targets).status, status) << seen;
  }
}

// Candidates all around, and exactly on the cones and spheres of the limits.
TEST(PlaceLimits, AreThoseOfEveryPlaceByItself) {
  CounterRandom random(19, 0, RandomPurpose::kTest);
  int inside = 0, outside = 0;
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<TrackedTarget> targets;
    for (int i = 0; i < 1 + trial % 4; ++i)
      targets.push_back(
          target_at({random.next_in(-2, 2), random.next_in(0, 2), random.next_in(-2, 2)}, i == 1 ? 0.0 : 1.0));
    const bool poles = trial % 10 == 0;
    const MoveSettings settings{.min_distance_m = random.next_in(0, 2),
                                .max_distance_m = random.next_in(3, 20),
                                .min_elevation_rad = poles ? -std::acos(0.0) : random.next_in(-1.5, 0.5),
                                .max_elevation_rad = poles ? std::acos(0.0) : random.next_in(0.6, 1.5)};
    const PlaceLimits limits(targets, settings);
    for (int i = 0; i < 200; ++i) {
      const double limit = i % 2 == 0 ? settings.min_elevation_rad : settings.max_elevation_rad;
      const double rise = i % 3 == 0 ? limit : random.next_in(-1.6, 1.6), turn = random.next_in(0, 6.3),
                   far_m = i % 5 == 0 ? settings.max_distance_m : random.next_in(0, 25);
      const glm::dvec3 place = weighted_center_m(targets) + far_m * glm::dvec3(std::cos(rise) * std::cos(turn),
                                                                               std::sin(rise),
                                                                               std::cos(rise) * std::sin(turn));
      const bool expected = within_limits(place, targets, settings);
      ASSERT_EQ(limits.hold(place), expected) << "trial " << trial << " place " << i;
      ++(expected ? inside : outside);
    }
    EXPECT_EQ(limits.hold(weighted_center_m(targets)), within_limits(weighted_center_m(targets), targets, settings));
  }
  EXPECT_GT(inside, 5000);
  EXPECT_GT(outside, 5000);
}

TEST(BrokenLimits, AreThoseOfDistanceAndOfBothElevations) {
  std::vector<TrackedTarget> targets(1);
  targets[0].weight = 1.0;
  MoveSettings settings;
  settings.min_elevation_rad = -0.2, settings.max_elevation_rad = 0.8;
  settings.min_distance_m = 1, settings.max_distance_m = 10;
  const auto broken = [&](double elevation_rad, double distance_m) {
    return broken_limits(distance_m * glm::dvec3(std::cos(elevation_rad), std::sin(elevation_rad), 0), targets,
                         settings);
  };
  for (const double inside_rad : {-0.19, 0.0, 0.79}) {
    EXPECT_FALSE(broken(inside_rad, 5).elevation) << inside_rad;
    EXPECT_FALSE(broken(inside_rad, 5).distance) << inside_rad;
  }
  for (const double outside_rad : {-0.21, 0.81}) EXPECT_TRUE(broken(outside_rad, 5).elevation) << outside_rad;
  for (const double outside_m : {0.9, 10.1}) EXPECT_TRUE(broken(0.0, outside_m).distance) << outside_m;
}

}  // namespace
}  // namespace sightline
