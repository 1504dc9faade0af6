// The gate between real sockets: what passes, who is let in, and who is cut.
#include "server/gate/gate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <thread>

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
    for (const Pair* const other : {&busy, &second, &third}) EXPECT_TRUE(other->pass(other == &busy ? test::call(1) : test::greeting()));
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
