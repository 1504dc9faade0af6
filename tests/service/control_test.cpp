// The life of a session on the wire.
#include <gtest/gtest.h>

#include <thread>

#include "tests/service/service_world.h"

namespace sightline {
namespace {

// The resources of a finished call may be freed a moment after its status arrives.
template <typename Condition>
bool soon(const Condition& condition) {
  for (int i = 0; i < 2000 && !condition(); ++i) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  return condition();
}

TEST(Control, OpensAndAnswersTicks) {
  const ServiceWorld world;
  Stream stream(world.channel());
  const v1::SessionOpened opened = stream.open(open_with_boxes(3));
  EXPECT_FALSE(opened.session_id().empty());
  EXPECT_EQ(opened.instance_count(), 3u);
  EXPECT_EQ(opened.triangle_count(), 36u);
  EXPECT_EQ(opened.sampler(), "embree");

  ASSERT_TRUE(stream.send(move_tick(1, 1, 0.25)));
  const auto reply = stream.read();
  ASSERT_TRUE(reply && reply->has_camera());
  EXPECT_EQ(reply->camera().sequence(), 1u);
  EXPECT_EQ(reply->camera().merged_ticks(), 0u);
  EXPECT_EQ(reply->camera().targets_size(), 2);
  EXPECT_NE(reply->camera().mirror_hash(), opened.mirror_hash());
  stream.half_close();
  EXPECT_TRUE(stream.finish().ok());
}

TEST(Control, AnswersEverythingSentBeforeTheClientClosesItsSide) {
  ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_with_boxes(2));
  world.device.close_gate();
  for (uint64_t i = 1; i <= 20; ++i) stream.send(move_tick(i, 1, 0.01 * static_cast<double>(i)));
  stream.half_close();
  world.device.open_gate();
  uint64_t answered = 0, newest = 0;
  while (const auto reply = stream.read()) {
    ASSERT_TRUE(reply->has_camera());
    answered += 1 + reply->camera().merged_ticks();
    newest = reply->camera().sequence();
  }
  EXPECT_EQ(answered, 20u);
  EXPECT_EQ(newest, 20u);
  EXPECT_TRUE(stream.finish().ok());
}

TEST(Control, EqualInputsGiveEqualReplies) {
  const ServiceWorld world;
  std::vector<std::string> poses[2];
  for (auto& run : poses) {
    Stream stream(world.channel());
    stream.open(open_with_boxes(4));
    for (uint64_t i = 1; i <= 30; ++i) {
      stream.send(move_tick(i, 1 + i % 4, 0.05 * static_cast<double>(i)));
      run.push_back(stream.read()->camera().pose().SerializeAsString());
    }
  }
  EXPECT_EQ(poses[0], poses[1]);
}

TEST(Control, GivesBackASessionWhoseClientVanishes) {
  const ServiceWorld world;
  {
    Stream stream(world.channel());
    stream.open(open_with_boxes(2));
    EXPECT_EQ(world.stats().open_sessions(), 1u);
    EXPECT_EQ(world.stats().geometry_count(), 1u);
    stream.cancel();
  }
  EXPECT_TRUE(soon([&] { return world.stats().open_sessions() == 0; }));
  EXPECT_EQ(world.stats().geometry_count(), 0u);
}

TEST(Control, GivesBackASessionThatIsCancelledInTheMiddleOfAStep) {
  ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_with_boxes(2));
  world.device.close_gate();
  stream.send(move_tick(1, 1, 1.0));
  world.device.wait_until_held(1);
  stream.cancel();
  EXPECT_EQ(stream.finish().error_code(), grpc::StatusCode::CANCELLED);
  EXPECT_EQ(world.stats().open_sessions(), 1u);
  world.device.open_gate();
  EXPECT_TRUE(soon([&] { return world.stats().open_sessions() == 0; }));
}

TEST(Control, RefusesSessionsOverTheLimitAndSaysWhenToTryAgain) {
  const ServiceWorld world({.max_sessions = 2});
  auto first = std::make_unique<Stream>(world.channel());
  Stream second(world.channel());
  first->open(open_with_boxes(1));
  second.open(open_with_boxes(1));

  // A stream without a place may still resume a session, so it is refused by its first message.
  Stream third(world.channel());
  ASSERT_TRUE(third.send(open_with_boxes(1)));
  const grpc::Status refused = third.finish();
  EXPECT_EQ(refused.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_GT(retry_seconds_of(refused), 0);

  first->half_close();
  EXPECT_TRUE(first->finish().ok());
  Stream fourth(world.channel());
  fourth.open(open_with_boxes(1));
  EXPECT_EQ(world.info().max_sessions(), 2u);
}

TEST(Control, ManySessionsRunAtOnce) {
  const ServiceWorld world;
  std::vector<std::thread> clients;
  std::atomic<int> answered{0};
  for (int c = 0; c < 12; ++c) {
    clients.emplace_back([&] {
      Stream stream(world.channel());
      stream.open(open_with_boxes(3));
      for (uint64_t i = 1; i <= 20; ++i) {
        stream.send(move_tick(i, 1, 0.02 * static_cast<double>(i)));
        const auto reply = stream.read();
        if (reply && reply->has_camera() && reply->camera().sequence() == i) ++answered;
      }
    });
  }
  for (std::thread& client : clients) client.join();
  EXPECT_EQ(answered, 12 * 20);
  EXPECT_TRUE(soon([&] { return world.stats().open_sessions() == 0; }));
}

TEST(Control, AStepThatTheDeviceFailsIsARejectionAndTheNextOneWorks) {
  ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_with_boxes(2));
  world.device.fail_next({ErrorCode::kUnavailable, "", "the device was lost"});
  stream.send(move_tick(1, 1, 0.1));
  const auto failed = stream.read();
  ASSERT_TRUE(failed && failed->has_tick_error());
  EXPECT_EQ(failed->tick_error().code(), v1::TickError::CODE_UNAVAILABLE);
  EXPECT_EQ(failed->tick_error().sequence(), 1u);
  stream.send(move_tick(2, 1, 0.2));
  const auto answered = stream.read();
  ASSERT_TRUE(answered && answered->has_camera());
  EXPECT_EQ(answered->camera().sequence(), 2u);
}

}  // namespace
}  // namespace sightline
