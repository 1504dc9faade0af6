// The newest tick wins, no change is lost, and no queue grows without bound.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "tests/service/service_world.h"

namespace sightline {
namespace {

constexpr int kBoxes = 100;

// Steps that take little time, also under sanitizers: what is merged does not depend on them.
v1::OpenSession open_quick_session() {
  v1::OpenSession open = open_with_boxes(kBoxes);
  open.mutable_tuning()->mutable_aggregate()->set_candidates(50);
  open.mutable_tuning()->mutable_sample()->set_points(4);
  open.mutable_tuning()->mutable_sample()->set_resolution(8);
  return open;
}

v1::Tick burst_tick(uint64_t sequence) {
  return move_tick(sequence, 1 + sequence % kBoxes, 0.01 * static_cast<double>(sequence));
}

// The state of a session that received the same ticks one by one.
uint64_t hash_when_told_slowly(const ServiceWorld& world, uint64_t ticks) {
  Stream stream(world.channel());
  stream.open(open_quick_session());
  uint64_t hash = 0;
  for (uint64_t i = 1; i <= ticks; ++i) {
    stream.send(burst_tick(i));
    const auto reply = stream.read();
    EXPECT_TRUE(reply && reply->has_camera() && reply->camera().merged_ticks() == 0);
    hash = reply->camera().mirror_hash();
  }
  return hash;
}

// Returns `value` once it has stopped growing for a while.
uint64_t settled(const std::function<uint64_t()>& value) {
  uint64_t last = value();
  for (int still = 0; still < 40;) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    const uint64_t now = value();
    still = now == last ? still + 1 : 0;
    last = now;
  }
  return last;
}

TEST(Merge, ABurstOfTicksIsAppliedWholeAndAnsweredForTheNewest) {
  constexpr uint64_t kTicks = 500;
  ServiceWorld world;
  const uint64_t expected = hash_when_told_slowly(world, kTicks);

  Stream stream(world.channel());
  stream.open(open_quick_session());
  world.device.close_gate();
  stream.send(burst_tick(1));
  world.device.wait_until_held(1);
  for (uint64_t i = 2; i <= kTicks; ++i) ASSERT_TRUE(stream.send(burst_tick(i)));
  settled([&] { return world.clock_calls(); });
  world.device.open_gate();

  uint64_t answered = 0, newest = 0, hash = 0, replies = 0;
  while (newest < kTicks) {
    const auto reply = stream.read();
    ASSERT_TRUE(reply && reply->has_camera());
    EXPECT_GT(reply->camera().sequence(), newest);
    answered += 1 + reply->camera().merged_ticks();
    newest = reply->camera().sequence();
    hash = reply->camera().mirror_hash();
    ++replies;
  }
  EXPECT_EQ(answered, kTicks);
  EXPECT_EQ(hash, expected);
  EXPECT_LT(replies, 50u);  // one step for all ticks that had piled up, not one step a tick
}

TEST(Merge, ARefusedTickInABurstIsNamedAndTheOthersAreApplied) {
  ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_quick_session());
  world.device.close_gate();
  stream.send(burst_tick(1));
  world.device.wait_until_held(1);
  const uint64_t before = world.clock_calls();
  for (uint64_t i = 2; i <= 9; ++i) stream.send(i == 5 ? move_tick(5, 4711, 0.0) : burst_tick(i));
  while (world.clock_calls() < before + 8) std::this_thread::yield();
  world.device.open_gate();

  const auto first = stream.read();
  ASSERT_TRUE(first && first->has_camera());
  const auto refused = stream.read();
  ASSERT_TRUE(refused && refused->has_tick_error());
  EXPECT_EQ(refused->tick_error().sequence(), 5u);
  const auto merged = stream.read();
  ASSERT_TRUE(merged && merged->has_camera());
  EXPECT_EQ(merged->camera().sequence(), 9u);
  EXPECT_EQ(merged->camera().merged_ticks(), 6u);  // 2 3 4 6 7 8
}

// Each tick of the burst changes another setting; one tick is refused, and two change the same setting. One step later
// all settings are in force, as if each tick had been answered by itself.
TEST(Merge, SettingsOfABurstAreAllAppliedInOrder) {
  constexpr uint64_t kTicks = 8;
  const auto tick_with_settings = [](uint64_t sequence) {
    v1::Tick tick = burst_tick(sequence);
    tuning::v1alpha1::Tuning& tuning = *tick.mutable_tuning();
    if (sequence == 2) tuning.mutable_sample()->set_points(3);  // overwritten by tick 3, which starts from a preset
    if (sequence == 3) tick.mutable_settings()->set_preset(v1::Settings::PRESET_PAPER);
    if (sequence == 4) tuning.mutable_sample()->set_resolution(40);
    if (sequence == 5) tuning.mutable_sample()->set_resolution(12);
    if (sequence == 6) tuning.mutable_sample()->set_resolution(1);  // refused
    if (sequence == 7) tuning.mutable_aggregate()->set_volume(tuning::v1alpha1::VOLUME_LATTICE);
    if (sequence == 8) tick.mutable_limits()->set_max_speed_mps(0.25);
    return tick;
  };
  ServiceWorld world;
  Stream burst(world.channel()), slow(world.channel());
  v1::OpenSession open = open_quick_session();
  open.mutable_diagnostics()->set_depth_maps(true);
  for (Stream* stream : {&burst, &slow}) stream->open(open);
  for (uint64_t i = 1; i <= kTicks; ++i) {
    slow.send(tick_with_settings(i));
    const auto reply = slow.read();
    ASSERT_TRUE(reply && (i == 6 ? reply->has_tick_error() : reply->has_camera())) << i;
  }
  world.device.close_gate();
  burst.send(tick_with_settings(1));
  world.device.wait_until_held(1);
  for (uint64_t i = 2; i <= kTicks; ++i) ASSERT_TRUE(burst.send(tick_with_settings(i)));
  settled([&] { return world.clock_calls(); });
  world.device.open_gate();
  uint64_t merged = 0;
  for (uint64_t newest = 0; newest < kTicks;) {
    const auto reply = burst.read();
    ASSERT_TRUE(reply);
    if (reply->has_tick_error()) continue;
    newest = reply->camera().sequence(), merged = reply->camera().merged_ticks();
  }
  EXPECT_EQ(merged, kTicks - 3);  // all but the first, the refused and the newest

  for (Stream* stream : {&burst, &slow}) stream->send(burst_tick(kTicks + 1));
  for (Stream* stream : {&burst, &slow}) {
    const auto reply = stream->read();
    ASSERT_TRUE(reply && reply->has_camera());
    const v1::CameraReply& camera = reply->camera();
    EXPECT_EQ(camera.depth_maps(0).width(), 12u);
    EXPECT_EQ(camera.volume_used(), v1::VOLUME_USED_LATTICE);
    EXPECT_EQ(camera.pair_fallback(), v1::PAIR_FALLBACK_UNSPECIFIED);
    EXPECT_LE(std::abs(camera.velocity().x()), 0.25 + 1e-9);
    // Two targets, one point each, a map over the bound, a sight, and PAPER's prediction.
    EXPECT_LE(camera.depth_maps_size(), 6);
  }
}

