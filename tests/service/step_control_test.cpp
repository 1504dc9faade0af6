// A client that chooses when a step is taken and at which quality level (StepControl). Its replies are compared with
// the same steps taken without a service.
#include <gtest/gtest.h>

#include "client/recordings/local_session.h"
#include "client/recordings/recording.h"
#include "tests/service/service_world.h"

namespace sightline {
namespace {

constexpr int kBoxes = 5;

v1::Tick told_tick(uint64_t sequence) {
  return move_tick(sequence, 1 + sequence % kBoxes, 0.05 * static_cast<double>(sequence));
}

v1::Tick merged_tick(uint64_t sequence) {
  v1::Tick tick = told_tick(sequence);
  tick.mutable_step_control()->set_merge_into_next(true);
  return tick;
}

v1::Tick at_level(v1::Tick tick, uint32_t level) {
  tick.mutable_step_control()->set_quality_level(level);
  return tick;
}

// The same session in this process: its replies to the steps that the test asks for.
class Local {
 public:
  explicit Local(const v1::OpenSession& open) : session_(*LocalSession::open(open, world_)) {}
  void apply(const v1::Tick& tick) {
    v1::TickError rejection;
    EXPECT_TRUE(session_->apply(tick, rejection)) << rejection.message();
  }
  uint64_t step(int level = 0) {
    v1::CameraReply reply;
    EXPECT_TRUE(session_->step(level, reply));
    return reply_hash(reply);
  }

 private:
  const std::unique_ptr<SamplerDevice> sampler_ = make_embree_sampler_device();
  LocalWorld world_{"", *sampler_};
  std::unique_ptr<LocalSession> session_;
};

v1::CameraReply camera_of(Stream& stream) {
  const auto reply = stream.read();
  EXPECT_TRUE(reply && reply->has_camera()) << (reply ? reply->DebugString() : "the call has ended");
  return reply ? reply->camera() : v1::CameraReply();
}

void wait_for_ticks(const ServiceWorld& world, uint64_t before, uint64_t ticks) {
  while (world.clock_calls() < before + ticks) std::this_thread::yield();
}

TEST(StepControl, AMergedTickIsAnsweredWithTheNextAsIfBothHadComeAtOnce) {
  const ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_with_boxes(kBoxes));
  Local local(open_with_boxes(kBoxes));
  uint64_t sequence = 0;
  for (int merged = 0; merged < 4; ++merged) {
    for (int i = 0; i < merged; ++i) {
      const v1::Tick tick = merged_tick(++sequence);
      stream.send(tick);
      local.apply(tick);
    }
    const v1::Tick tick = told_tick(++sequence);
    stream.send(tick);
    local.apply(tick);
    const v1::CameraReply reply = camera_of(stream);
    EXPECT_EQ(reply.sequence(), sequence);
    EXPECT_EQ(reply.merged_ticks(), static_cast<uint32_t>(merged));
    EXPECT_EQ(reply_hash(reply), local.step()) << merged;
  }
}

// The ticks arrive together while a step is under way. The first is answered by itself, the second together with the
// third.
TEST(StepControl, AMergedTickBehindAnotherDoesNotGetIntoItsAnswer) {
  ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_with_boxes(kBoxes));
  Local local(open_with_boxes(kBoxes));
  world.device.close_gate();
  stream.send(told_tick(1));
  world.device.wait_until_held(1);
  const uint64_t before = world.clock_calls();
  stream.send(told_tick(2));
  stream.send(merged_tick(3));
  wait_for_ticks(world, before, 2);
  world.device.open_gate();
  local.apply(told_tick(1));
  EXPECT_EQ(reply_hash(camera_of(stream)), local.step());
  local.apply(told_tick(2));
  const v1::CameraReply second = camera_of(stream);
  EXPECT_EQ(second.sequence(), 2u);
  EXPECT_EQ(reply_hash(second), local.step());
  stream.send(told_tick(4));
  local.apply(merged_tick(3));
  local.apply(told_tick(4));
  const v1::CameraReply third = camera_of(stream);
  EXPECT_EQ(third.merged_ticks(), 1u);
  EXPECT_EQ(reply_hash(third), local.step());
}

TEST(StepControl, ARefusedTickDoesNotEndTheWaitOfAMergedOne) {
  const ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_with_boxes(kBoxes));
  Local local(open_with_boxes(kBoxes));
  stream.send(merged_tick(1));
  stream.send(move_tick(2, 4711, 0.0));
  const auto refused = stream.read();
  ASSERT_TRUE(refused && refused->has_tick_error());
  EXPECT_EQ(refused->tick_error().sequence(), 2u);
  stream.send(told_tick(3));
  local.apply(merged_tick(1));
  local.apply(told_tick(3));
  const v1::CameraReply reply = camera_of(stream);
  EXPECT_EQ(reply.merged_ticks(), 1u);
  EXPECT_EQ(reply_hash(reply), local.step());
}

