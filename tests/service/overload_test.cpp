// Overload: sessions ask for more than one thread can do. Sessions with expensive steps get degraded replies, which say
// so; the others are not affected.
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <thread>

#include "tests/service/service_world.h"

namespace sightline {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;
constexpr milliseconds kTimeout{40'000};

// The maps of a step with two targets take milliseconds; a step without targets needs no maps.
WorldOptions overloaded_world(bool degrade = true, std::optional<int64_t> fixed_ns = std::nullopt) {
  WorldOptions options;
  options.threads = 1;
  options.real_time = true;
  options.budget.degrade = degrade;
  options.budget.fixed_ns = fixed_ns;
  return options;
}

// A game that does not wait for its replies: at 60 Hz until it is slowed down.
class Game {
 public:
  Game(const ServiceWorld& world, const v1::OpenSession& open) : stream_(world.channel()) {
    stream_.open(open);
    writer_ = std::thread([this] { send(); });
    reader_ = std::thread([this] { receive(); });
  }
  ~Game() {
    stops_ = true;
    writer_.join();
    stream_.half_close();
    reader_.join();
  }

  void slow_down() { period_us_ = 50'000; }
  uint64_t replies() const { return replies_; }
  uint64_t degraded() const { return degraded_; }
  uint64_t newest() const { return newest_; }
  uint64_t sent() const { return sent_; }
  bool flags_agree() const { return flags_agree_; }

 private:
  void send() {
    for (auto due = steady_clock::now(); !stops_; due += std::chrono::microseconds(period_us_)) {
      std::this_thread::sleep_until(due);
      stream_.send(move_tick(sent_ + 1, 1, 0.01 * static_cast<double>(sent_ % 100)));
      ++sent_;
    }
  }
  void receive() {
    while (const auto reply = stream_.read()) {
      const v1::CameraReply& camera = reply->camera();
      if (camera.flags().degraded() != camera.has_degradation()) flags_agree_ = false;
      if (camera.has_degradation() &&
          (camera.degradation().quality_level() == 0 || camera.degradation().sample_points() > 8))
        flags_agree_ = false;
      degraded_ += camera.flags().degraded();
      newest_ = camera.sequence();
      ++replies_;
    }
  }

  Stream stream_;
  std::atomic<bool> stops_{false}, flags_agree_{true};
  std::atomic<int64_t> period_us_{16'667};
  std::atomic<uint64_t> sent_{0}, replies_{0}, degraded_{0}, newest_{0};
  std::thread writer_, reader_;
};

bool comes_true(const std::function<bool()>& condition) {
  for (const auto until = steady_clock::now() + kTimeout; steady_clock::now() < until;) {
    if (condition()) return true;
    std::this_thread::sleep_for(milliseconds(5));
  }
  return false;
}

v1::OpenSession heavy_open(bool never_degrade = false) {
  v1::OpenSession open = open_with_boxes(4);
  if (never_degrade) open.set_degradation_policy(v1::DEGRADATION_POLICY_NEVER);
  return open;
}

// A session without targets whose camera brakes from a given speed, so that the replies differ from tick to tick.
v1::OpenSession light_open() {
  v1::OpenSession open = open_with_boxes(4);
  open.clear_targets();
  return open;
}

std::vector<std::string> light_replies(const ServiceWorld& world, uint64_t ticks) {
  Stream stream(world.channel());
  stream.open(light_open());
  std::vector<std::string> replies;
  for (uint64_t i = 1; i <= ticks; ++i) {
    v1::Tick tick = move_tick(i, 1 + i % 4, 0.1 * static_cast<double>(i));
    if (i == 1) {
      *tick.mutable_observed_camera()->mutable_pose() = light_open().camera();
      tick.mutable_observed_camera()->mutable_velocity()->set_x(5.0);
    }
    stream.send(tick);
    const auto reply = stream.read();
    EXPECT_TRUE(reply && reply->has_camera());
    v1::CameraReply camera = reply->camera();
    camera.clear_stage_times();
    replies.push_back(camera.SerializeAsString());
  }
  return replies;
}

TEST(OverloadedService, DegradesOnlyTheSessionsThatAskForMuch) {
  std::vector<std::string> undisturbed;
  {
    const ServiceWorld world;
    undisturbed = light_replies(world, 60);
  }
  ServiceWorld world(overloaded_world());
  world.device.make_maps_cost(std::chrono::microseconds(150));
  std::vector<std::unique_ptr<Game>> games;
  for (int i = 0; i < 4; ++i) games.push_back(std::make_unique<Game>(world, heavy_open()));
  for (const auto& game : games) EXPECT_TRUE(comes_true([&] { return game->degraded() > 20; }));
  EXPECT_EQ(light_replies(world, 60), undisturbed);
  for (const auto& game : games) {  // and all go on
    const uint64_t before = game->newest();
    EXPECT_TRUE(comes_true([&] { return game->newest() > before + 30; }));
    EXPECT_TRUE(game->flags_agree());
  }
  const v1::GetServerStatsResponse stats = world.stats();
  EXPECT_GT(stats.degraded_steps(), 80u);
  EXPECT_GT(stats.late_steps(), 0u);
  EXPECT_LE(stats.late_steps(), stats.steps());
  EXPECT_LT(stats.degraded_steps(), stats.steps());
  EXPECT_GT(stats.queue_p99_us(), 0.0);
  EXPECT_LE(stats.queue_p50_us(), stats.queue_p99_us());
}

TEST(OverloadedService, ReturnsToFullQualityOnceThereIsTime) {
  ServiceWorld world(overloaded_world());
  world.device.make_maps_cost(std::chrono::microseconds(400));
  v1::OpenSession open = heavy_open();
  // what takes time are the maps, also under sanitizers
  open.mutable_tuning()->mutable_aggregate()->set_candidates(50);
  Game game(world, open);
  ASSERT_TRUE(comes_true([&] { return game.degraded() > 20; }));
  world.device.make_maps_cost(std::chrono::microseconds(0));
  game.slow_down();  // a step takes longer than a tick in a program under a sanitizer, even with maps that cost nothing
  EXPECT_TRUE(comes_true([&] {
    const uint64_t degraded = game.degraded(), replies = game.replies();
    std::this_thread::sleep_for(milliseconds(500));
    return game.replies() > replies + 5 && game.degraded() == degraded;
  }));
}

void expect_never_degraded(const WorldOptions& options, const v1::OpenSession& open) {
  ServiceWorld world(options);
  world.device.make_maps_cost(std::chrono::microseconds(400));
  Game game(world, open), other(world, heavy_open());
  // This lasts longer than it takes to degrade another session. This session falls behind instead, and its ticks are
  // merged.
  EXPECT_TRUE(comes_true([&] { return game.sent() > 150 && game.replies() > 10 && other.replies() > 10; }));
  EXPECT_EQ(game.degraded(), 0u);
  EXPECT_GT(other.newest(), 0u);
  EXPECT_LT(game.replies(), game.sent());
}

TEST(OverloadedService, ASessionCanRefuseToBeDegraded) {
  expect_never_degraded(overloaded_world(), heavy_open(true));
}

TEST(OverloadedService, TheServerCanRefuseToDegrade) {
  expect_never_degraded(overloaded_world(false), heavy_open());
}

// 4 ms of maps at 60 Hz would fit.
TEST(OverloadedService, ABudgetSetByHandHoldsWithoutOverload) {
  ServiceWorld world(overloaded_world(true, 1'000'000));
  world.device.make_maps_cost(std::chrono::microseconds(100));
  const Game game(world, heavy_open());
  EXPECT_TRUE(comes_true([&] { return game.degraded() > 20; }));
}

TEST(OverloadedService, AClientThatWaitsForEachReplyIsNeverDegraded) {
  ServiceWorld world(overloaded_world());
  world.device.make_maps_cost(std::chrono::microseconds(800));
  Stream stream(world.channel());
  stream.open(heavy_open());
  for (uint64_t i = 1; i <= 80; ++i) {
    stream.send(move_tick(i, 1, 0.1));
    const auto reply = stream.read();
    ASSERT_TRUE(reply && reply->has_camera());
    EXPECT_FALSE(reply->camera().flags().degraded());
    EXPECT_EQ(reply->camera().merged_ticks(), 0u);
  }
}

}  // namespace
}  // namespace sightline
