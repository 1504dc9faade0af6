#include "server/receive/fair_shares.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/base/random.h"

namespace sightline {
namespace {

double used(const std::vector<double>& demands, double share) {
  double sum = 0;
  for (const double demand : demands) sum += std::min(demand, share);
  return sum;
}

// By halving, from the definition.
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

TEST(FairShares, WhoAsksForLittleLeavesTheRestToTheOthers) {
  FairShares shares(1.0);
  const auto light = shares.join(), heavy = shares.join(), other = shares.join();
  shares.tell(light, 0.1, 0);
  shares.tell(heavy, 1.0, 1);
  shares.tell(other, 1.0, 2);
  EXPECT_NEAR(shares.tell(heavy, 1.0, kRenewed), 0.45, 1e-12);
}

TEST(FairShares, WhoLeavesOrFallsSilentIsForgotten) {
  FairShares shares(1.0);
  const auto a = shares.join(), b = shares.join();
  shares.tell(a, 0.8, 0), shares.tell(b, 0.8, 0);
  EXPECT_NEAR(shares.tell(a, 0.8, kRenewed), 0.5, 1e-12);
  EXPECT_EQ(shares.tell(a, 0.8, FairShares::kForgottenAfterNs), std::numeric_limits<double>::infinity());
  shares.tell(b, 0.8, FairShares::kForgottenAfterNs + 1);
  EXPECT_NEAR(shares.tell(a, 0.8, FairShares::kForgottenAfterNs + kRenewed), 0.5, 1e-12);
  shares.leave(b);
  EXPECT_EQ(shares.tell(a, 0.8, FairShares::kForgottenAfterNs + 2 * kRenewed),
            std::numeric_limits<double>::infinity());
  EXPECT_EQ(shares.join(), b);  // its place is free
}

}  // namespace
}  // namespace sightline
