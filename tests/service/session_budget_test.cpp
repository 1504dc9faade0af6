// The memory of instances, and the cost of steps, that one session, one client and all sessions may have.
#include "server/service/session_budget.h"

#include <gtest/gtest.h>

#include <optional>

namespace sightline {
namespace {

using Answer = InstanceMemory::Answer;

TEST(InstanceMemoryTest, RefusesWhatAClientOrAllWouldHaveTooMuchAndChangesNothingThen) {
  InstanceMemory memory(100, 60);
  EXPECT_EQ(memory.change("a", 0, 60), Answer::kDone) << "up to the limit";
  EXPECT_EQ(memory.change("a", 0, 1), Answer::kClientFull);
  EXPECT_EQ(memory.change("b", 0, 41), Answer::kAllFull);
  EXPECT_EQ(memory.change("b", 0, 40), Answer::kDone);
  EXPECT_EQ(memory.change("c", 0, 1), Answer::kAllFull);
}

TEST(InstanceMemoryTest, WhatIsGivenBackIsFree) {
  InstanceMemory memory(100, 60);
  ASSERT_EQ(memory.change("a", 0, 50), Answer::kDone);
  ASSERT_EQ(memory.change("b", 0, 50), Answer::kDone);
  EXPECT_EQ(memory.change("b", 50, 60), Answer::kAllFull);
  EXPECT_EQ(memory.change("a", 50, 20), Answer::kDone);
  EXPECT_EQ(memory.change("b", 50, 60), Answer::kDone);
  EXPECT_EQ(memory.change("a", 20, 0), Answer::kDone);
  EXPECT_EQ(memory.change("a", 0, 40), Answer::kDone);
  EXPECT_EQ(memory.change("a", 40, 40), Answer::kDone) << "no change needs no room";
}

class InstanceShareTest : public testing::Test {
 protected:
  static constexpr size_t kMib = size_t{1} << 20;
  // The limit that is hit, if any.
  std::optional<Limit> hit_by(InstanceShare& share, size_t instances, size_t shape_bytes, size_t state_bytes = 0) {
    const Status changed = share.resize(instances, shape_bytes, state_bytes, "open.instances");
    if (changed) return std::nullopt;
    EXPECT_EQ(changed.error().code, ErrorCode::kResourceExhausted);
    EXPECT_EQ(changed.error().field, "open.instances");
    const std::optional<Limit> named = limit_of(changed.error());
    EXPECT_TRUE(named && counts_.count(*named) == 1) << changed.error().message;
    return named;
  }

