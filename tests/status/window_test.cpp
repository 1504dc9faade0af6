// What `sightline status` and `sightline top` make of a daemon's counters, beside sorted lists and plain arithmetic.
#include "client/status/window.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <sstream>

#include "client/status/status_text.h"

namespace sightline {
namespace {

v1::DurationHistogram histogram_of(const std::vector<double>& durations_us) {
  std::vector<uint64_t> counts(33);
  double sum_us = 0.0;
  for (const double us : durations_us) {
    size_t octave = 0;
    while (std::exp2(octave) < us) ++octave;
    ++counts[octave];
    sum_us += us;
  }
  v1::DurationHistogram histogram;
  for (const uint64_t count : counts) histogram.add_counts(count);
  histogram.set_sum_s(sum_us * 1e-6);
  return histogram;
}

TEST(Window, AQuantileLiesInTheOctaveOfThatOfASortedList) {
  std::mt19937 random(4);
  std::lognormal_distribution<double> durations(6.0, 1.5);
  std::vector<double> all(2000);
  std::generate(all.begin(), all.end(), [&] { return durations(random); });
  const v1::DurationHistogram histogram = histogram_of(all);
  std::sort(all.begin(), all.end());
  for (const double q : {0.01, 0.5, 0.9, 0.99, 1.0}) {
    const double exact = all[static_cast<size_t>(std::ceil(q * 2000.0)) - 1], estimate = quantile_us(histogram, q);
    EXPECT_EQ(std::ceil(std::log2(exact)), std::ceil(std::log2(estimate))) << q << ": " << exact << " " << estimate;
  }
  EXPECT_EQ(quantile_us({}, 0.5), 0.0);
}

TEST(Window, ADifferenceHoldsWhatCameSince) {
  const v1::DurationHistogram earlier = histogram_of({3.0, 100.0}), later = histogram_of({3.0, 100.0, 100.0, 5000.0});
  const v1::DurationHistogram within = difference(later, earlier), expected = histogram_of({100.0, 5000.0});
  EXPECT_TRUE(std::equal(within.counts().begin(), within.counts().end(), expected.counts().begin(), expected.counts().end()));
  EXPECT_NEAR(within.sum_s(), 5100e-6, 1e-12);
}

TEST(Window, RatesAreDifferencesOverTheTimeBetween) {
  v1::GetServerStatsResponse earlier, later;
  earlier.set_uptime_s(10.0), later.set_uptime_s(14.0);
  earlier.set_ticks(100), later.set_ticks(340);
  earlier.set_steps(90), later.set_steps(290);
  earlier.set_merged_ticks(10), later.set_merged_ticks(46);
  later.set_refused_ticks(4);
  later.set_late_steps(50);
  later.set_degraded_steps(20);
  later.set_received_bytes(4096);
  earlier.set_cpu_s(1.0), later.set_cpu_s(7.0);
  const Window window = window_between(earlier, later);
  EXPECT_DOUBLE_EQ(window.seconds, 4.0);
  EXPECT_DOUBLE_EQ(window.ticks_per_s, 60.0);
  EXPECT_DOUBLE_EQ(window.steps_per_s, 50.0);
  EXPECT_DOUBLE_EQ(window.merged_per_s, 9.0);
  EXPECT_DOUBLE_EQ(window.refused_per_s, 1.0);
  EXPECT_DOUBLE_EQ(window.late_share, 0.25);
  EXPECT_DOUBLE_EQ(window.degraded_share, 0.1);
  EXPECT_DOUBLE_EQ(window.received_bytes_per_s, 1024.0);
  EXPECT_DOUBLE_EQ(window.cpus, 1.5);
}

TEST(Window, AStageIsComparedWithTheStageOfItsName) {
  v1::GetServerStatsResponse earlier, later;
  v1::StageHistogram& before = *earlier.add_stages();
  before.set_stage("move");
  *before.mutable_durations() = histogram_of({10.0, 10.0});
  for (const char* name : {"sample", "move"}) {
    v1::StageHistogram& stage = *later.add_stages();
    stage.set_stage(name);
    *stage.mutable_durations() = histogram_of({10.0, 10.0, 40.0});
  }
  const Window window = window_between(earlier, later);
  ASSERT_EQ(window.durations.size(), 5u);
  EXPECT_EQ(window.durations[3].count, 3u);
  EXPECT_EQ(window.durations[4].count, 1u);
  EXPECT_NEAR(window.durations[4].mean_us, 40.0, 1e-9);
}

TEST(StatusText, NamesTheLimitsThatWereHitAndWhatIsMissingInRecordings) {
  v1::GetServerStatsResponse stats;
  v1::LimitCount& limit = *stats.add_limits();
  limit.set_limit("max-sessions");
  limit.set_count(1234);
  stats.mutable_recording()->set_dropped_messages(7);
  std::ostringstream out;
  print_state(out, "here:1", {}, stats);
  EXPECT_NE(out.str().find("--max-sessions 1,234"), std::string::npos) << out.str();
  EXPECT_NE(out.str().find("7 messages lost"), std::string::npos) << out.str();
  EXPECT_NE(out.str().find("not ready"), std::string::npos) << out.str();
}

TEST(StatusText, CountsTheSessionsAtEachLevel) {
  const auto text_of = [](const std::vector<uint32_t>& sessions) {
    v1::GetServerStatsResponse stats;
    for (const uint32_t count : sessions) stats.add_sessions_at_level(count);
    std::ostringstream out;
    print_state(out, "here:1", {}, stats);
    return out.str();
  };
  EXPECT_NE(text_of({4, 0, 1}).find("0: 4, 2: 1"), std::string::npos) << text_of({4, 0, 1});
  EXPECT_EQ(text_of({0, 3}).find("0: 0"), std::string::npos) << text_of({0, 3});
  EXPECT_NE(text_of({0, 3}).find("1: 3"), std::string::npos) << text_of({0, 3});
}

TEST(StatusText, DurationsAreShort) {
  EXPECT_EQ(duration_text(59.9), "59 s");
  EXPECT_EQ(duration_text(3599.0), "59 min 59 s");
  EXPECT_EQ(duration_text(7200.0), "2 h 0 min");
  EXPECT_EQ(duration_text(90000.0), "1 d 1 h");
}

}  // namespace
}  // namespace sightline
