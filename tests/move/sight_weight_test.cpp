#include "server/move/sight_weight.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "server/base/random.h"

namespace sightline {
namespace {

// Targets of weights from a millionth to a million, some switched off.
std::vector<TrackedTarget> any_targets(CounterRandom& random) {
  std::vector<TrackedTarget> targets(1 + random.next_below(32));
  for (TrackedTarget& target : targets) {
    target.weight = random.next_below(8) == 0 ? 0.0 : std::pow(10.0, random.next_in(-6, 6));
    target.required = random.next_below(2) == 0;
  }
  return targets;
}

TEST(SightWeight, AllOptionalTargetsTogetherCountATenthOfTheLightestRequiredOneAtMost) {
  CounterRandom random(23, 0, RandomPurpose::kTest);
  int mixed = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const std::vector<TrackedTarget> targets = any_targets(random);
    const double share = optional_share(targets);
    double lightest = std::numeric_limits<double>::infinity(), optional = 0;
    for (const TrackedTarget& target : targets) {
      if (!target.required) optional += sight_weight(target, share);
      if (!target.required || !target.steered()) continue;
      EXPECT_EQ(sight_weight(target, share), target.weight);
      lightest = std::min(lightest, target.weight);
    }
    EXPECT_GT(share, 0.0);
    if (std::isinf(lightest)) {
      EXPECT_EQ(share, 1.0);
      continue;
    }
    EXPECT_LE(optional, 0.1 * lightest * (1 + 1e-12));
    EXPECT_LE(share, 0.1);
    mixed += optional > 0;
  }
  EXPECT_GT(mixed, 1000);
}

TEST(SightWeight, TargetsOfLittleWeightHardlyCount) {
  using Weights = std::vector<double>;
  EXPECT_EQ(effective_count({}), 0.0);
  EXPECT_EQ(effective_count(Weights{0, 0}), 0.0);
  EXPECT_DOUBLE_EQ(effective_count(Weights{3}), 1.0);
  EXPECT_DOUBLE_EQ(effective_count(Weights{0.5, 0.5, 0, 0.5}), 3.0);
  EXPECT_DOUBLE_EQ(effective_count(Weights{2, 1}), 1.8);
  EXPECT_NEAR(effective_count(Weights{1, 1, 0.01, 0.01, 0.01}), 2.0, 0.07);
}

TEST(SightWeight, APartOfOneOfSeveralTargetsCountsAsMuchAsWithTwo) {
  EXPECT_EQ(several_factor(0), 1.0);
  EXPECT_EQ(several_factor(1), 1.0);
  for (const double count : {2.0, 3.0, 4.5, 6.0}) EXPECT_DOUBLE_EQ(several_factor(count) / count, 1.0 / 2) << count;
  EXPECT_EQ(several_factor(32), 3.0) << "bounded";
}

// From one candidate a single required target is hidden, from the other all optional ones are.
TEST(SightWeight, NoWeightOfOptionalTargetsMakesUpForARequiredOne) {
  CounterRandom random(24, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 2000; ++trial) {
    std::vector<TrackedTarget> targets = any_targets(random);
    targets[0].required = true, targets[0].weight = std::pow(10.0, random.next_in(-6, 6));
    std::vector<float> required_hidden(targets.size(), 1.0f), optional_hidden(targets.size(), 1.0f);
    required_hidden[0] = 0.0f;
    for (size_t i = 0; i < targets.size(); ++i)
      if (!targets[i].required) optional_hidden[i] = 0.0f;
    EXPECT_GT(hidden_share(targets, required_hidden), hidden_share(targets, optional_hidden));
  }
}

TEST(SightWeight, TheHiddenShareIsAMeanByWeight) {
  std::vector<TrackedTarget> targets(3);
  targets[0].weight = 2, targets[1].weight = 1, targets[2].weight = 0;
  const std::vector<float> seen{0.75f, 0.5f, 0.0f};
  EXPECT_DOUBLE_EQ(hidden_share(targets, seen), (2 * 0.25 + 0.5) / 3);
  targets[1].required = false;
  EXPECT_DOUBLE_EQ(hidden_share_by_weight(targets, seen), (2 * 0.25 + 0.5) / 3);
  EXPECT_DOUBLE_EQ(hidden_share(targets, seen), (2 * 0.25 + 0.1 * 0.5) / 2.1) << "an optional one counts a tenth";
  for (TrackedTarget& target : targets) target.weight = 0;
  EXPECT_EQ(hidden_share(targets, seen), 0);
}

TEST(SightWeight, TheSamePartOfOneTargetIsGoodEnoughHoweverManyThereAre) {
  EXPECT_EQ(good_enough_share(0.15, 1), 0.15);
  EXPECT_EQ(good_enough_share(0.15, 2), 0.15);
  for (const double count : {2.0, 3.0, 4.0, 8.0, 32.0})
    EXPECT_DOUBLE_EQ(good_enough_share(0.15, count) * count, 0.15 * 2);
}

TEST(PictureLoss, OfTwoTargetsAPartOfOneIsHalfOfIt) {
  EXPECT_EQ(picture_loss(0.0, 2), 0.0);
  EXPECT_DOUBLE_EQ(picture_loss(0.25, 2), 0.5 * 0.25 + 0.5) << "half of one is hidden";
  EXPECT_DOUBLE_EQ(picture_loss(0.125, 2), 0.5 * 0.125 + 0.5 * 0.5) << "a quarter of one";
  EXPECT_DOUBLE_EQ(picture_loss(0.5, 1), 0.5 * 0.5 + 0.5) << "half of the only one";
  EXPECT_EQ(picture_loss(1.0, 2), 1.0);
}

TEST(PictureLoss, OfManyTargetsAPartCountsLess) {
  EXPECT_DOUBLE_EQ(picture_loss(0.25, 4), 0.875 * 0.25 + 0.125);
  EXPECT_NEAR(picture_loss(0.25, 100), 0.25, 1e-3);
}

TEST(PictureLoss, GrowsWithTheHiddenShareAndStaysAShare) {
  for (double count = 0; count <= 32; count += 0.25) {
    double former = -1;
    for (double hidden = 0; hidden <= 1; hidden += 1.0 / 64) {
      const double loss = picture_loss(hidden, count);
      EXPECT_GT(loss, former) << count << " " << hidden;
      EXPECT_GE(loss, hidden);
      EXPECT_LE(loss, 1.0);
      former = loss;
    }
  }
}

// All optional targets together are a tenth of a required one.
TEST(PictureLoss, AnOptionalTargetHardlyCounts) {
  const double weights[] = {1.0, 0.1};
  EXPECT_LT(picture_loss(0.1 / 1.1, effective_count(weights)), 0.2 * picture_loss(1.0 / 1.1, effective_count(weights)));
}

}  // namespace
}  // namespace sightline
