#include "server/schedule/fair_shares.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "server/base/random.h"

namespace sightline {
namespace {

double used(const std::vector<double>& demands, double share) {
  double sum = 0;
  for (const double demand : demands) sum += std::min(demand, share);
  return sum;
}

// The fair share by bisection, from its definition.
double plain_share(const std::vector<double>& demands, double capacity) {
  double low = 0, high = 1e6;
  if (used(demands, high) <= capacity) return std::numeric_limits<double>::infinity();
  for (int i = 0; i < 200; ++i) {
    const double middle = (low + high) / 2;
    (used(demands, middle) <= capacity ? low : high) = middle;
  }
  return low;
}

TEST(FairShare, IsTheLevelAtWhichTheDemandsFillTheCapacity) {
  CounterRandom random(3, 0, RandomPurpose::kTest);
  int overloads = 0;
  for (int round = 0; round < 500; ++round) {
    std::vector<double> demands(random.next_below(40));
    for (double& demand : demands) demand = random.next_below(3) == 0 ? 0.0 : random.next_in(0.0, 0.4);
    const double capacity = random.next_in(0.1, 6.0);
    const double plain = plain_share(demands, capacity);
    overloads += std::isfinite(plain);
    const double share = fair_share(demands, capacity);
    if (std::isfinite(plain))
      EXPECT_NEAR(share, plain, 1e-9);
    else
      EXPECT_EQ(share, plain);
  }
  EXPECT_GT(overloads, 50);
  EXPECT_LT(overloads, 450);
}

constexpr int64_t kRenewed = FairShares::kRenewedEveryNs;

TEST(FairShares, ASmallDemandLeavesTheRestToTheOthers) {
  FairShares shares(1.0);
  const auto light = shares.join("a"), heavy = shares.join("a"), other = shares.join("a");
  shares.report(light, 0.1, false, 0);
  shares.report(heavy, 1.0, false, 1);
  shares.report(other, 1.0, false, 2);
  EXPECT_NEAR(shares.report(heavy, 1.0, false, kRenewed), 0.45, 1e-12);
}

TEST(FairShares, ASessionThatLeavesOrFallsSilentIsForgotten) {
  FairShares shares(1.0);
  const auto a = shares.join("a"), b = shares.join("a");
  shares.report(a, 0.8, false, 0), shares.report(b, 0.8, false, 0);
  EXPECT_NEAR(shares.report(a, 0.8, false, kRenewed), 0.5, 1e-12);
  EXPECT_EQ(shares.report(a, 0.8, false, FairShares::kForgottenAfterNs), std::numeric_limits<double>::infinity());
  shares.report(b, 0.8, false, FairShares::kForgottenAfterNs + 1);
  EXPECT_NEAR(shares.report(a, 0.8, false, FairShares::kForgottenAfterNs + kRenewed), 0.5, 1e-12);
  shares.leave(b);
  EXPECT_EQ(shares.report(a, 0.8, false, FairShares::kForgottenAfterNs + 2 * kRenewed),
            std::numeric_limits<double>::infinity());
  EXPECT_EQ(shares.join("a"), b);  // its place is free
}

// Two sessions whose demands fit the capacity.
class Contended : public testing::Test {
 protected:
  // Takes one renewal period of steps, of which so many are late. Returns the share at its end.
  double renew(int late, int steps = 100) {
    for (int i = 0; i < steps; ++i) share_ = shares_.report(i % 2 ? a_ : b_, 0.4, i < late, now_ns_);
    now_ns_ += kRenewed;
    return share_ = shares_.report(a_, 0.4, false, now_ns_);
  }

