// The load generator: its percentiles, the rule for stable figures, due times, and the outcome of every tick.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <sstream>

#include "client/bench/protocol.h"
#include "client/bench/request_log.h"
#include "client/bench/result.h"
#include "client/bench/schedule.h"
#include "client/bench/world.h"
#include "scenes/hall.h"
#include "server/base/random.h"
#include "server/scene/gltf.h"

namespace sightline {
namespace {

using ::testing::ElementsAre;

// --- percentiles

// The least value that at least a share p of all values does not exceed, by counting.
double plain_percentile(const std::vector<double>& values, double p) {
  double best = std::numeric_limits<double>::infinity();
  for (const double candidate : values) {
    const auto below = std::count_if(values.begin(), values.end(), [&](double v) { return v <= candidate; });
    if (static_cast<double>(below) >= p * static_cast<double>(values.size())) best = std::min(best, candidate);
  }
  return best;
}

TEST(BenchStatistics, PercentilesAreExact) {
  CounterRandom random(1, 0, RandomPurpose::kTest);
  for (const size_t size : {1u, 2u, 3u, 9u, 10u, 99u, 100u, 101u, 1000u, 1777u}) {
    std::vector<double> values;
    for (size_t i = 0; i < size; ++i) values.push_back(std::exp(random.next_in(0.0, 8.0)));
    if (size > 3) values[1] = values[2];
    const Quantiles q = quantiles_of(values);
    EXPECT_EQ(q.count, size);
    EXPECT_EQ(q.p50, plain_percentile(values, 0.5)) << size;
    EXPECT_EQ(q.p90, plain_percentile(values, 0.9)) << size;
    EXPECT_EQ(q.p99, plain_percentile(values, 0.99)) << size;
    EXPECT_EQ(q.p999, plain_percentile(values, 0.999)) << size;
    EXPECT_EQ(q.max, *std::max_element(values.begin(), values.end())) << size;
  }
}

TEST(BenchStatistics, NothingSeenIsNothing) {
  const Quantiles q = quantiles_of({});
  EXPECT_EQ(q.count, 0u);
  EXPECT_EQ(q.max, 0.0);
  EXPECT_EQ(relative_range({}), 0.0);
  EXPECT_EQ(relative_range({0.0, 1.0}), std::numeric_limits<double>::infinity());
}

// --- the stable-window rule

std::vector<Quantiles> series(const std::vector<std::pair<double, double>>& p50_and_p99) {
  std::vector<Quantiles> windows;
  for (const auto& [p50, p99] : p50_and_p99) windows.push_back({.count = 100, .p50 = p50, .p99 = p99});
  return windows;
}

// The first length at which the series is stable; 0: never.
size_t stable_after(const std::vector<Quantiles>& windows) {
  for (size_t n = 0; n <= windows.size(); ++n)
    if (are_stable(std::span(windows).first(n))) return n;
  return 0;
}

TEST(BenchStableRule, ThreeWindowsInARowMustAgree) {
  EXPECT_EQ(stable_after(series({{100, 200}, {100, 200}, {100, 200}})), 3u);
  EXPECT_EQ(stable_after(series({{100, 200}, {100, 200}})), 0u);
  EXPECT_EQ(stable_after(series({{100, 200}, {150, 200}, {100, 200}, {100, 200}, {100, 200}})), 5u);
}

TEST(BenchStableRule, EachFigureHasItsOwnMeasure) {
  EXPECT_EQ(stable_after(series({{100, 200}, {110, 259}, {105, 230}})), 3u) << "10 % and 29.5 %";
  EXPECT_EQ(stable_after(series({{100, 200}, {111, 200}, {100, 200}})), 0u) << "p50 11 % apart";
  EXPECT_EQ(stable_after(series({{100, 200}, {100, 262}, {100, 200}})), 0u) << "p99 31 % apart";
}

TEST(BenchStableRule, ASlowDriftIsNotStable) {
  std::vector<std::pair<double, double>> drift;
  for (int i = 0; i < 20; ++i) drift.emplace_back(100 * std::pow(1.06, i), 200);
  EXPECT_EQ(stable_after(series(drift)), 0u) << "neighbours are 6 % apart, three in a row 12 %";
}

TEST(BenchStableRule, AWindowThatSawNothingAgreesWithNone) {
  auto windows = series({{100, 200}, {100, 200}, {100, 200}});
  for (Quantiles& window : windows) window.count = 0;
  EXPECT_EQ(stable_after(windows), 0u);
}

// --- the schedule

TEST(BenchSchedule, SessionsSendAtTheRateWithTheirPhasesSpreadEvenly) {
  const BenchSchedule schedule({.sessions = 7, .rate_hz = 60.0, .window_s = 2.0, .warm_up_s = 1.0});
  std::vector<int64_t> due;
  for (uint64_t k = 0; k < 300; ++k)
    for (size_t session = 0; session < 7; ++session) due.push_back(schedule.due_ns(BenchPeer::kDaemon, k, session));
  ASSERT_EQ(due.front(), 0);
  for (size_t i = 1; i < due.size(); ++i) EXPECT_NEAR(due[i] - due[i - 1], 1e9 / (60.0 * 7), 1.0) << i;
}

// Checks every tick of both peers by brute force: it lies in the window that it counts in, and never in the other
// peer's turn.
void check_windows(const BenchSchedule::Options& options) {
  const BenchSchedule schedule(options);
  std::map<int, std::set<BenchPeer>> seen;
  for (const BenchPeer peer : {BenchPeer::kDaemon, BenchPeer::kEcho}) {
    if (peer == BenchPeer::kEcho && !options.echo) continue;
    for (uint64_t k = 0; k < 700; ++k) {
      for (size_t session = 0; session < options.sessions; ++session) {
        const int64_t due_ns = schedule.due_ns(peer, k, session);
        const int own = schedule.window_of(k, session);
        for (int window = 0; window < 8; ++window)
          EXPECT_EQ(due_ns >= schedule.begin_ns(peer, window) && due_ns < schedule.end_ns(peer, window), own == window)
              << k << ' ' << session << ' ' << window;
        if (own >= 0) seen[own].insert(peer);
        if (!options.echo) continue;
        const BenchPeer other = peer == BenchPeer::kDaemon ? BenchPeer::kEcho : BenchPeer::kDaemon;
        for (int window = 0; window < 8; ++window)
          EXPECT_FALSE(due_ns >= schedule.begin_ns(other, window) && due_ns < schedule.end_ns(other, window));
      }
    }
  }
  EXPECT_EQ(seen[0].size(), options.echo ? 2u : 1u);
}

TEST(BenchSchedule, EveryTickIsInItsWindow) {
  check_windows({.sessions = 3, .rate_hz = 60.0, .window_s = 1.3, .warm_up_s = 2.0});
  check_windows({.sessions = 1, .rate_hz = 125.0, .window_s = 0.5, .warm_up_s = 0.0});
}

TEST(BenchSchedule, DaemonAndEchoTakeTurns) {
  check_windows({.sessions = 3, .rate_hz = 60.0, .window_s = 1.0, .warm_up_s = 1.0, .echo = true});
}

TEST(BenchSchedule, WithoutAnEchoWindowsFollowEachOtherAfterTheWarmUp) {
  const BenchSchedule schedule({.sessions = 2, .rate_hz = 60.0, .window_s = 2.0, .warm_up_s = 3.0});
  EXPECT_EQ(schedule.begin_ns(BenchPeer::kDaemon, 0), 4'000'000'000) << "whole windows";
  for (int window = 0; window < 5; ++window)
    EXPECT_EQ(schedule.end_ns(BenchPeer::kDaemon, window), schedule.begin_ns(BenchPeer::kDaemon, window + 1));
}

// --- the request log

class RequestLogTest : public testing::Test {
 protected:
  void send(uint64_t first, uint64_t last) {
    for (uint64_t s = first; s <= last; ++s) log_.sent(s, static_cast<int64_t>(s) * 10, static_cast<int>(s));
  }
  std::vector<int64_t> answer(uint64_t sequence, uint32_t merged) {
    settled_.clear();
    log_.answered(sequence, merged, settled_);
    std::vector<int64_t> due;
    for (const SettledTick& tick : settled_) due.push_back(tick.due_ns);
    return due;
  }
  void expect_counts(uint64_t answered, uint64_t merged, uint64_t rejected, uint64_t lost) {
    const TickCounts& counts = log_.counts();
    EXPECT_EQ(counts.answered, answered);
    EXPECT_EQ(counts.merged, merged);
    EXPECT_EQ(counts.rejected, rejected);
    EXPECT_EQ(counts.lost, lost);
  }
  RequestLog log_;
  std::vector<SettledTick> settled_;
};

TEST_F(RequestLogTest, AReplySettlesTheTicksThatItCovers) {
  send(1, 5);
  EXPECT_THAT(answer(1, 0), ElementsAre(10));
  EXPECT_EQ(log_.oldest_pending_ns(), 20);
  EXPECT_THAT(answer(4, 2), ElementsAre(20, 30, 40)) << "merged ones waited as long";
  EXPECT_EQ(settled_.back().window, 4);
  expect_counts(2, 2, 0, 0);
  EXPECT_EQ(log_.oldest_pending_ns(), 50);
}

TEST_F(RequestLogTest, WhatAReplyLeavesOutIsLost) {
  send(1, 5);
  EXPECT_EQ(answer(5, 3).size(), 5u) << "they waited, lost or not";
  expect_counts(1, 3, 0, 1);
}

TEST_F(RequestLogTest, RejectedTicksAreNotMergedOnes) {
  send(1, 3);
  log_.tick_error(2);
  EXPECT_THAT(answer(3, 1), ElementsAre(10, 30));
  expect_counts(1, 1, 1, 0);
}

TEST_F(RequestLogTest, AnAnswerToNothingThatWaitsCountsNothing) {
  send(1, 2);
  EXPECT_TRUE(answer(7, 0).empty());
  EXPECT_THAT(answer(2, 1), ElementsAre(10, 20));
  EXPECT_TRUE(answer(2, 0).empty()) << "a second time";
  log_.tick_error(1);
  expect_counts(1, 1, 0, 0);
}

TEST_F(RequestLogTest, WhatIsGivenUpIsLostAndEverySentTickIsCountedOnce) {
  CounterRandom random(3, 0, RandomPurpose::kTest);
  uint64_t sent = 0, answered = 0;
  for (int round = 0; round < 500; ++round) {
    const uint64_t more = random.next_below(4);
    send(sent + 1, sent + more);
    sent += more;
    if (random.next_below(3) == 0 && sent > answered)
      log_.tick_error(answered + 1 + random.next_below(static_cast<uint32_t>(sent - answered)));
    if (random.next_below(2) == 0) continue;
    answered = std::max(answered, sent - random.next_below(static_cast<uint32_t>(std::min<uint64_t>(sent, 3) + 1)));
    answer(answered, random.next_below(5));
  }
  log_.give_up();
  const TickCounts& counts = log_.counts();
  EXPECT_EQ(log_.oldest_pending_ns(), std::numeric_limits<int64_t>::max());
  EXPECT_EQ(counts.sent, sent);
  EXPECT_EQ(counts.sent, counts.answered + counts.merged + counts.rejected + counts.lost);
  EXPECT_GT(std::min({counts.answered, counts.merged, counts.rejected, counts.lost}), 0u);
}

// --- the figures of a load

MeasuredWindow window_of(std::vector<double> round_trips_us, std::vector<double> steps_us,
                         std::vector<uint64_t> replies) {
  MeasuredWindow window;
  window.daemon.us[static_cast<size_t>(BenchMetric::kRoundTrip)] = std::move(round_trips_us);
  window.daemon.us[static_cast<size_t>(BenchMetric::kStep)] = std::move(steps_us);
  window.replies_by_session = std::move(replies);
  for (const uint64_t one : window.replies_by_session) window.daemon.replies += one;
  return window;
}

BenchJson figures_of(const std::vector<MeasuredWindow>& windows, double window_s) {
  return summarize(windows, {{"sessions", windows.front().replies_by_session.size()}, {"window_s", window_s}});
}

TEST(BenchResult, FiguresAreMediansOverTheWindowsWithTheirSpread) {
  const BenchJson result = figures_of({window_of({10, 20, 30}, {1}, {2, 4}), window_of({40, 50, 60}, {1}, {4, 4}),
                                       window_of({10, 22, 30}, {1}, {3, 3})},
                                      2.0);
  const BenchJson& round_trip = result.at("latency_us").at("round_trip");
  EXPECT_EQ(round_trip.at("count"), 9);
  EXPECT_EQ(round_trip.at("p50").at("median"), 22);
  EXPECT_EQ(round_trip.at("p50").at("min"), 20);
  EXPECT_EQ(round_trip.at("p50").at("max"), 50);
  EXPECT_EQ(result.at("windows").at("p50_range"), 1.5);
  EXPECT_DOUBLE_EQ(result.at("service").at("achieved_hz"), 20 / 12.0);
  EXPECT_EQ(result.at("service").at("least_served_hz"), 9 / 6.0);
  EXPECT_EQ(result.at("service").at("most_served_hz"), 11 / 6.0);
  EXPECT_TRUE(result.at("echo").is_null()) << "none was asked";
}

TEST(BenchResult, TheFloorIsEchoPlusStepOfTheSameWindow) {
  std::vector<MeasuredWindow> windows{window_of({300}, {100}, {1}), window_of({660}, {200}, {1}),
                                      window_of({500}, {300}, {1})};
  const std::vector<double> echoes{100, 400, 100};
  for (size_t i = 0; i < 3; ++i) windows[i].echo.emplace().add(BenchMetric::kRoundTrip, echoes[i]);
  const BenchJson echo = figures_of(windows, 1.0).at("echo");
  EXPECT_EQ(echo.at("floor_us").at("median"), 400);
  EXPECT_DOUBLE_EQ(echo.at("share").at("min"), 1.1);
  EXPECT_DOUBLE_EQ(echo.at("share").at("median"), 1.25);
  EXPECT_DOUBLE_EQ(echo.at("share").at("max"), 1.5);
}

TEST(BenchResult, SharesAreOfAllReportedWindows) {
  std::vector<MeasuredWindow> windows{window_of({10, 20, 30}, {1, 5, 9}, {4}), window_of({40}, {2}, {4})};
  windows[0].daemon.late = 1, windows[0].daemon.degraded = 6;
  const BenchJson service = figures_of(windows, 2.0).at("service");
  EXPECT_DOUBLE_EQ(service.at("late_share"), 1.0 / 4);
  EXPECT_DOUBLE_EQ(service.at("degraded_share"), 6.0 / 8);
}

TEST(BenchResult, TheDaemonsCpuTimeIsKnownOnlyWhenItIsKnownInEveryWindow) {
  std::vector<MeasuredWindow> windows{window_of({10}, {1}, {1}), window_of({10}, {1}, {1})};
  windows[0].daemon_cpu_us = 77;
  EXPECT_TRUE(figures_of(windows, 1.0).at("cpu_us_per_tick").at("daemon").is_null());
  windows[1].daemon_cpu_us = 79;
  EXPECT_EQ(figures_of(windows, 1.0).at("cpu_us_per_tick").at("daemon").at("max"), 79);
}

TEST(BenchResult, BytesAreMeansOfAMessage) {
  std::vector<MeasuredWindow> windows{window_of({10}, {1}, {4}), window_of({40}, {2}, {6})};
  for (MeasuredWindow& window : windows)
    window.daemon.add(BenchMetric::kSend, 1.0), window.daemon.add(BenchMetric::kSend, 2.0);
  windows[0].daemon.tick_bytes = 100, windows[1].daemon.tick_bytes = 300;
  windows[0].daemon.reply_bytes = 1000, windows[1].daemon.reply_bytes = 2000;
  const BenchJson bytes = figures_of(windows, 2.0).at("message_bytes");
  EXPECT_DOUBLE_EQ(bytes.at("tick"), 100.0) << "of four ticks";
  EXPECT_DOUBLE_EQ(bytes.at("reply"), 300.0) << "of ten replies";
}

// What a person reads, of figures that need no rounding.
TEST(BenchResult, IsPrintedWhole) {
  std::vector<MeasuredWindow> windows{window_of({100, 200, 20'000}, {50}, {60}),
                                      window_of({100, 200, 20'000}, {50}, {60})};
  for (MeasuredWindow& window : windows) {
    window.daemon.add(BenchMetric::kSend, 1.0);
    window.daemon.tick_bytes = 120, window.daemon.reply_bytes = 60 * 80, window.daemon.late = 1;
    window.daemon_cpu_us = 300.0, window.generator_cpu_us = 40.0;
    window.echo.emplace().add(BenchMetric::kRoundTrip, 110.0);
  }
  BenchJson result = summarize(windows, {{"sessions", 1},
                                         {"rate_hz", 60.0},
                                         {"targets", 2},
                                         {"moving", 3},
                                         {"instances", 4},
                                         {"triangles", 5},
                                         {"sampler", "embree"},
                                         {"channels", 2},
                                         {"address", "here:1"},
                                         {"window_s", 1.0}});
  result["stable"] = true;
  result["windows"]["seen"] = 7;
  result["ticks"] = {{"sent", 130}, {"answered", 125}, {"merged", 3}, {"rejected", 2}, {"lost", 0}};
  result["trouble"] = "";
  result["daemon_memory"] = {
      {"start_bytes", 1 << 20}, {"scene_bytes", 2 << 20}, {"sessions_bytes", 3 << 20}, {"per_session_bytes", nullptr}};
  const auto printed = [&] {
    std::ostringstream out;
    print_bench(result, out);
    return out.str();
  };
  const std::string text = printed();
  EXPECT_TRUE(text.starts_with(
      "1 session at 60 Hz, 2 targets, 3 moving of 4 instances, 5 triangles, sampler embree, 2 channels to here:1\n"
      "stable: 2 windows of 1.0 s, of 7 seen; their p50 lie 0 %, their p99 0 % apart\n\n"))
      << text;
  for (const char* line :
       {"\n  round_trip   200 us  20.0 ms  20.0 ms  20.0 ms  20.0 ms  200 us .. 200 us\n",
        "\n\nreplies       60.00 a second and session of 60.00 wanted; least served 60.00, most 60.00\n"
        "late          33.33 % of the ticks took longer than the tick interval of 16.7 ms\n"
        "degraded      0.00 % of the replies\n"
        "whole run     130 ticks sent: 125 answered, 3 merged, 2 rejected, 0 lost\n"
        "messages      tick 120 bytes, reply 80 bytes\n"
        "CPU a tick    daemon 300 us, generator 40.0 us\n"
        "daemon memory 1.0 MiB at first, 2.0 MiB with scene and one session, 3.0 MiB with all\n"
        "echo          p50 110 us (110 us .. 110 us), p99 110 us\n"
        "against echo  round trip p50 200 us, echo p50 + step p50 160 us: 1.25 x (1.25 .. 1.25), over the 1.20 x that "
        "is wanted\n"})
    EXPECT_NE(text.find(line), std::string::npos) << line << "is not in\n" << text;
  EXPECT_EQ(text.find("trouble"), std::string::npos);
  result["trouble"] = "the daemon sneezed", result["stable"] = false;
  result["daemon_memory"]["per_session_bytes"] = 1 << 19;
  EXPECT_NE(printed().find("\ntrouble       the daemon sneezed\n"), std::string::npos);
  EXPECT_NE(printed().find("\nNOT STABLE: "), std::string::npos);
  EXPECT_NE(printed().find(" with all; 0.5 MiB a further session\n"), std::string::npos);
}

// --- the messages

grpc::ByteBuffer bytes_of(const std::string& text) {
  const grpc::Slice slice(text);
  return {&slice, 1};
}

BenchAnswer answer_to(const BenchProtocol& protocol, const v1::ControlResponse& response) {
  grpc::ByteBuffer message = bytes_of(response.SerializeAsString());
  return protocol.read(message);
}

TEST(BenchProtocolTest, AnswersAreToldApart) {
  const std::vector<std::byte> hall = scenes::make_hall({});
  const auto world = BenchWorld::make(hall, {.targets = 1});
  ASSERT_TRUE(world);
  const BenchProtocol protocol = control_protocol(*world, 0, world->open(0, "hash"));
  v1::ControlResponse opened, camera, rejection, drain;
  opened.mutable_opened()->set_sampler("embree"), opened.mutable_opened()->set_instance_count(3),
      opened.mutable_opened()->set_triangle_count(4);
  const BenchAnswer first = answer_to(protocol, opened);
  EXPECT_EQ(first.kind, BenchAnswer::Kind::kOpened);
  EXPECT_EQ(first.opened.sampler, "embree");
  v1::CameraReply& reply = *camera.mutable_camera();
  reply.set_sequence(9), reply.set_merged_ticks(2), reply.mutable_flags()->set_degraded(true);
  reply.mutable_stage_times()->set_queue_us(1), reply.mutable_stage_times()->set_move_us(6),
      reply.mutable_stage_times()->set_total_us(7);
  const BenchAnswer second = answer_to(protocol, camera);
  EXPECT_EQ(second.kind, BenchAnswer::Kind::kReply);
  EXPECT_EQ(second.sequence, 9u);
  EXPECT_EQ(second.merged, 2u);
  EXPECT_TRUE(second.degraded);
  ASSERT_TRUE(second.stages_us);
  EXPECT_THAT(*second.stages_us, ElementsAre(1, 0, 0, 0, 0, 6, 7));
  rejection.mutable_tick_error()->set_sequence(5), rejection.mutable_tick_error()->set_message("wrong");
  const BenchAnswer third = answer_to(protocol, rejection);
  EXPECT_EQ(third.kind, BenchAnswer::Kind::kRejection);
  EXPECT_EQ(third.sequence, 5u);
  EXPECT_NE(third.trouble.find("wrong"), std::string::npos);
  drain.mutable_drain()->set_reason("enough");
  EXPECT_EQ(answer_to(protocol, drain).kind, BenchAnswer::Kind::kOther);
  EXPECT_EQ(answer_to(protocol, drain).trouble, "the server is going away: enough");
  grpc::ByteBuffer noise = bytes_of("\xff\xff\xff");
  EXPECT_EQ(protocol.read(noise).trouble, "a reply that is no ControlResponse");
}

TEST(BenchProtocolTest, AnEchoIsAsLongAsTheTickAndHasAHeader) {
  const BenchProtocol protocol = echo_protocol([] { return MessageSizes{.tick = 100, .reply = 50}; });
  grpc::ByteBuffer message;
  protocol.write_tick(7, message);
  EXPECT_EQ(message.Length(), 100u);
  ASSERT_TRUE(read_echo(message));
  EXPECT_EQ(read_echo(message)->sequence, 7u);
  EXPECT_EQ(read_echo(message)->reply_bytes, 50u);
  EXPECT_EQ(protocol.read(message).sequence, 7u);
  EXPECT_EQ(protocol.read(message).kind, BenchAnswer::Kind::kReply);
  for (const size_t size : {size_t{0}, size_t{1}, sizeof(EchoHeader) - 1}) {
    grpc::ByteBuffer shorter = bytes_of(std::string(size, 'x'));
    EXPECT_FALSE(read_echo(shorter)) << size;
    EXPECT_EQ(protocol.read(shorter).trouble, "an echo without a header") << size;
  }
  EXPECT_TRUE(read_echo(bytes_of(std::string(sizeof(EchoHeader), 'x'))));
}

// --- the world

BenchWorld world_of(const std::vector<std::byte>& scene, const BenchWorldOptions& options) {
  auto world = BenchWorld::make(scene, options);
  if (!world) throw std::runtime_error(to_string(world.error()));
  return std::move(*world);
}

v1::Tick tick_of(const BenchWorld& world, size_t session, uint64_t sequence) {
  v1::Tick tick;
  world.fill_tick(session, sequence, tick);
  return tick;
}

class BenchWorldTest : public testing::Test {
 protected:
  const std::vector<std::byte> hall_ = scenes::make_hall({});
};

TEST_F(BenchWorldTest, TheScenesOwnTargetsWalkItsWay) {
  GeometryStore store;
  const auto scenario = Scenario::from_asset(*read_gltf(hall_, nullptr, store));
  ASSERT_TRUE(scenario);
  const BenchWorld world = world_of(hall_, {.targets = 2, .rate_hz = 30.0});
  for (const uint64_t sequence : {1u, 2u, 31u, 100u}) {
    const v1::Tick tick = tick_of(world, 0, sequence);
    const double time_s = static_cast<double>(sequence - 1) / 30.0;
    EXPECT_NEAR(tick.time_s(), time_s, 1e-12);
    const std::vector<Pose> poses = scenario->poses_at(time_s);
    ASSERT_EQ(tick.transforms().ids_size(), 2);
    for (int i = 0; i < 2; ++i) {
      const auto id = tick.transforms().ids(i);
      for (int axis = 0; axis < 3; ++axis)
        EXPECT_NEAR(tick.transforms().positions(3 * i + axis), poses[id - 1].position_m[axis], 1e-6);
    }
  }
}

TEST_F(BenchWorldTest, AtTheEndOfTheWayTheyTurnBackWithoutAJump) {
  const BenchWorld world = world_of(hall_, {.targets = 1, .rate_hz = 60.0});
  v1::Tick before = tick_of(world, 0, 1);
  double farthest_m = 0.0;
  for (uint64_t sequence = 2; sequence < 60 * 90; ++sequence) {
    const v1::Tick tick = tick_of(world, 0, sequence);
    double way_m2 = 0.0;
    for (int axis = 0; axis < 3; ++axis) {
      const double step_m = tick.transforms().positions(axis) - before.transforms().positions(axis);
      EXPECT_NEAR(tick.transforms().velocities(axis), step_m * 60.0, 1e-3) << sequence;
      way_m2 += step_m * step_m;
    }
    farthest_m = std::max(farthest_m, std::sqrt(way_m2));
    before = tick;
  }
  EXPECT_GT(farthest_m, 0.0);
  EXPECT_LT(farthest_m, 0.2) << "12 m/s";
}

TEST_F(BenchWorldTest, BoxesThatMoveCircleAndTheOthersAreSentOnlyOnce) {
  const BenchWorld world = world_of(hall_, {.targets = 2, .moving = 5, .instances = 12, .rate_hz = 60.0});
  const v1::OpenSession open = world.open(0, "hash");
  EXPECT_EQ(open.instances_size(), 12);
  EXPECT_EQ(open.scene().hash(), "hash");
  v1::Tick tick = tick_of(world, 0, 1);
  ASSERT_EQ(tick.transforms().ids_size(), 2 + 5);
  std::vector<glm::dvec3> first;
  const auto box = [&](int i) {
    const double* p = tick.transforms().positions().data() + 3 * (2 + i);
    return glm::dvec3(p[0], p[1], p[2]);
  };
  for (int i = 0; i < 5; ++i) {
    first.push_back(box(i));
    const auto& start = open.instances(i).pose().position();
    EXPECT_EQ(open.instances(i).id(), tick.transforms().ids(2 + i));
    EXPECT_EQ(first.back(), glm::dvec3(start.x(), start.y(), start.z()));
  }
  world.fill_tick(0, 31, tick);
  for (int i = 0; i < 5; ++i) {
    EXPECT_GT(glm::distance(box(i), first[static_cast<size_t>(i)]), 0.2) << "half a second at 0.8 m/s and more";
    EXPECT_LT(glm::distance(box(i), first[static_cast<size_t>(i)]), 1.1);
    EXPECT_EQ(box(i).y, first[static_cast<size_t>(i)].y);
  }
}

TEST_F(BenchWorldTest, MoreTargetsThanTheSceneHasWalkBesideThem) {
  const BenchWorld world = world_of(hall_, {.targets = 8});
  const v1::OpenSession open = world.open(0, "hash");
  EXPECT_EQ(open.targets_size(), 8);
  EXPECT_EQ(open.instances_size(), 6);
  for (int i = 0; i < 6; ++i) EXPECT_EQ(open.targets(2 + i).id(), open.instances(i).id()) << "after the scene's own";
  const v1::Tick early = tick_of(world, 0, 1), late = tick_of(world, 0, 121);
  std::set<uint64_t> ids;
  for (int i = 0; i < 8; ++i) {
    ids.insert(early.transforms().ids(i));
    EXPECT_NE(early.transforms().positions(3 * i), late.transforms().positions(3 * i)) << i;
  }
  EXPECT_EQ(ids.size(), 8u);
}

TEST_F(BenchWorldTest, FewerTargetsThanTheSceneHasAreItsFirst) {
  EXPECT_EQ(world_of(hall_, {.targets = 1}).open(0, "hash").targets_size(), 1);
}

TEST_F(BenchWorldTest, TheSameSeedIsTheSameLoadAndSessionsDiffer) {
  const BenchWorldOptions options{.targets = 3, .moving = 4, .instances = 6, .sessions = 3, .seed = 7};
  const BenchWorld one = world_of(hall_, options), other = world_of(hall_, options);
  for (size_t session = 0; session < 3; ++session) {
    EXPECT_EQ(one.open(session, "h").SerializeAsString(), other.open(session, "h").SerializeAsString());
    EXPECT_EQ(tick_of(one, session, 77).SerializeAsString(), tick_of(other, session, 77).SerializeAsString());
  }
  EXPECT_NE(tick_of(one, 0, 77).SerializeAsString(), tick_of(one, 1, 77).SerializeAsString());
}

TEST_F(BenchWorldTest, ATickThatIsFilledAgainIsTheTickFilledAnew) {
  const BenchWorld world = world_of(hall_, {.targets = 3, .moving = 4, .instances = 6});
  v1::Tick kept;
  for (const uint64_t sequence : {1u, 2u, 500u, 3u}) {
    world.fill_tick(0, sequence, kept);
    EXPECT_EQ(kept.SerializeAsString(), tick_of(world, 0, sequence).SerializeAsString());
  }
}

TEST(BenchWorld, AFileThatIsNoSceneIsAnError) {
  const std::vector<std::byte> none(20);
  EXPECT_FALSE(BenchWorld::make(none, {}));
}

}  // namespace
}  // namespace sightline