TEST(StepControl, ASessionCanEndWhileAMergedTickWaits) {
  const ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_with_boxes(kBoxes));
  stream.send(merged_tick(1));
  stream.half_close();
  EXPECT_FALSE(stream.read());
  EXPECT_TRUE(stream.finish().ok());
}

TEST(StepControl, TheToldLevelIsTheStepsEvenWhereNothingIsToBeDegraded) {
  const ServiceWorld world;
  v1::OpenSession open = open_with_boxes(kBoxes);
  open.set_degradation_policy(v1::DEGRADATION_POLICY_NEVER);
  Stream stream(world.channel());
  stream.open(open);
  Local local(open);
  uint64_t sequence = 0;
  for (const uint32_t level : {0u, 1u, 5u, 3u, 0u, 2u, 4u}) {
    const v1::Tick tick = at_level(told_tick(++sequence), level);
    stream.send(tick);
    local.apply(tick);
    const v1::CameraReply reply = camera_of(stream);
    EXPECT_EQ(reply.flags().degraded(), level > 0);
    EXPECT_EQ(reply.degradation().quality_level(), level);
    EXPECT_EQ(reply_hash(reply), local.step(static_cast<int>(level))) << level;
  }
}

TEST(StepControl, OfMergedTicksTheNewestSaysTheLevel) {
  const ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_with_boxes(kBoxes));
  stream.send(at_level(merged_tick(1), 5));
  stream.send(at_level(told_tick(2), 2));
  EXPECT_EQ(camera_of(stream).degradation().quality_level(), 2u);
  stream.send(at_level(merged_tick(3), 5));
  stream.send(told_tick(4));
  EXPECT_FALSE(camera_of(stream).has_degradation()) << "absent: by the load, and there is none";
}

TEST(StepControl, ALevelThatThereIsNotIsRefusedByName) {
  const ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_with_boxes(kBoxes));
  Local local(open_with_boxes(kBoxes));
  for (const uint32_t level : {6u, ~0u}) {
    stream.send(at_level(told_tick(1), level));
    const auto refused = stream.read();
    ASSERT_TRUE(refused && refused->has_tick_error());
    ASSERT_EQ(refused->tick_error().field_violations_size(), 1);
    EXPECT_EQ(refused->tick_error().field_violations(0).field(), "tick.step_control.quality_level");
  }
  stream.send(told_tick(1));
  local.apply(told_tick(1));
  EXPECT_EQ(reply_hash(camera_of(stream)), local.step()) << "nothing of them was applied";
}

// The budget is far too small for this session, but it chooses its levels itself.
TEST(StepControl, ASessionThatChoosesItsLevelsIsNotDegradedByItsBudget) {
  BudgetRules budget;
  budget.fixed_ns = 1;
  using std::chrono::steady_clock;
  // Ticks until `enough`, which is asked after every reply, or until a reply is degraded. Returns the number of ticks,
  // and whether one was.
  const auto step_until = [&](bool tells, const auto& enough) {
    const ServiceWorld world({.real_time = true, .budget = budget});
    Stream stream(world.channel());
    stream.open(open_with_boxes(kBoxes));
    uint64_t ticks = 0;
    bool degraded = false;
    while (!degraded && !enough(ticks)) {
      const v1::Tick tick = told_tick(++ticks);
      stream.send(tells ? at_level(tick, 0) : tick);
      degraded = camera_of(stream).flags().degraded();
    }
    return std::pair(ticks, degraded);
  };
  // How soon the budget raises a level depends on the machine, so the other session is given twice the time and the
  // steps that this one took.
  const auto start = steady_clock::now();
  const auto [ticks, degraded] = step_until(
      false, [&](uint64_t) { return steady_clock::now() - start > std::chrono::seconds(60); });
  ASSERT_TRUE(degraded) << "or the test shows nothing";
  const auto took = steady_clock::now() - start;
  const auto second_start = steady_clock::now();
  const auto enough = [&, most = 2 * ticks](uint64_t so_far) {
    return so_far >= most && steady_clock::now() - second_start > 2 * took;
  };
  EXPECT_FALSE(step_until(true, enough).second);
}

}  // namespace
}  // namespace sightline