  FairShares shares_{1.0};
  const FairShares::Slot a_ = shares_.join("a"), b_ = shares_.join("a");
  int64_t now_ns_ = 0;
  double share_ = 0;
};

TEST_F(Contended, ALateStepNowAndThenChangesNothing) {
  for (int i = 0; i < 1000; ++i) EXPECT_TRUE(std::isinf(renew(i % 3, i % 2 ? 100 : 300)));
}

TEST_F(Contended, LateStepsShrinkTheEstimateWhichThenGrowsAgain) {
  int renewals = 0;
  while (std::isinf(renew(2 * FairShares::kLeastLate))) ASSERT_LT(++renewals, 10);
  EXPECT_LT(share_, 0.4);
  for (int i = 0; i < 10; ++i) renew(2 * FairShares::kLeastLate);
  EXPECT_LT(share_, 0.2);
  double before = share_;
  for (renewals = 0; !std::isinf(renew(0)); ++renewals, before = share_) {
    ASSERT_LT(renewals, 200);
    EXPECT_GT(share_, before);
  }
  EXPECT_GT(renewals, 100) << "slowly";
}

TEST_F(Contended, AHiccupIsForgottenWithinSeconds) {
  renew(100);
  for (int i = 0; i < 25; ++i) renew(0);
  for (const FairShares::Slot slot : {a_, b_}) EXPECT_TRUE(std::isinf(shares_.report(slot, 0.495, false, now_ns_)));
  now_ns_ += kRenewed;
  EXPECT_TRUE(std::isinf(shares_.report(a_, 0.495, false, now_ns_)));
}

// --- clients

// What the sessions of several clients, one of each, may use after the steps of the first one were late so often.
std::vector<double> after_late_renewals(double capacity, const std::vector<double>& demands, int renewals) {
  FairShares shares(capacity);
  std::vector<FairShares::Slot> slots;
  for (size_t i = 0; i < demands.size(); ++i) slots.push_back(shares.join(std::to_string(i)));
  std::vector<double> last(demands.size());
  // In the first period nothing is late, since no demands are known. A period is renewed by its own steps at the start
  // of the next one.
  for (int period = 0; period < renewals + 2; ++period)
    for (int step = 0; step < 4; ++step)
      for (size_t i = 0; i < slots.size(); ++i)
        last[i] = shares.report(slots[i], demands[i], i == 0 && period > 0, period * kRenewed);
  return last;
}

constexpr double kNoLimit = std::numeric_limits<double>::infinity();

TEST(FairShares, AClientThatAsksForMoreThanAnEqualPartPaysForItsLateStepsAlone) {
  // What the second one leaves of two threads is 1.6.
  for (int renewals = 1; renewals < 40; ++renewals) {
    const std::vector<double> shares = after_late_renewals(2.0, {1.5, 0.4}, renewals);
    EXPECT_NEAR(shares[0], 1.6 * std::pow(FairShares::kDecrease, renewals), 1e-9) << renewals;
    EXPECT_EQ(shares[1], kNoLimit);
  }
  const std::vector<double> of_three = after_late_renewals(3.0, {1.2, 0.5, 0.5}, 20);
  EXPECT_NEAR(of_three[0], 2.0 * std::pow(FairShares::kDecrease, 20), 1e-9);
  EXPECT_EQ(of_three[1], kNoLimit);
  EXPECT_EQ(of_three[2], kNoLimit);
}

TEST(FairShares, UpToAnEqualPartAllPayForLateSteps) {
  const std::vector<double> shares = after_late_renewals(2.0, {1.0, 0.8}, 3);
  EXPECT_NEAR(shares[0], 1.2 * std::pow(FairShares::kDecrease, 3), 1e-9);
  EXPECT_NEAR(shares[1], 1.0 * std::pow(FairShares::kDecrease, 3), 1e-9);
}

// One client with a hundred sessions and one with two, on two threads.
class Crowd : public testing::Test {
 protected:
  Crowd() {
    for (int i = 0; i < 100; ++i) many_.push_back(shares_.join("many"));
    for (int i = 0; i < 2; ++i) few_.push_back(shares_.join("few"));
  }
  // One renewal period: each session reports ten steps with this demand.
  void renew(double of_many, double of_few, bool many_late = false, bool few_late = false) {
    for (int step = 0; step < 10; ++step) {
      for (const FairShares::Slot slot : many_) share_of_many_ = shares_.report(slot, of_many, many_late, now_ns_);
      for (const FairShares::Slot slot : few_) share_of_few_ = shares_.report(slot, of_few, few_late, now_ns_);
    }
    now_ns_ += kRenewed;
  }

  FairShares shares_{2.0};
  std::vector<FairShares::Slot> many_, few_;
  int64_t now_ns_ = 0;
  double share_of_many_ = 0, share_of_few_ = 0;
};

TEST_F(Crowd, SessionsDoNotGiveAClientMoreTime) {
  for (int i = 0; i < 3; ++i) renew(1.0, 1.0);
  EXPECT_NEAR(share_of_many_, 0.01, 1e-9) << "half of two threads, divided by a hundred";
  EXPECT_NEAR(share_of_few_, 0.5, 1e-9);
}

TEST_F(Crowd, WhatAClientLeavesOverGoesToTheOthers) {
  for (int i = 0; i < 3; ++i) renew(1.0, 0.1);
  EXPECT_NEAR(share_of_many_, 0.018, 1e-9);
  EXPECT_TRUE(std::isinf(share_of_few_));
}

TEST_F(Crowd, LateStepsOfAGreedyClientLeaveTheOthersAlone) {
  for (int i = 0; i < 40; ++i) renew(1.0, 0.4, true);
  EXPECT_LT(share_of_many_, 0.2 * 0.012) << "its own estimate shrinks";
  EXPECT_TRUE(std::isinf(share_of_few_));
}

TEST_F(Crowd, LateStepsOfOthersShrinkWhatTheyMayUse) {
  for (int i = 0; i < 40; ++i) renew(1.0, 0.4, false, true);
  EXPECT_LT(share_of_few_, 0.2);
  EXPECT_NEAR(share_of_many_, 0.012, 1e-9);
}

TEST_F(Crowd, NothingIsLeftOfAClientThatWent) {
  for (int i = 0; i < 40; ++i) renew(1.0, 0.4, true);
  for (FairShares::Slot& slot : many_) shares_.leave(slot);
  for (FairShares::Slot& slot : many_) slot = shares_.join("others");
  for (int i = 0; i < 3; ++i) renew(1.0, 0.4);
  EXPECT_NEAR(share_of_many_, 0.012, 1e-9);
}

}  // namespace
}  // namespace sightline