  const SessionLimits limits_{.session_bytes = 4 * kMib};
  InstanceMemory memory_{8 * kMib, 6 * kMib};
  LimitCounts counts_;
};

TEST_F(InstanceShareTest, TheStateOfTheStepsCountsToo) {
  InstanceShare share(limits_, &memory_, "a", &counts_), other(limits_, &memory_, "a", &counts_);
  EXPECT_EQ(hit_by(share, 0, kMib, 3 * kMib), std::nullopt);
  EXPECT_EQ(hit_by(share, 0, kMib, 3 * kMib + 1), Limit::kSessionMemory);
  EXPECT_EQ(hit_by(other, 0, 0, 2 * kMib + 1), Limit::kClientMemory);
}

TEST(SessionState, GrowsWithTargetsCandidatesAndTexels) {
  StepSettings settings;
  const size_t two = session_state_bytes(settings, 2);
  EXPECT_GT(two, size_t{800} << 10);
  EXPECT_LT(two, size_t{1100} << 10) << "a session with the default settings and two targets takes 0.9 MiB";
  const size_t of_target = session_state_bytes(settings, 3) - two;
  EXPECT_EQ(session_state_bytes(settings, 32), two + 30 * of_target);
  settings.aggregate.candidates *= 2;
  EXPECT_GT(session_state_bytes(settings, 2), two + of_target);
  settings.sample.resolution = 64;
  EXPECT_GT(session_state_bytes(settings, 2), two + of_target + (size_t{1} << 20));
  // Pair volumes have up to r^3 candidates, and keep the depths of the last steps' maps.
  const size_t of_lattice = session_state_bytes(settings, 2);
  settings.aggregate.volume = Volume::kPair;
  const size_t without = session_state_bytes(settings, 2);
  EXPECT_GT(without, of_lattice + (size_t{64} << 20));
  settings.aggregate.filter.mode = FilterMode::kJoint, settings.aggregate.filter.n = 64;
  EXPECT_EQ(session_state_bytes(settings, 2), without + 64 * 2 * 64 * 64 * sizeof(double));
}

TEST(StepCost, LookUpsOfPairVolumesInTheLastStepsCount) {
  StepSettings settings;
  settings.sample.points = 1, settings.sample.resolution = 64, settings.aggregate.candidates = 27;
  settings.aggregate.volume = Volume::kPair;
  settings.aggregate.filter.mode = FilterMode::kNone;
  const double of_one = step_cost_ms(settings, 32, 0);
  settings.aggregate.filter.mode = FilterMode::kJoint, settings.aggregate.filter.n = 64;
  EXPECT_GT(step_cost_ms(settings, 32, 0), 30 * of_one);
  EXPECT_GT(step_cost_ms(settings, 32, 0), 1000);
  settings = preset_settings(Preset::kPaper);
  EXPECT_LT(step_cost_ms(settings, 2, 0), 5) << "the preset itself";
}

TEST_F(InstanceShareTest, InstancesAndShapesCountTogether) {
  InstanceShare share(limits_, &memory_, "a", &counts_);
  const size_t most = 4 * kMib / kBytesOfInstance;
  EXPECT_EQ(hit_by(share, most, 0), std::nullopt);
  EXPECT_EQ(hit_by(share, most, kBytesOfInstance), Limit::kSessionMemory);
  EXPECT_EQ(hit_by(share, most / 2, 2 * kMib), std::nullopt) << "fewer instances make room for shapes";
}

TEST_F(InstanceShareTest, TheClientAndAllSessionsHaveLimitsOfTheirOwn) {
  InstanceShare a(limits_, &memory_, "a", &counts_), other_of_a(limits_, &memory_, "a", &counts_),
      b(limits_, &memory_, "b", &counts_);
  EXPECT_EQ(hit_by(a, 0, 4 * kMib), std::nullopt);
  EXPECT_EQ(hit_by(other_of_a, 0, 3 * kMib), Limit::kClientMemory);
  EXPECT_EQ(hit_by(other_of_a, 0, 2 * kMib), std::nullopt);
  EXPECT_EQ(hit_by(b, 0, 3 * kMib), Limit::kSessionsMemory);
  EXPECT_EQ(hit_by(b, 0, 2 * kMib), std::nullopt);
}

TEST_F(InstanceShareTest, ASessionThatEndsGivesAllBack) {
  for (int round = 0; round < 3; ++round) {
    InstanceShare share(limits_, &memory_, "a", &counts_);
    EXPECT_EQ(hit_by(share, 100, 3 * kMib), std::nullopt);
  }
  InstanceShare all(limits_, &memory_, "a", &counts_);
  EXPECT_EQ(hit_by(all, 0, 4 * kMib), std::nullopt);
}

TEST(StepCost, GrowsWithTargetsAndSettingsAndIsRefusedAboveTheLimitOnly) {
  StepSettings settings;
  const double one_ms = step_cost_ms(settings, 1);
  EXPECT_GT(one_ms, 0.0);
  EXPECT_DOUBLE_EQ(step_cost_ms(settings, 4), 4 * one_ms);
  std::vector<Target> targets(4);
  EXPECT_TRUE(check_step_cost(settings, targets, {.max_step_cost_ms = 4 * one_ms}, "open.settings"));
  EXPECT_TRUE(check_step_cost(settings, targets, {.max_step_cost_ms = 0.0}, "open.settings")) << "no limit";
  const Status refused = check_step_cost(settings, targets, {.max_step_cost_ms = 3.9 * one_ms}, "open.settings");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().field, "open.settings");
  EXPECT_EQ(limit_of(refused.error()), Limit::kMaxStepCost);
  targets[2].part_ids = {1, 2, 3}, targets[3].part_ids = {4, 5};
  EXPECT_GT(step_cost_ms(settings, 4, 5), 4 * one_ms);
  EXPECT_FALSE(
      check_step_cost(settings, targets, {.max_step_cost_ms = 0.999 * step_cost_ms(settings, 4, 5)}, "open.settings"));
  EXPECT_TRUE(
      check_step_cost(settings, targets, {.max_step_cost_ms = 1.001 * step_cost_ms(settings, 4, 5)}, "open.settings"));
}

}  // namespace
}  // namespace sightline
