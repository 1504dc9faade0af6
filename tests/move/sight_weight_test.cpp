#include "server/move/sight_weight.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "server/base/random.h"
#include "server/move/coherence.h"

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
    const CoherenceSettings seeing{.responsiveness = 1.0, .predictive_power = 0.0};
    EXPECT_GT(unseen_cost({.world_from_camera = {}, .seen_share = required_hidden}, targets, seeing),
              unseen_cost({.world_from_camera = {}, .seen_share = optional_hidden}, targets, seeing));
  }
}

}  // namespace
}  // namespace sightline
