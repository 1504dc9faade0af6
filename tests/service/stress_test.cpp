// Many clients open, tick, fall silent, cancel and vanish at random points, while devices fail and the server drains
// and stops. Every call must end with an allowed status, every tick that should be answered must be, and nothing may be
// left.
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <thread>

#include "server/base/random.h"
#include "tests/service/service_world.h"

namespace sightline {
namespace {

constexpr int kClients = 8;
constexpr int kRounds = 5;
constexpr uint32_t kMostTicks = 30;

// The messages and replies of one call.
struct Account {
  uint64_t sent = 0, answered = 0, newest = 0, newest_refused = 0;
  bool opened = false;

  void take(const v1::ControlResponse& reply) {
    opened |= reply.has_opened();
    if (reply.has_tick_error()) newest_refused = std::max(newest_refused, reply.tick_error().sequence());
    if (!reply.has_camera()) return;
    EXPECT_GT(reply.camera().sequence(), newest);
    newest = reply.camera().sequence();
    answered += 1 + reply.camera().merged_ticks();
  }
};

v1::OpenSession random_open(CounterRandom& random) {
  v1::OpenSession open = open_with_boxes(1 + static_cast<int>(random.next_below(20)));
  open.mutable_diagnostics()->set_depth_maps(random.next_below(4) == 0);
  if (random.next_below(8) == 0) open.mutable_targets(0)->set_id(4711);
  return open;
}

void say_something(Stream& stream, Account& account, CounterRandom& random) {
  const uint64_t id = random.next_below(10) == 0 ? 4711 : 1;
  account.sent += stream.send(move_tick(account.sent + 1, id, random.next_in(-1.0, 1.0)));
}

void read_something(Stream& stream, Account& account) {
  if (const auto reply = stream.read()) account.take(*reply);
}

bool may_end_so(const grpc::Status& status) {
  switch (status.error_code()) {
    case grpc::StatusCode::OK:
    case grpc::StatusCode::CANCELLED:
    case grpc::StatusCode::UNAVAILABLE:
    case grpc::StatusCode::NOT_FOUND:
    case grpc::StatusCode::INVALID_ARGUMENT:
    case grpc::StatusCode::RESOURCE_EXHAUSTED:
      return true;
    case grpc::StatusCode::DEADLINE_EXCEEDED:
      return status.error_message().find("--open-timeout-s") != std::string::npos;
    case grpc::StatusCode::INTERNAL:
      return status.error_message().find("the session failed") != std::string::npos;
    default:
      return false;
  }
}

void expect_all_answered(Stream& stream, Account& account) {
  stream.half_close();
  while (const auto reply = stream.read()) account.take(*reply);
  const grpc::Status status = stream.finish();
  EXPECT_TRUE(may_end_so(status)) << status.error_code() << ' ' << status.error_message();
  if (!status.ok()) return;
  EXPECT_TRUE(account.opened);
  EXPECT_LE(account.answered, account.sent);
  EXPECT_EQ(std::max(account.newest, account.newest_refused), account.sent);
}

// One call from its start to any end.
void live(Stream& stream, CounterRandom& random) {
  Account account;
  if (random.next_below(10) == 0) {  // never sends a message
    EXPECT_TRUE(may_end_so(stream.finish()));
    return;
  }
  stream.send(random_open(random));
  for (uint32_t left = random.next_below(kMostTicks); left > 0; --left) {
    say_something(stream, account, random);
    if (random.next_below(3) == 0) read_something(stream, account);
    if (random.next_below(60) == 0) return;  // destroyed in the middle of everything
  }
  if (random.next_below(3) == 0) stream.cancel();
  expect_all_answered(stream, account);
}

void make_trouble(ServiceWorld& world, CounterRandom& random) {
  if (random.next_below(2) == 0) world.device.throw_next();
  world.device.fail_next({ErrorCode::kUnavailable, "", "the device was lost"});
}

void drain_and_stop(ServiceWorld& world, CounterRandom& random) {
  world.listener->set_serving(false);
  world.streams.drain("the server stops");
  std::this_thread::sleep_for(std::chrono::milliseconds(random.next_below(40)));
  if (random.next_below(2) == 0) world.streams.end_all({grpc::StatusCode::UNAVAILABLE, "the server stopped"});
  world.listener->stop(std::chrono::milliseconds(random.next_below(30)));
}

class Stress : public testing::TestWithParam<uint64_t> {};

TEST_P(Stress, ClientsComeAndGoWhileTheServerFailsAndStops) {
  WorldOptions options;
  options.max_sessions = kClients - 2;
  options.limits.inbox_messages = 8;
  options.limits.open_timeout = std::chrono::milliseconds(30);
  ServiceWorld world(options);
  std::atomic<bool> stopped{false};
  std::vector<std::thread> clients;
  for (int c = 0; c < kClients; ++c) {
    clients.emplace_back([&, c] {
      CounterRandom random(GetParam(), static_cast<uint64_t>(c), RandomPurpose::kTest);
      const auto channel = world.channel();
      while (!stopped) {
        Stream stream(channel);
        live(stream, random);
      }
    });
  }
  CounterRandom random(GetParam(), kClients, RandomPurpose::kTest);
  for (uint32_t left = 4 + random.next_below(8); left > 0; --left) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20 + random.next_below(40)));
    make_trouble(world, random);
  }
  drain_and_stop(world, random);
  stopped = true;
  for (std::thread& client : clients) client.join();
  EXPECT_EQ(world.streams.size(), 0u);
  EXPECT_EQ(world.geometry_count(), 0u);
}

INSTANTIATE_TEST_SUITE_P(Seeds, Stress, testing::Range<uint64_t>(0, kRounds));

}  // namespace
}  // namespace sightline
