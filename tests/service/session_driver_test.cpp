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
  WorkerPool loaders{1};
  StreamRegistry streams{1};
  FairShares shares{1.0};
  StepStats stats;
  Log log{LogFormat::kText, LogLevel::kOff};
  const ServiceParts parts{scenes, geometry, extents, device, scheduler, loaders, streams, shares, stats, log,
                           [] { return int64_t{0}; }, "test"};
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

TEST_F(SessionDriverTest, AClosedSessionHasLeftTheShares) {
  open();
  driver.close(grpc::Status::OK);
  EXPECT_FALSE(driver.opened());
  EXPECT_EQ(geometry.live_count(), 0u);
  EXPECT_EQ(shares.join(""), 0u);  // its slot is free
}

}  // namespace
}  // namespace sightline
