#include "server/move/summed_gain.h"

#include <gtest/gtest.h>

#include <limits>

#include "server/base/random.h"

namespace sightline {
namespace {

constexpr double kStepS = 1.0 / 60;

// The time after which a change that always gains so much is made.
double time_to_change_s(double gain_m) {
  SummedGain gain;
  for (int i = 1; i < 6000; ++i)
    if (gain.add(gain_m, kStepS)) return i * kStepS;
  return std::numeric_limits<double>::infinity();
}

TEST(SummedGain, TheMoreAChangeGainsTheSoonerItIsMade) {
  EXPECT_EQ(time_to_change_s(std::numeric_limits<double>::infinity()), kStepS);
  EXPECT_EQ(time_to_change_s(70), kStepS);  // nothing would be seen
  EXPECT_NEAR(time_to_change_s(3), 0.2, 1.5 * kStepS);
  EXPECT_NEAR(time_to_change_s(0.3), 2.0, 1.5 * kStepS);
}

TEST(SummedGain, AChangeThatGainsNothingIsNeverMade) {
  EXPECT_EQ(time_to_change_s(0), std::numeric_limits<double>::infinity());
  EXPECT_EQ(time_to_change_s(-1), std::numeric_limits<double>::infinity());
}

TEST(SummedGain, ALossOfLongAgoDoesNotDelayAChange) {
  for (const double loss_m : {-5.0, -std::numeric_limits<double>::infinity()}) {
    SummedGain gain;
    for (int i = 0; i < 1000; ++i) EXPECT_FALSE(gain.add(loss_m, kStepS));
    EXPECT_EQ(gain.sum_metre_s, 0.0);
    int steps = 0;
    while (!gain.add(3, kStepS)) ASSERT_LT(++steps, 20);
  }
}

TEST(SummedGain, BeginsAgainAfterAChange) {
  SummedGain gain;
  int steps = 1;
  while (!gain.add(3, kStepS)) ASSERT_LT(++steps, 20);
  EXPECT_EQ(gain.sum_metre_s, 0.0);
}

// The costs of two equal courses, with errors of 1 m a step. A camera that compares them step by step changes at every
// second step.
TEST(SummedGain, NoiseHardlyEverChangesTheCourse) {
  constexpr int kMinutes = 60;
  CounterRandom random(7, 0, RandomPurpose::kTest);
  SummedGain gain;
  int changes = 0, gains = 0;
  for (int i = 0; i < 3600 * kMinutes; ++i) {
    const double noise_m = random.next_in(-1, 1) + random.next_in(-1, 1) + random.next_in(-1, 1);
    gains += noise_m > 0;
    changes += gain.add(noise_m, kStepS);
  }
  EXPECT_GT(gains, 1500 * kMinutes);
  EXPECT_LT(changes, 4 * kMinutes);
}

TEST(SummedGain, ASteadyGainTakesAsLongAtAnyRate) {
  for (const double rate_hz : {20.0, 60.0, 240.0}) {
    SummedGain gain;
    double passed_s = 0;
    do passed_s += 1 / rate_hz;
    while (!gain.add(1, 1 / rate_hz));
    EXPECT_NEAR(passed_s, 0.6, 1.5 / rate_hz) << rate_hz;
  }
}

}  // namespace
}  // namespace sightline
