// A session without a transport: what one turn does with its messages.
#include "server/service/session_driver.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/service/service_world.h"

namespace sightline {
namespace {

class SessionDriverTest : public testing::Test {
 protected:
  void send(const v1::OpenSession& open) {
    v1::ControlRequest request;
    *request.mutable_open() = open;
    turn.messages.push_back({request, 0, 0});
  }
  void send(const v1::Tick& tick) {
    v1::ControlRequest request;
    *request.mutable_tick() = tick;
    turn.messages.push_back({request, 0, 0});
  }
  // Runs a whole turn. Returns true when a step was taken.
  bool run() {
    TakeJob job = driver.plan(turn);
    if (!job.requests.empty()) device.take_all(std::span(&job, 1));
    return driver.finish(turn, {.status = job.taken, .trouble = nullptr});
  }
  void open() {
    send(open_with_boxes(2));
    run();
    ASSERT_EQ(turn.replies.size(), 1u);
    ASSERT_TRUE(turn.replies.front().has_opened());
  }

  GeometryStore geometry;
  ExtentCache extents;
  SceneLibrary scenes{"", GltfLimits{}, geometry};
  GatedDevice device;
  Scheduler scheduler{1, device, [] { return int64_t{0}; }};
  WorkerPool loaders{1}, uploaders{1};
  StreamRegistry streams{1};
  FairShares shares{1.0};
  StepStats stats;
  SessionTable sessions;
  Log log{LogFormat::kText, LogLevel::kOff};
  static inline int64_t used_ns = 0, a_look_ns = 0;  // of the processor, by the clock of loads
  static WorkLimit::Rules load_rules() {
    return {.clock = [] { return used_ns += a_look_ns; },
            .most_ns = 1'000'000'000,
            .refusal = "takes too long (--max-load-s)"};
  }
  ServiceParts parts_with_load() {
    ServiceParts all{scenes,
                     geometry,
                     extents,
                     device,
                     scheduler,
                     loaders,
                     uploaders,
                     streams,
                     shares,
                     stats,
                     sessions,
                     log,
                     [] { return int64_t{0}; },
                     "test"};
    all.load = load_rules();
    return all;
  }
  const ServiceParts parts{scenes,
                           geometry,
                           extents,
                           device,
                           scheduler,
                           loaders,
                           uploaders,
                           streams,
                           shares,
                           stats,
                           sessions,
                           log,
                           [] { return int64_t{0}; },
                           "test"};
  SessionDriver driver{parts, "test-1"};
  SessionDriver::Turn turn;
};

TEST_F(SessionDriverTest, ATurnAppliesAllTicksAndTakesOneStepForTheNewest) {
  open();
  for (uint64_t i = 1; i <= 3; ++i) send(move_tick(i, 1, 0.1 * static_cast<double>(i)));
  EXPECT_TRUE(run());
  ASSERT_EQ(turn.replies.size(), 1u);
  EXPECT_EQ(turn.replies.front().camera().sequence(), 3u);
  EXPECT_EQ(turn.replies.front().camera().merged_ticks(), 2u);
  EXPECT_TRUE(turn.messages.empty());
  EXPECT_EQ(stats.steps, 1u);
  EXPECT_TRUE(driver.status_after_last_message().ok());
}

TEST_F(SessionDriverTest, TicksThatAskToBeMergedWaitForTheNextTurn) {
  open();
  send(move_tick(1, 1, 0.1));
  v1::Tick merged = move_tick(2, 1, 0.2);
  merged.mutable_step_control()->set_merge_into_next(true);
  send(merged);
  EXPECT_TRUE(run());
  EXPECT_EQ(turn.replies.front().camera().sequence(), 1u);
  EXPECT_EQ(turn.messages.size(), 1u);
  EXPECT_FALSE(run());  // it is applied, but nothing is answered
  EXPECT_TRUE(turn.replies.empty());
  EXPECT_TRUE(turn.messages.empty());
}

TEST_F(SessionDriverTest, AFirstMessageThatIsNotOpenEndsTheCall) {
  send(move_tick(1, 1, 0.1));
  EXPECT_FALSE(run());
  ASSERT_TRUE(turn.end);
  EXPECT_EQ(turn.end->error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_FALSE(driver.opened());
  EXPECT_EQ(driver.status_after_last_message().error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(SessionDriverTest, AnExceptionOfTheSamplerEndsTheSession) {
  open();
  send(move_tick(1, 1, 0.1));
  driver.plan(turn);
  driver.finish(turn, {.status = {}, .trouble = std::make_exception_ptr(std::runtime_error("thrown by a test"))});
  ASSERT_TRUE(turn.end);
  EXPECT_EQ(turn.end->error_code(), grpc::StatusCode::INTERNAL);
  EXPECT_EQ(turn.end->error_message().find("thrown"), std::string::npos);  // the client does not see why
}

TEST_F(SessionDriverTest, AnOpeningThatTakesTooLongNamesItsFlag) {
  const ServiceParts strict = parts_with_load();
  SessionDriver slow(strict, "test-2");
  a_look_ns = 600'000'000;
  v1::OpenSession open = open_with_boxes(2);
  open.mutable_tuning()->mutable_sample()->set_points(2);
  send(open);
  slow.plan(turn);
  ASSERT_TRUE(turn.end);
  EXPECT_EQ(turn.end->error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_NE(turn.end->error_message().find("--max-load-s"), std::string::npos);
  EXPECT_EQ(stats.limits.count(Limit::kMaxLoad), 1u);
  EXPECT_FALSE(slow.opened());
}

TEST_F(SessionDriverTest, AnOpeningThatNobodyWaitsForEnds) {
  v1::OpenSession open = open_with_boxes(2);
  open.mutable_tuning()->mutable_sample()->set_points(2);
  send(open);
  turn.unwanted = [] { return true; };
  run();
  ASSERT_TRUE(turn.end);
  EXPECT_EQ(turn.end->error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(extents.count(), 0u);
  EXPECT_EQ(stats.limits.count(Limit::kMaxLoad), 0u);
}

TEST_F(SessionDriverTest, AClosedSessionHasLeftTheShares) {
  open();
  driver.close(grpc::Status::OK);
  EXPECT_FALSE(driver.opened());
  EXPECT_EQ(geometry.live_count(), 0u);
  EXPECT_EQ(shares.join(""), 0u);  // its slot is free
}

}  // namespace
}  // namespace sightline
