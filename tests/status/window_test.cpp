// What `sightline status` and `sightline top` make of a daemon's counters, beside sorted lists and plain arithmetic.
#include "client/status/window.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
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

TEST(Window, AQuantileLiesWhereItsShareOfTheOctaveEnds) {
  v1::DurationHistogram histogram;
  for (const uint64_t count : {2, 0, 4, 2}) histogram.add_counts(count);  // up to 1 us, 2 us, 4 us, 8 us
  EXPECT_DOUBLE_EQ(quantile_us(histogram, 0.0), 0.0);
  EXPECT_DOUBLE_EQ(quantile_us(histogram, 0.125), 0.5);
  EXPECT_DOUBLE_EQ(quantile_us(histogram, 0.25), 1.0);
  EXPECT_DOUBLE_EQ(quantile_us(histogram, 0.5), 3.0);
  EXPECT_DOUBLE_EQ(quantile_us(histogram, 0.75), 4.0);
  EXPECT_DOUBLE_EQ(quantile_us(histogram, 0.875), 6.0);
  EXPECT_DOUBLE_EQ(quantile_us(histogram, 1.0), 8.0);
  EXPECT_DOUBLE_EQ(quantile_us(histogram, 7.0), 8.0);
}

TEST(Window, OfADaemonThatDidNothingIsZeros) {
  v1::GetServerStatsResponse stats;
  stats.set_uptime_s(5.0);
  const Window window = window_between(stats, stats);
  EXPECT_GT(window.seconds, 0.0);
  for (const double value : {window.ticks_per_s, window.steps_per_s, window.late_share, window.degraded_share,
                             window.sent_bytes_per_s, window.cpus})
    EXPECT_EQ(value, 0.0);
  ASSERT_EQ(window.durations.size(), 3u);
  for (const DurationRow& row : window.durations) EXPECT_EQ(row.mean_us + row.p50_us + row.p99_us, 0.0) << row.name;
}