TEST(Merge, AFullInboxStopsReading) {
  ServiceWorld world;
  Stream stream(world.channel());
  stream.open(open_quick_session());
  world.device.close_gate();
  stream.send(burst_tick(1));
  world.device.wait_until_held(1);
  const uint64_t before = world.clock_calls();
  std::thread writer([&] {
    for (uint64_t i = 2; i <= 20'000 && stream.send(burst_tick(i)); ++i) {
    }
  });
  EXPECT_EQ(settled([&] { return world.clock_calls(); }) - before, ServiceLimits{}.inbox_messages);
  stream.cancel();
  writer.join();
}

TEST(Merge, AnInboxIsBoundedInBytesToo) {
  ServiceWorld world({.limits = {.inbox_bytes = 100'000}});
  Stream stream(world.channel());
  stream.open(open_with_boxes(1));
  world.device.close_gate();
  stream.send(move_tick(1, 1, 0.0));
  world.device.wait_until_held(1);
  const uint64_t before = world.clock_calls();
  std::thread writer([&] {
    v1::Tick big = move_tick(2, 1, 0.0);
    for (int i = 0; i < 4'000; ++i) big.mutable_transforms()->add_positions(0.0);  // 32 KB
    while (stream.send(big)) {
    }
  });
  const uint64_t taken = settled([&] { return world.clock_calls(); }) - before;
  EXPECT_GE(taken, 2u);  // the limit counts memory, and a message may take more of it than bytes on the wire
  EXPECT_LE(taken, 4u);
  stream.cancel();
  writer.join();
}

// Replies fill the transport's window, then the session's steps stop, then its inbox fills, and then its ticks are no
// longer read.
TEST(Merge, AClientThatNeverReadsIsHeldBackAndNoOtherIs) {
  const ServiceWorld world;
  v1::OpenSession greedy = open_with_boxes(kBoxes);
  greedy.mutable_tuning()->mutable_sample()->set_resolution(64);
  greedy.mutable_diagnostics()->set_depth_maps(true);
  greedy.mutable_diagnostics()->set_candidates(true);
  Stream stuck(world.channel());
  stuck.send(greedy);
  std::atomic<uint64_t> sent{0};
  std::thread writer([&] {
    for (uint64_t i = 1; i <= 100'000 && stuck.send(burst_tick(i)); ++i) sent = i;
  });
  settled([&] { return sent.load(); });
  const uint64_t calls = settled([&] { return world.clock_calls(); });

  Stream other(world.channel());
  other.open(open_with_boxes(2));
  for (uint64_t i = 1; i <= 10; ++i) {
    other.send(move_tick(i, 1, 0.1));
    EXPECT_TRUE(other.read()->has_camera());
  }
  other.half_close();
  EXPECT_TRUE(other.finish().ok());
  EXPECT_LT(world.clock_calls() - calls, 200u);  // only the calls for the other session
  EXPECT_LT(sent, 20'000u);                      // the transport may have widened its windows meanwhile
  stuck.cancel();
  writer.join();
}

TEST(Merge, AReaderThatWakesUpGetsEverything) {
  constexpr uint64_t kTicks = 3000;
  const ServiceWorld world;
  v1::OpenSession open = open_quick_session();
  open.mutable_tuning()->mutable_sample()->set_resolution(64);
  open.mutable_diagnostics()->set_depth_maps(true);
  Stream stream(world.channel());
  stream.send(open);
  std::atomic<uint64_t> sent{0};
  std::thread writer([&] {
    for (uint64_t i = 1; i <= kTicks && stream.send(burst_tick(i)); ++i) sent = i;
    stream.half_close();
  });
  settled([&] { return sent.load(); });
  ASSERT_TRUE(stream.read()->has_opened());
  uint64_t answered = 0;
  while (const auto reply = stream.read()) {
    ASSERT_TRUE(reply->has_camera());
    answered += 1 + reply->camera().merged_ticks();
  }
  writer.join();
  EXPECT_EQ(answered, kTicks);
  EXPECT_TRUE(stream.finish().ok());
}

}  // namespace
}  // namespace sightline
