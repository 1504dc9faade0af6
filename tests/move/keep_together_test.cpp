// The choice of the targets that are shown together, against every subset tried.
#include "server/move/keep_together.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>
#include <vector>

#include "server/base/random.h"
#include "server/move/framing.h"

namespace sightline {
namespace {

TrackedTarget at(double x, double weight = 1.0, bool required = true) {
  TrackedTarget target;
  target.aim_m = {x, 0, 0};
  target.weight = weight, target.required = required;
  return target;
}

// Targets fit together if they span at most 10 m of the x axis.
bool fit(std::span<const TrackedTarget> targets, double room) {
  double low = 1e9, high = -1e9;
  for (const TrackedTarget& t : targets)
    if (t.steered()) low = std::min(low, t.aim_m.x), high = std::max(high, t.aim_m.x);
  return high - low <= 10 * room;
}

constexpr uint32_t kAllBefore = ~0u;

TEST(KeepTogether, AllAreKeptWhenTheyFit) {
  const std::vector<TrackedTarget> targets = {at(0), at(10), at(500, 0.0), at(5, 2, false)};
  EXPECT_EQ(keep_together(targets, {}, kAllBefore, fit), 0b1011u) << "a target without a weight is none";
  EXPECT_EQ(keep_together({}, {}, kAllBefore, fit), 0u);
  EXPECT_EQ(keep_together(std::vector{at(3)}, {}, kAllBefore, [](auto, double) { return false; }), 1u);
}

TEST(KeepTogether, TheGreatestWeightOfRequiredTargetsIsKeptThenOfOptionalOnes) {
  CounterRandom random(7, 0, RandomPurpose::kTest);
  int gave_up = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    // Clusters that do not overlap, so that the best choice is one of them.
    std::vector<TrackedTarget> targets;
    for (int i = 0; i < 2 + trial % 6; ++i)
      targets.push_back(at(30.0 * std::floor(random.next_in(0, 3)) + random.next_in(0, 8),
                           std::floor(random.next_in(1, 4)), random.next_in(0, 1) < 0.6));
    std::pair<double, double> most{-1, -1};
    for (uint32_t subset = 1; subset < 1u << targets.size(); ++subset) {
      TargetMemory memory;
      if (!fit(only_kept(targets, subset, memory), kRoomToReturn)) continue;
      std::pair<double, double> total{0, 0};
      for (size_t i = 0; i < targets.size(); ++i)
        if (subset >> i & 1u) (targets[i].required ? total.first : total.second) += targets[i].weight;
      most = std::max(most, total);
    }
    const uint32_t kept = keep_together(targets, {}, kAllBefore, fit);
    std::pair<double, double> total{0, 0};
    for (size_t i = 0; i < targets.size(); ++i)
      if (kept >> i & 1u) (targets[i].required ? total.first : total.second) += targets[i].weight;
    EXPECT_EQ(total, most) << trial;
    gave_up += std::popcount(kept) < static_cast<int>(targets.size());
  }
  EXPECT_GT(gave_up, 1000);
}

// Each required target fits together with an optional one that stands before it in the list.
TEST(KeepTogether, RequiredTargetsJoinBeforeOptionalOnes) {
  const std::vector<TrackedTarget> targets = {at(-4, 1, false), at(11, 1, false), at(0), at(7)};
  EXPECT_EQ(keep_together(targets, {}, kAllBefore, fit), 0b1100u);
}

TEST(KeepTogether, OfEqualChoicesTheNearestToTheCameraIsTaken) {
  const std::vector<TrackedTarget> targets = {at(0), at(20)};
  EXPECT_EQ(keep_together(targets, {18, 0, 0}, kAllBefore, fit), 0b10u);
  EXPECT_EQ(keep_together(targets, {3, 0, 0}, kAllBefore, fit), 0b01u);
}

TEST(KeepTogether, TheFormerChoiceHoldsUntilAnotherWeighsMore) {
  std::vector<TrackedTarget> targets = {at(0), at(20)};
  EXPECT_EQ(keep_together(targets, {20, 0, 0}, 0b01, fit), 0b01u);
  EXPECT_EQ(keep_together(targets, {0, 0, 0}, 0b10, fit), 0b10u);
  targets[1].weight = 1.5;
  EXPECT_EQ(keep_together(targets, {0, 0, 0}, 0b01, fit), 0b10u);
}

TEST(KeepTogether, ATargetReturnsOnlyWithRoomToSpare) {
  for (const double apart : {8.0, 8.9, 9.1, 9.9, 10.1}) {
    const std::vector<TrackedTarget> targets = {at(0), at(apart)};
    EXPECT_EQ(keep_together(targets, {}, 0b01, fit), apart < 9 ? 0b11u : 0b01u) << apart;
    EXPECT_EQ(keep_together(targets, {}, 0b11, fit), apart < 10 ? 0b11u : 0b01u) << apart;
  }
}

// ---- fits_picture ----

// The reference turns the camera to many directions and projects the points.
TEST(FitsPicture, AgreesWithAFineSearchOverDirections) {
  CounterRandom random(11, 0, RandomPurpose::kTest);
  const Lens lens;
  int fits = 0, fails = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const glm::dvec3 eye(random.next_in(-3, 3), random.next_in(-1, 3), 10);
    std::vector<TrackedTarget> targets;
    const double spread = random.next_in(1, 12);
    for (int i = 0; i < 2 + trial % 3; ++i) {
      targets.push_back(at(random.next_in(-spread, spread)));
      targets.back().aim_m.y = random.next_in(-2, 2), targets.back().aim_m.z = random.next_in(-4, 4);
    }
    const auto shows_all = [&](double room) {
      Lens narrow = lens;
      narrow.vertical_fov_rad = 2 * std::atan(std::tan(lens.vertical_fov_rad / 2) * room);
      for (double yaw = -1; yaw <= 1; yaw += 0.01)
        for (double pitch = -0.5; pitch <= 0.5; pitch += 0.01) {
          const Pose pose{eye, rotation_from_angles({yaw, pitch, 0})};
          if (std::all_of(targets.begin(), targets.end(),
                          [&](const auto& t) { return in_picture(pose, narrow, t.aim_m); }))
            return true;
        }
      return false;
    };
    const bool got = fits_picture(eye, targets, {}, lens, 1.0, false);
    EXPECT_TRUE(got || !shows_all(0.94)) << trial;
    EXPECT_TRUE(!got || shows_all(1.06)) << trial;
    ++(got ? fits : fails);
  }
  EXPECT_GT(fits, 20);
  EXPECT_GT(fails, 20);
}

TEST(FitsPicture, OnlyRequiredTargetsCountWhereOnlyTheyMust) {
  const std::vector<TrackedTarget> targets = {at(0), at(100, 1.0, false)};
  EXPECT_TRUE(fits_picture({0, 0, 10}, targets, {}, Lens{}, 1.0, true));
  EXPECT_FALSE(fits_picture({0, 0, 10}, targets, {}, Lens{}, 1.0, false));
  const std::vector<TrackedTarget> optional = {at(0, 1.0, false), at(100, 1.0, false)};
  EXPECT_FALSE(fits_picture({0, 0, 10}, optional, {}, Lens{}, 1.0, true));
}

}  // namespace
}  // namespace sightline