TEST(Window, ADifferenceHoldsWhatCameSince) {
  const v1::DurationHistogram earlier = histogram_of({3.0, 100.0}), later = histogram_of({3.0, 100.0, 100.0, 5000.0});
  const v1::DurationHistogram within = difference(later, earlier), expected = histogram_of({100.0, 5000.0});
  EXPECT_TRUE(
      std::equal(within.counts().begin(), within.counts().end(), expected.counts().begin(), expected.counts().end()));
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
  earlier.set_sent_bytes(1000), later.set_sent_bytes(3000);
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
  EXPECT_DOUBLE_EQ(window.sent_bytes_per_s, 500.0);
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

TEST(Cameras, SharesAreOfTheTimeBetween) {
  v1::CameraFigures earlier, later;
  earlier.set_tracking_s(10), later.set_tracking_s(16);
  later.set_partial_view_s(2);
  later.set_seeking_s(0.5), later.set_blocked_s(0.5), later.set_waiting_s(0.5), later.set_lost_s(0.5);
  later.set_holding_s(100);
  earlier.set_target_s(20), later.set_target_s(40);
  earlier.set_shown_s(10), later.set_shown_s(25);
  earlier.set_shot_s(5), later.set_shot_s(13);
  earlier.set_shot_kept_s(5), later.set_shot_kept_s(7);
  earlier.set_worth_s(1), later.set_worth_s(7);
  earlier.set_cuts(2), later.set_cuts(5);
  const CameraShares shares = camera_shares(earlier, later);
  EXPECT_DOUBLE_EQ(shares.seconds, 10.0) << "without the time that had no targets";
  EXPECT_DOUBLE_EQ(shares.tracking, 0.6);
  EXPECT_DOUBLE_EQ(shares.partial, 0.2);
  EXPECT_DOUBLE_EQ(shares.blind, 0.2);
  EXPECT_DOUBLE_EQ(shares.target_seconds, 20.0);
  EXPECT_DOUBLE_EQ(shares.shown, 0.75);
  EXPECT_DOUBLE_EQ(shares.shot_kept, 0.25);
  EXPECT_DOUBLE_EQ(shares.shot_seconds, 8.0);
  EXPECT_DOUBLE_EQ(shares.worth, 0.75);
  EXPECT_EQ(shares.cuts, 3u);
}

TEST(StatusText, ListsTheSessionsThatSeeLeastFirst) {
  std::vector<v1::SessionFigures> sessions;
  const auto add = [&](const char* label, double blind_s, double shown) {
    v1::SessionFigures& session = sessions.emplace_back();
    session.set_label(label);
    session.set_blind_s(blind_s);
    session.mutable_camera()->set_target_s(1.0);
    session.mutable_camera()->set_shown_s(shown);
  };
  add("half", 0, 0.5), add("whole", 0, 1.0), add("short", 1.0, 0.9), add("long", 9.0, 0.9);
  add("no targets", 0, 0.0);
  sessions[4].mutable_camera()->set_target_s(0.0);
  sessions[1].set_label("whole\x1b[2J");
  std::ostringstream out;
  print_sessions(out, sessions);
  const std::string text = out.str();
  EXPECT_LT(text.find("long"), text.find("short")) << text;
  EXPECT_LT(text.find("short"), text.find("half")) << text;
  EXPECT_LT(text.find("half"), text.find("whole")) << text;
  EXPECT_LT(text.find("whole"), text.find("no targets")) << text;
  EXPECT_EQ(text.find('\x1b'), std::string::npos) << "a label is a client's text";
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
  EXPECT_EQ(duration_text(0.0), "0 s");
  EXPECT_EQ(duration_text(59.9), "59 s");
  EXPECT_EQ(duration_text(60.0), "1 min 0 s");
  EXPECT_EQ(duration_text(3540.0), "59 min 0 s");
  EXPECT_EQ(duration_text(3599.0), "59 min 59 s");
  EXPECT_EQ(duration_text(3600.0), "1 h 0 min");
  EXPECT_EQ(duration_text(7200.0), "2 h 0 min");
  EXPECT_EQ(duration_text(82'800.0), "23 h 0 min");
  EXPECT_EQ(duration_text(86'399.0), "23 h 59 min");
  EXPECT_EQ(duration_text(86'400.0), "1 d 0 h");
  EXPECT_EQ(duration_text(90000.0), "1 d 1 h");
  EXPECT_EQ(duration_text(172'799.0), "1 d 23 h");
  EXPECT_EQ(duration_text(100 * 86'400.0 + 82'800.0), "100 d 23 h");
}

TEST(StatusText, TellsAllOfADaemonLineByLine) {
  v1::GetServerInfoResponse info;
  info.set_version("1.2.3"), info.set_sampler("embree"), info.set_renderer("a CPU"), info.set_max_sessions(1000);
  v1::GetServerStatsResponse stats;
  stats.set_ready(true), stats.set_uptime_s(61.0);
  stats.set_open_sessions(3), stats.set_opened_sessions(4567), stats.add_sessions_at_level(3);
  stats.set_blind_sessions(2), stats.set_longest_blind_s(33.25);
  stats.set_kept_sessions(1), stats.set_resumed_sessions(2), stats.set_expired_sessions(3),
      stats.set_refused_resumes(4);
  stats.set_open_connections(5), stats.set_resident_bytes(3 << 20), stats.set_geometry_bytes(512);
  for (const auto& [name, count] : {std::pair("max-sessions", 6), std::pair("max-streams", 7)}) {
    v1::LimitCount& limit = *stats.add_limits();
    limit.set_limit(name), limit.set_count(static_cast<uint64_t>(count));
  }
  v1::AccessStats& access = *stats.mutable_access();
  access.set_refused_calls(8), access.set_failed_handshakes(9), access.set_files_taken_over(10),
      access.set_files_refused(11);
  const auto text_of = [&] {
    std::ostringstream out;
    print_state(out, "here:1", info, stats);
    return out.str();
  };
  const std::string before_recording =
      "sightlined 1.2.3 at here:1: ready, up 1 min 1 s\n"
      "device        embree: a CPU\n"
      "sessions      3 open of 1,000, 4,567 opened since the start\n"
      "streams lost  1 wait for their client; since the start 2 resumed, 3 not in time, 4 refused\n"
      "blind now     2 sessions, for 2 s or longer; the longest that plays, for 33.2 s\n"
      "quality       sessions by level: 0: 3\n"
      "connections   5\n"
      "memory        3.0 MiB, of it geometry 0.5 KiB\n"
      "limits hit    --max-sessions 6, --max-streams 7\n"
      "credentials   8 calls and 9 handshakes refused; changed files: 10 taken over, 11 refused\n"
      "recording     ";
  EXPECT_EQ(text_of(), before_recording + "off\n");
  v1::RecordingStats& recording = *stats.mutable_recording();
  recording.set_open_sessions(2), recording.set_bytes(2048);
  EXPECT_EQ(text_of(), before_recording + "2 sessions, 2.0 KiB written\n");
  recording.set_failing_sessions(1), recording.set_dropped_messages(1);
  EXPECT_EQ(text_of(), before_recording + "2 sessions, 2.0 KiB written, 1 sessions have no file, 1 messages lost\n");
}

TEST(StatusText, TellsAllOfAWindowLineByLine) {
  Window window;
  window.seconds = 2.0, window.ticks_per_s = 60.0, window.steps_per_s = 50.0, window.merged_per_s = 9.0,
  window.refused_per_s = 1.0;
  window.late_share = 0.25, window.degraded_share = 0.125, window.received_bytes_per_s = 2048.0,
  window.sent_bytes_per_s = 3.0 * (1 << 20);
  window.cpus = 1.5;
  window.cameras = {.seconds = 120.0,
                    .tracking = 0.9,
                    .partial = 0.075,
                    .blind = 0.025,
                    .shown = 0.95,
                    .shot_seconds = 100.0,
                    .worth = 0.875,
                    .shot_kept = 0.5,
                    .cuts = 1};
  window.durations = {{.name = "step", .count = 1234, .p50_us = 999.4, .p99_us = 1000.0, .mean_us = 2500.0},
                      {.name = "  sample", .count = 1}};
  std::ostringstream out;
  print_window(out, window);
  EXPECT_EQ(out.str(),
            "ticks/s       60.0: 50.0 answered, 9.0 merged, 1.0 refused\n"
            "steps         25.0 % late, 12.5 % degraded\n"
            "cameras       all targets seen in 90.0 % of the time, not all in 7.5 %, none in 2.5 %; 95.0 % of the "
            "targets shown\n"
            "shots         worth 0.88, kept in 50.0 % of the time, 1 cut\n"
            "bytes/s       2.0 KiB received, 3.0 MiB sent\n"
            "CPUs          1.50 busy\n\n"
            "  time of   count     mean     p50      p99\n"
            "  step      1,234  2.50 ms  999 us  1.00 ms\n"
            "    sample      1     0 us    0 us     0 us\n");
  const nlohmann::ordered_json json = json_of(window);
  EXPECT_EQ(json.at("degraded_share"), 0.125);
  EXPECT_EQ(json.at("cameras").at("shot_kept"), 0.5);
  EXPECT_EQ(json.at("sent_bytes_per_s"), 3.0 * (1 << 20));
  EXPECT_EQ(json.at("durations").at("sample").at("count"), 1);
  EXPECT_EQ(json.at("durations").at("step").at("p50_us"), 999.4);
}

}  // namespace
}  // namespace sightline
