// The gate between real sockets: what passes, who is let in, and who is cut.
#include "server/gate/gate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "tests/gate/frames.h"
#include "tests/gate/gate_world.h"
#include "tests/support/temporary_folder.h"

namespace sightline {
namespace {

using test::becomes;
using test::ends;
using test::GateWorld;
using test::Pair;
using testing::StartsWith;

constexpr double kHardlyEver = 1e-6;  // events in a second

TEST(Gate, PassesBytesBothWaysAndCountsThem) {
  GateWorld world;
  Pair pair(world);
  const std::string asked = test::greeting() + test::call(0);
  EXPECT_TRUE(pair.pass(asked));
  std::string answer(3'000'000, '\0');
  for (size_t i = 0; i < answer.size(); ++i) answer[i] = static_cast<char>(i * i >> 7);
  std::thread grpc([&] { test::send_all(pair.grpc.get(), answer); });
  EXPECT_TRUE(test::receive(pair.client.get(), answer.size()) == answer);
  grpc.join();
  EXPECT_TRUE(becomes([&] { return world.gate().counts().sent_bytes == answer.size(); }));
  const GateCounts counts = world.gate().counts();
  EXPECT_EQ(counts.received_bytes, asked.size());
  EXPECT_EQ(counts.open, 1u);
  EXPECT_EQ(counts.accepted, 1u);

  // Each side learns of the other's end after everything else.
  test::send_all(pair.client.get(), test::call(1));
  ::shutdown(pair.client.get(), SHUT_WR);
  EXPECT_EQ(test::receive(pair.grpc.get(), test::call(1).size() + 1), test::call(1));
  test::send_all(pair.grpc.get(), "last");
  pair.grpc = {};
  EXPECT_EQ(test::receive(pair.client.get(), 5), "last");
  EXPECT_TRUE(becomes([&] { return world.gate().counts().open == 0; }));
  EXPECT_EQ(world.gate().counts().cut, 0u);
}

TEST(Gate, KnowsWhoIsAtTheOtherEnd) {
  GateWorld world;
  Pair pair(world);
  ASSERT_TRUE(pair.pass(test::greeting())) << "before anything comes through, it need not be known";
  const std::string name = GateWorld::peer_name(pair.grpc.get());
  const Peer peer = world.gate().peer_of(name);
  EXPECT_EQ(peer.client, "127.0.0.1");
  EXPECT_FALSE(peer.user);
  EXPECT_EQ(peer.certificate, "");
  EXPECT_FALSE(peer.confidential);
  pair.client = {};
  EXPECT_TRUE(ends(pair.grpc.get()));
  pair.grpc = {};
  EXPECT_TRUE(becomes([&] { return world.gate().peer_of(name).client == name; })) << "it is gone";
}

TEST(Gate, AUserOfTheUnixSocketIsKnownByTheKernel) {
  const test::TemporaryFolder folder;
  std::vector<ListeningSocket> sockets;
  sockets.push_back(std::move(*ListeningSocket::unix_file(folder / "socket", 0600)));
  std::mutex mutex;
  FileDescriptor grpc;
  const auto hand_over = [&](FileDescriptor fd) {
    const std::lock_guard lock(mutex);
    grpc = std::move(fd);
  };
  Gate gate(std::move(sockets), {}, 1, nullptr, hand_over, [](const std::string&, std::string_view) {});
  gate.start();
  const FileDescriptor client(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string path = folder / "socket";
  path.copy(address.sun_path, path.size());
  ASSERT_EQ(::connect(client.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  ASSERT_TRUE(becomes([&] {
    const std::lock_guard lock(mutex);
    return static_cast<bool>(grpc);
  }));
  test::send_all(client.get(), test::greeting());
  ASSERT_EQ(test::receive(grpc.get(), test::greeting().size()), test::greeting());
  const Peer peer = gate.peer_of(GateWorld::peer_name(grpc.get()));
  EXPECT_EQ(peer.client, "uid " + std::to_string(::getuid()));
  EXPECT_EQ(peer.user, ::getuid());
  EXPECT_TRUE(peer.confidential);
}

// --- pace

// How many of these calls, one after another, gRPC gets in a tenth of a second.
size_t calls_passed(const Pair& pair) {
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  std::string bytes(1 << 16, '\0');
  size_t all = 0;
  for (ssize_t size = 0; (size = ::recv(pair.grpc.get(), bytes.data(), bytes.size(), MSG_DONTWAIT)) > 0;)
    all += static_cast<size_t>(size);
  return all / test::call(0).size();
}

std::string calls(uint32_t first, uint32_t count) {
  std::string bytes;
  for (uint32_t n = first; n < first + count; ++n) bytes += test::call(n);
  return bytes;
}

TEST(Gate, CallsBeginAtAPaceAndNothingIsLost) {
  GateLimits limits;
  limits.frames.paced_burst = 10, limits.frames.paced_per_s = 500;
  GateWorld world(limits, nullptr, 1);
  const Pair pair(world);
  ASSERT_TRUE(pair.pass(test::greeting()));
  const std::string all = calls(0, 100);
  test::send_all(pair.client.get(), all + test::frame(0, 0, 199, test::message(8)));
  const double begin_s = gate_now_s();
  EXPECT_EQ(test::receive(pair.grpc.get(), all.size()), all);
  // The first 11 pass at once: ten that fit and the one after which the client waits.
  EXPECT_GT(gate_now_s() - begin_s, 0.9 * 88 / 500);
  EXPECT_EQ(test::receive(pair.grpc.get(), 22).size(), 22u) << "what comes after the last call";
}

TEST(Gate, CallsWithLongHeadersBeginMoreSlowly) {
  GateLimits limits;
  limits.frames.paced_burst = 10, limits.frames.paced_per_s = 500;
  GateWorld world(limits, nullptr, 1);
  const Pair pair(world);
  ASSERT_TRUE(pair.pass(test::greeting()));
  std::string all;
  for (uint32_t n = 0; n < 20; ++n) all += test::call(n, 5 << 10);  // each counts as 10
  test::send_all(pair.client.get(), all);
  const double begin_s = gate_now_s();
  EXPECT_EQ(test::receive(pair.grpc.get(), all.size()), all);
  EXPECT_GT(gate_now_s() - begin_s, 0.9 * (18 * 10 - 10) / 500);
}

TEST(Gate, TheClientWithFewerCallsGoesOnFirst) {
  GateLimits limits;
  limits.frames.paced_burst = 10, limits.frames.paced_per_s = 100;
  GateWorld world(limits, nullptr, 1);
  const Pair greedy(world, "127.0.0.2"), modest(world, "127.0.0.3");
  for (const Pair* const pair : {&greedy, &modest}) ASSERT_TRUE(pair->pass(test::greeting()));
  test::send_all(greedy.client.get(), calls(0, 400));
  EXPECT_LT(calls_passed(greedy), 60u);
  // It waits for a moment after each call, not until the other one has no more.
  for (uint32_t n = 0; n < 5; ++n)
    EXPECT_TRUE(modest.pass(test::call(n) + test::frame(0, 0, 2 * n + 1, test::message(8)))) << n;
  EXPECT_LT(calls_passed(greedy), 200u);
}

TEST(Gate, ManyClientsThatTakeAllTheRoomTakeTurns) {
  GateLimits limits;
  limits.frames.paced_burst = 1, limits.frames.paced_per_s = 500;
  GateWorld world(limits, nullptr, 1);
  std::vector<std::unique_ptr<Pair>> pairs;
  for (int n = 0; n < 12; ++n) {
    pairs.push_back(std::make_unique<Pair>(world, ("127.0.1." + std::to_string(n + 1)).c_str()));
    ASSERT_TRUE(pairs.back()->pass(test::greeting()));
  }
  for (const auto& pair : pairs) test::send_all(pair->client.get(), calls(0, 300));
  std::vector<size_t> passed(pairs.size());
  for (int round = 0; round < 5; ++round)
    for (size_t n = 0; n < pairs.size(); ++n) passed[n] += calls_passed(*pairs[n]);
  EXPECT_GT(*std::ranges::min_element(passed), *std::ranges::max_element(passed) / 3);
}

TEST(Gate, AConnectionWithoutCallsDoesNotWaitForThoseOfOthers) {
  GateLimits limits;
  limits.frames.paced_burst = 1, limits.frames.paced_per_s = 1e-6;
  GateWorld world(limits, nullptr, 1);
  const Pair greedy(world, "127.0.0.2"), session(world, "127.0.0.3");
  for (const Pair* const pair : {&greedy, &session}) ASSERT_TRUE(pair->pass(test::greeting()));
  ASSERT_TRUE(session.pass(test::call(0)));
  test::send_all(greedy.client.get(), calls(0, 10));
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(session.pass(test::frame(0, 0, 1, test::message(50))));
  EXPECT_EQ(calls_passed(greedy), 1u);
}

TEST(Gate, AConnectionThatEndsWhileItWaitsIsForgotten) {
  GateLimits limits;
  limits.frames.paced_burst = 1, limits.frames.paced_per_s = 1e-6;
  GateWorld world(limits, nullptr, 1);
  {
    const Pair pair(world);
    ASSERT_TRUE(pair.pass(test::greeting()));
    test::send_all(pair.client.get(), calls(0, 10));
    ASSERT_TRUE(becomes([&] { return calls_passed(pair) > 0; }));
  }
  EXPECT_TRUE(becomes([&] { return world.gate().counts().open == 0; }));
}

// --- places

TEST(Gate, AConnectionOnWhichNoCallWasAcceptedMakesWayTheOldestFirst) {
  for (const bool client_is_full : {false, true}) {
    GateLimits limits;
    (client_is_full ? limits.max_per_client : limits.max_connections) = 3;
    GateWorld world(limits);
    const Pair busy(world), first(world), second(world);
    ASSERT_TRUE(busy.pass(test::greeting() + test::call(0)));
    busy.accept(world);
    ASSERT_TRUE(first.pass(test::greeting() + test::call(0)));  // it is refused
    const Pair third(world);
    EXPECT_TRUE(ends(first.client.get()));
    EXPECT_EQ(world.reason(), "it was idle, and another client needed its place");
    for (const Pair* const other : {&busy, &second, &third})
      EXPECT_TRUE(other->pass(other == &busy ? test::call(1) : test::greeting()));
    for (const Pair* const other : {&second, &third}) {
      ASSERT_TRUE(other->pass(test::call(0)));
      other->accept(world);
    }
    const FileDescriptor refused = world.connect();
    EXPECT_TRUE(ends(refused.get()));
    EXPECT_THAT(world.reason(), StartsWith("no connection is left"));
    EXPECT_TRUE(busy.pass(test::call(2)));
    const GateCounts counts = world.gate().counts();
    EXPECT_EQ(counts.accepted, 4u);
    EXPECT_EQ(counts.cut, 1u);
    EXPECT_EQ(counts.refused, 1u);
    EXPECT_EQ(counts.refused_client, client_is_full ? 1u : 0u);
    EXPECT_EQ(counts.open, 3u);
  }
}

// Two addresses with calls that are refused must not hold all places.
TEST(Gate, TheClientWithMostConnectionsWithoutAnAcceptedCallGivesAPlace) {
  GateLimits limits;
  limits.max_connections = 3;
  GateWorld world(limits);
  const Pair oldest(world, "127.0.0.3"), first(world, "127.0.0.2"), second(world, "127.0.0.2");
  for (const Pair* const pair : {&oldest, &first, &second}) ASSERT_TRUE(pair->pass(test::greeting() + test::call(0)));
  const Pair fresh(world);
  EXPECT_TRUE(ends(first.client.get())) << "the older one of the client that has two";
  for (const Pair* const pair : {&oldest, &second}) EXPECT_TRUE(pair->pass(test::call(1)));
}

TEST(Gate, AConnectionThatHasBeenIdleForLongMakesWayToo) {
  GateLimits limits;
  limits.max_connections = 2;
  limits.idle_s = 0.0;
  GateWorld world(limits);
  const Pair earlier(world), later(world);
  ASSERT_TRUE(earlier.pass(test::greeting() + test::call(0)));
  ASSERT_TRUE(later.pass(test::greeting() + test::call(0)));
  for (const Pair* const pair : {&earlier, &later}) pair->accept(world);
  const Pair fresh(world);
  EXPECT_TRUE(ends(earlier.client.get()));
  EXPECT_TRUE(later.pass(test::call(1)));
}

TEST(Gate, AClientThatDoesNotGreetIsCut) {
  GateLimits limits;
  limits.greeting_s = 0.1;
  GateWorld world(limits);
  const Pair silent(world), greets(world);
  ASSERT_TRUE(greets.pass(test::greeting()));
  EXPECT_TRUE(ends(silent.client.get()));
  EXPECT_EQ(world.reason(), "it was silent for too long");
  EXPECT_TRUE(greets.pass(test::call(0)));
}

TEST(Gate, WhoFloodedGetsFewConnections) {
  GateLimits limits;
  limits.frames.calls_burst = 2;
  limits.frames.calls_per_s = kHardlyEver;
  limits.after_flood_s = 1e9;
  limits.after_flood_burst = 3;
  limits.after_flood_per_s = kHardlyEver;
  GateWorld world(limits);
  const Pair flood(world);
  test::send_all(flood.client.get(), test::greeting() + test::call(0) + test::call(1) + test::call(2));
  EXPECT_EQ(world.reason(), "it opens calls too fast");
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(Pair(world).pass(test::greeting()));
  const FileDescriptor refused = world.connect();
  EXPECT_TRUE(ends(refused.get()));
  EXPECT_EQ(world.reason(), "too many connections after one that was cut for what it sent");
}

TEST(Gate, AFloodIsForgotten) {
  GateLimits limits;
  limits.frames.calls_burst = 1;
  limits.frames.calls_per_s = kHardlyEver;
  limits.after_flood_s = 0.0;
  limits.after_flood_burst = 1;
  GateWorld world(limits);
  const Pair flood(world);
  test::send_all(flood.client.get(), test::greeting() + test::call(0) + test::call(1));
  EXPECT_EQ(world.reason(), "it opens calls too fast");
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(Pair(world).pass(test::greeting()));
}

TEST(Gate, WhatIsNoHttp2IsCutAndCountsAsNoFlood) {
  GateLimits limits;
  limits.after_flood_burst = 1;
  limits.after_flood_per_s = kHardlyEver;
  GateWorld world(limits);
  const Pair other(world);
  test::send_all(other.client.get(), "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_TRUE(ends(other.client.get()));
  EXPECT_EQ(world.reason(), "it does not speak HTTP/2");
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(Pair(world).pass(test::greeting()));
}

}  // namespace
}  // namespace sightline
