// What becomes of a connection that gRPC has closed while its client takes nothing.
#include "server/gate/relay.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <set>
#include <thread>

#include "tests/gate/gate_world.h"

namespace sightline {
namespace {

// A connection whose two other ends the test has.
struct Ends {
  Ends() {
    for (auto [ours, theirs] : {std::pair(&client, &connection->outer), std::pair(&grpc, &connection->inner)}) {
      int pair[2];
      EXPECT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair), 0);
      // As with a large net.core.wmem_default, where the test may set it.
      const int size = 4 << 20;
      if (::setsockopt(pair[0], SOL_SOCKET, SO_SNDBUFFORCE, &size, sizeof size) != 0)
        ::setsockopt(pair[0], SOL_SOCKET, SO_SNDBUF, &size, sizeof size);
      *ours = FileDescriptor(pair[0]);
      *theirs = FileDescriptor(pair[1]);
    }
  }
  std::shared_ptr<Connection> connection = std::make_shared<Connection>();
  FileDescriptor client, grpc;
};

// Sends until nothing more is taken for a while; returns how much was.
size_t fill(int fd) {
  const std::string bytes(1 << 16, 'x');
  size_t sent = 0;
  for (int pauses = 0; pauses < 20;) {
    const ssize_t size = ::send(fd, bytes.data(), bytes.size(), MSG_DONTWAIT | MSG_NOSIGNAL);
    sent += static_cast<size_t>(std::max<ssize_t>(size, 0));
    pauses = size > 0 ? 0 : pauses + 1;
    if (size <= 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return sent;
}

TEST(Relay, AClientThatTakesNothingHasALittleTimeOnceGrpcHasClosed) {
  Ends ends;
  std::atomic<bool> over{false};
  Relay relay(
      {}, [&](const std::shared_ptr<Connection>&, std::string_view) { over = true; },
      [](const Connection&, ptrdiff_t) {});
  relay.add(ends.connection);
  const size_t sent = fill(ends.grpc.get());
  EXPECT_EQ(ends.connection->deadline_s.load(), 0.0);
  const double before_s = gate_now_s();
  ends.grpc = {};
  EXPECT_TRUE(test::becomes([&] { return ends.connection->deadline_s.load() > before_s; }));
  EXPECT_LT(ends.connection->deadline_s.load(), gate_now_s() + 10.0);
  EXPECT_FALSE(over);
  // Meanwhile the thread waits. It used to go round and round.
  std::set<double> beats;
  for (int i = 0; i < 40; ++i, std::this_thread::sleep_for(std::chrono::milliseconds(1)))
    beats.insert(relay.last_beat_s());
  EXPECT_LT(beats.size(), 20u);
  // A client that reads at last gets everything.
  EXPECT_EQ(test::receive(ends.client.get(), sent).size(), sent);
  EXPECT_TRUE(test::becomes([&] { return over.load(); }));
}

}  // namespace
}  // namespace sightline
