// When the quality level of a session changes, and to which level.
#include "server/schedule/step_budget.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numeric>
#include <vector>

#include "server/base/random.h"
#include "server/schedule/step_stats.h"
#include "server/schedule/tick_pace.h"

namespace sightline {
namespace {

constexpr int64_t kMs = 1'000'000;
constexpr int64_t kSecond = 1'000 * kMs;
constexpr int64_t kInterval = 16 * kMs;

// A session at 60 Hz whose steps have a given cost. Open loop: its ticks do not wait for its replies.
struct SteppedSession {
  explicit SteppedSession(const BudgetRules& rules = {}) : budget(rules) {}

  std::array<double, kLowestQualityLevel + 1> relative{1.0, 0.9, 0.7, 0.4, 0.3, 0.2};  // not as expected
  double full_cost_ms = 1.0;
  double share = 1.0;
  bool open_loop = true;
  StepBudget budget;
  int64_t now_ns = 0;
  int changes = 0;

  double cost_ms() const { return full_cost_ms * relative[static_cast<size_t>(budget.level())]; }
  void step(double times = 1.0) {
    const auto cost_ns = static_cast<int64_t>(cost_ms() * times * 1e6);
    now_ns += std::max(kInterval, cost_ns);
    const int before = budget.level();
    budget.stepped({.end_ns = now_ns,
                    .cost_ns = cost_ns,
                    .interval_ns = kInterval,
                    .behind = open_loop && static_cast<double>(cost_ns) > share * kInterval,
                    .share = share});
    changes += budget.level() != before;
  }
  void run(
      int64_t for_ns, const std::function<double()>& times = [] { return 1.0; }) {
    for (const int64_t until_ns = now_ns + for_ns; now_ns < until_ns;) step(times());
  }
  // Computed from the true costs, which the budget has to measure.
  int least_level_that_fits() const {
    const double budget_ms = std::min(share, BudgetRules{}.largest_share) * 16.0;
    for (int level = 0; level <= kLowestQualityLevel; ++level)
      if (full_cost_ms * relative[static_cast<size_t>(level)] <= budget_ms) return level;
    return kLowestQualityLevel;
  }
};

TEST(StepBudget, TheLevelStaysAtZeroWhileTheSessionKeepsUp) {
  SteppedSession session;
  session.full_cost_ms = 10.0;
  session.run(60 * kSecond);
  EXPECT_EQ(session.changes, 0);
}

// Short stalls of the machine: three steps that take six times as long, and are behind their ticks. The expected cost
// is above the budget for about 0.2 s after each.
TEST(StepBudget, SlowStepsNowAndThenChangeNothing) {
  SteppedSession session;
  session.full_cost_ms = 8.0;
  int since_stall = 0;
  session.run(60 * kSecond, [&] { return ++since_stall % 60 < 3 ? 6.0 : 1.0; });
  EXPECT_EQ(session.changes, 0);
}

// 14 ms on average, above the budget of 13.6 ms, although every other step is below it.
TEST(StepBudget, CostsThatAlternateCountByTheirMean) {
  SteppedSession session;
  session.full_cost_ms = 14.0;
  bool slow = false;
  session.run(10 * kSecond, [&] { return (slow = !slow) ? 1.3 : 0.7; });
  EXPECT_GT(session.budget.level(), 0);
}

// Above the budget for long, but the session keeps up with its ticks of 16 ms.
TEST(StepBudget, FallingBehindOnceIsNoOverload) {
  SteppedSession session;
  session.full_cost_ms = 15.0;
  session.run(5 * kSecond);
  session.step(1.2);
  session.run(5 * kSecond);
  EXPECT_EQ(session.changes, 0);
  for (int i = 0; i < 100; ++i) session.step(1.2);
  EXPECT_GT(session.budget.level(), 0);
}

TEST(StepBudget, AShortOverloadChangesNothing) {
  SteppedSession session;
  session.run(5 * kSecond);
  session.full_cost_ms = 40.0;
  session.run(StepBudget::kRaiseAfterNs * 8 / 10);
  session.full_cost_ms = 1.0;
  session.run(5 * kSecond);
  EXPECT_EQ(session.changes, 0);
}

TEST(StepBudget, AClientThatWaitsForItsRepliesIsNeverDegraded) {
  SteppedSession session;
  session.open_loop = false;
  session.full_cost_ms = 60.0;
  session.run(60 * kSecond);
  EXPECT_EQ(session.changes, 0);
}

TEST(StepBudget, ALastingOverloadRaisesTheLevelAsFarAsNeeded) {
  for (const double full_cost_ms : {17.0, 25.0, 38.0, 60.0}) {
    SteppedSession session;
    session.full_cost_ms = full_cost_ms;
    session.run(2 * kSecond);
    EXPECT_GT(session.budget.level(), 0) << full_cost_ms;
    session.run(20 * kSecond);
    // The session keeps up, and leaves out no more than is needed to fit with room to spare.
    EXPECT_LE(session.cost_ms(), 16.0) << full_cost_ms;
    EXPECT_LE(session.budget.level(), session.least_level_that_fits() + 1) << full_cost_ms;
    EXPECT_NEAR(session.budget.full_cost_ns() * 1e-6, full_cost_ms, 0.15 * full_cost_ms);
  }
}

TEST(StepBudget, ACostThatFitsAtNoLevelStaysAtTheLastOne) {
  SteppedSession session;
  session.full_cost_ms = 400.0;
  session.run(20 * kSecond);
  EXPECT_EQ(session.budget.level(), kLowestQualityLevel);
}

TEST(StepBudget, TheShareOfTheThreadLimitsTheCost) {
  SteppedSession session;
  session.full_cost_ms = 10.0;
  session.share = 0.25;
  session.run(20 * kSecond);
  EXPECT_GE(session.budget.level(), session.least_level_that_fits());
  EXPECT_LE(session.cost_ms(), 4.0);
  session.share = 1.0;  // the others are gone
  session.run(20 * kSecond);
  EXPECT_EQ(session.budget.level(), 0);
}

TEST(StepBudget, FullQualityReturnsOnceThereIsTime) {
  SteppedSession session;
  session.full_cost_ms = 60.0;
  session.run(10 * kSecond);
  ASSERT_GT(session.budget.level(), 0);
  session.full_cost_ms = 5.0;
  session.run(20 * kSecond);
  EXPECT_EQ(session.budget.level(), 0);
}

// The cost swings around the budget. When the level fell too early, the next fall waits for longer.
TEST(StepBudget, AtTheEdgeItDoesNotGoToAndFro) {
  SteppedSession session;
  for (int swing = 0; swing < 20; ++swing) {
    session.full_cost_ms = 9.0;  // well below the budget of 13.6 ms
    session.run(2 * kSecond);
    session.full_cost_ms = 17.0;
    session.run(2 * kSecond);
  }
  EXPECT_GT(session.changes, 1);
  EXPECT_LE(session.changes, 12);
}

TEST(StepBudget, ALongTimeWithoutSwingsMakesTheWaitShortAgain) {
  SteppedSession session;
  for (int swing = 0; swing < 20; ++swing) {
    session.full_cost_ms = 9.0;
    session.run(2 * kSecond);
    session.full_cost_ms = 17.0;
    session.run(2 * kSecond);
  }
  ASSERT_GT(session.budget.level(), 0);
  session.full_cost_ms = 9.0;
  session.run(18 * kSecond / 10);
  EXPECT_GT(session.budget.level(), 0) << "the swings have made the wait long";
  session.run(60 * kSecond);
  EXPECT_EQ(session.budget.level(), 0);
  session.full_cost_ms = 17.0;
  session.run(5 * kSecond);
  ASSERT_GT(session.budget.level(), 0);
  session.full_cost_ms = 9.0;
  session.run(18 * kSecond / 10);
  EXPECT_EQ(session.budget.level(), 0);
}

TEST(StepBudget, TheLevelFallsOnlyWithRoomToSpare) {
  SteppedSession session;
  session.full_cost_ms = 17.0;
  session.run(5 * kSecond);
  session.full_cost_ms = 12.5;  // fits into 13.6 ms, but only just
  session.run(60 * kSecond);
  EXPECT_GT(session.budget.level(), 0);
  session.full_cost_ms = 10.0;
  session.run(20 * kSecond);
  EXPECT_EQ(session.budget.level(), 0);
}

TEST(StepBudget, ABudgetSetByHandHoldsForASessionThatKeepsUp) {
  SteppedSession session({.fixed_ns = 2 * kMs});
  session.full_cost_ms = 5.0;
  session.run(20 * kSecond);
  EXPECT_GT(session.budget.level(), 0);
  EXPECT_LE(session.cost_ms(), 2.0);
}

TEST(StepBudget, ASessionThatRefusesIsNeverDegraded) {
  SteppedSession session({.degrade = false, .fixed_ns = kMs});
  session.full_cost_ms = 100.0;
  session.run(20 * kSecond);
  EXPECT_EQ(session.changes, 0);
  EXPECT_NEAR(session.budget.full_cost_ns(), 100.0 * kMs, 1.0 * kMs);
}

TEST(TickPace, IsTheLongerOfWhatIsToldAndWhatIsSeen) {
  const auto paced = [](double told_s, int64_t spacing_ns) {
    TickPace pace;
    for (int i = 0; i < 200; ++i) pace.observe(i * spacing_ns, {.dt_s = told_s});
    return pace.interval_ns();
  };
  EXPECT_EQ(TickPace().interval_ns(), TickPace::kUnknownNs);
  EXPECT_EQ(TickPace().deadline_ns(), 0);
  EXPECT_NEAR(static_cast<double>(paced(1.0 / 60, 0)), 1e9 / 60, 1.0);  // as fast as it goes
  EXPECT_NEAR(static_cast<double>(paced(0.0, 20 * kMs)), 20e6, 1e5);    // paused
  EXPECT_NEAR(static_cast<double>(paced(0.001, 30 * kMs)), 30e6, 1e5);  // slow motion
  EXPECT_EQ(paced(0.0, 0), TickPace::kShortestNs);
  EXPECT_EQ(paced(1e300, 5 * kSecond), TickPace::kLongestNs);
}

TEST(TickPace, AReplyIsDueOneIntervalAfterItsTick) {
  TickPace pace;
  pace.observe(7 * kMs, {.dt_s = 0.01});
  EXPECT_EQ(pace.deadline_ns(), 17 * kMs);
}

TEST(DurationCounts, AnOctaveHoldsWhatIsAtMostItsEnd) {
  DurationCounts counts;
  // On each end of an octave, and just beyond it.
  for (int octave = 0; octave < 31; ++octave) {
    counts.add(int64_t{1000} << octave);
    counts.add((int64_t{1000} << octave) + (int64_t{1} << octave));
  }
  const auto octaves = counts.by_octave();
  EXPECT_EQ(octaves[0], 1u);
  for (size_t k = 1; k < 31; ++k) EXPECT_EQ(octaves[k], 2u) << k;
  EXPECT_EQ(octaves[31], 1u);
  EXPECT_EQ(std::accumulate(octaves.begin(), octaves.end(), uint64_t{0}), counts.count());
}

TEST(SessionCounters, ASessionIsAtOneLevelUntilItEnds) {
  StepStats stats;
  const auto at = [&](size_t level) { return stats.sessions_at_level[level].load(); };
  {
    SessionCounters one(stats), other(stats), never_opened(stats);
    one.opened();
    other.opened();
    EXPECT_EQ(at(0), 2);
    one.at_level(3);
    EXPECT_EQ(at(0), 1);
    EXPECT_EQ(at(3), 1);
    one.closed(4);
    EXPECT_EQ(at(3), 0);
    EXPECT_EQ(stats.closed[4], 1u);
    EXPECT_EQ(stats.opened, 2u);
  }
  EXPECT_EQ(at(0), 0);
}

TEST(SessionCounters, AStepIsTheSumOfItsStages) {
  StepStats stats;
  SessionCounters session(stats);
  session.step({.quality_level = 2,
                .merged_ticks = 3,
                .arrival_ns = 1'000,
                .reply_ns = 5'001'000,
                .queue_ns = 7'000,
                .scene_ns = 1'000'000,
                .stage_ns = {2'000'000, 3'000'000, 4'000'000, 5'000'000}});
  EXPECT_NEAR(stats.step.sum_s(), 15e-3, 1e-9);
  EXPECT_NEAR(stats.tick_age.sum_s(), 5e-3, 1e-9);
  EXPECT_NEAR(stats.stages[0].sum_s(), 1e-3, 1e-9);
  EXPECT_NEAR(stats.stages[4].sum_s(), 5e-3, 1e-9);
  EXPECT_EQ(stats.steps_at_level[2], 1u);
  EXPECT_EQ(stats.merged, 3u);
  // A tick whose arrival is not known has no age.
  session.step({.reply_ns = 9});
  EXPECT_EQ(stats.tick_age.count(), 1u);
  EXPECT_EQ(stats.step.count(), 2u);
}

TEST(DurationCounts, QuantilesAreThoseOfASortedList) {
  CounterRandom random(8, 0, RandomPurpose::kTest);
  DurationCounts counts;
  std::vector<double> sorted_us;
  EXPECT_EQ(counts.quantile_us(0.5), 0.0);
  for (int i = 0; i < 5000; ++i) {
    const double us = std::exp2(random.next_in(1.0, 20.0));
    sorted_us.push_back(us);
    counts.add(static_cast<int64_t>(us * 1e3));
  }
  std::sort(sorted_us.begin(), sorted_us.end());
  EXPECT_EQ(counts.count(), sorted_us.size());
  for (const double q : {0.01, 0.5, 0.9, 0.99, 1.0}) {
    const double exact = sorted_us[static_cast<size_t>(std::ceil(q * 5000)) - 1];
    EXPECT_GE(counts.quantile_us(q), exact * 0.999) << q;
    EXPECT_LE(counts.quantile_us(q), exact * 1.092) << q;
  }
  double sum_us = 0.0;
  for (const double us : sorted_us) sum_us += us;
  EXPECT_NEAR(counts.sum_s(), sum_us * 1e-6, 5000 * 1e-9);
  counts.add(0), counts.add(-5), counts.add(INT64_MAX);  // no size is out of range
  EXPECT_NEAR(counts.sum_s(), sum_us * 1e-6 + 3600.0, 1e-3);
  EXPECT_EQ(counts.count(), sorted_us.size() + 3);
}

}  // namespace
}  // namespace sightline
