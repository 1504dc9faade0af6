// A gate with a TCP port of its own, its clients, and what gRPC would get from it.
#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <openssl/ssl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "server/gate/gate.h"

namespace sightline::test {

constexpr std::chrono::seconds kTimeout{20};

inline bool wait_for(int fd, short events) {
  pollfd watched{fd, events, 0};
  return ::poll(&watched, 1, static_cast<int>(std::chrono::milliseconds(kTimeout).count())) == 1;
}

inline void send_all(int fd, const std::string& bytes) {
  for (size_t at = 0; at < bytes.size();) {
    const ssize_t size = ::send(fd, bytes.data() + at, bytes.size() - at, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (size > 0) at += static_cast<size_t>(size);
    if (size <= 0 && !(errno == EAGAIN && wait_for(fd, POLLOUT))) return;
  }
}

// The next `size` bytes, or fewer when the connection ends or nothing comes.
inline std::string receive(int fd, size_t size) {
  std::string bytes(size, '\0');
  size_t at = 0;
  while (at < size && wait_for(fd, POLLIN)) {
    const ssize_t more = ::recv(fd, bytes.data() + at, size - at, MSG_DONTWAIT);
    if (more <= 0) break;
    at += static_cast<size_t>(more);
  }
  return bytes.substr(0, at);
}

// Waits for the end of a connection on which nothing more comes.
inline bool ends(int fd) {
  char byte;
  return wait_for(fd, POLLIN) && ::recv(fd, &byte, 1, MSG_DONTWAIT) <= 0;
}

// Waits until it is true.
inline bool becomes(const std::function<bool()>& condition) {
  for (const auto end = std::chrono::steady_clock::now() + kTimeout; !condition();
       std::this_thread::sleep_for(std::chrono::milliseconds(1)))
    if (std::chrono::steady_clock::now() > end) return false;
  return true;
}

class GateWorld {
 public:
  explicit GateWorld(const GateLimits& limits = {}, const TlsKeys* tls = nullptr, unsigned relays = 2) {
    auto socket = ListeningSocket::tcp("127.0.0.1:0");
    port_ = socket->port();
    std::vector<ListeningSocket> sockets;
    sockets.push_back(std::move(*socket));
    const auto hand_over = [this](FileDescriptor fd) {
      const std::lock_guard lock(mutex_);
      for_grpc_.push_back(std::move(fd));
      changed_.notify_all();
    };
    const auto note = [this](const std::string&, std::string_view reason) {
      const std::lock_guard lock(mutex_);
      reasons_.emplace_back(reason);
      changed_.notify_all();
    };
    gate_ = std::make_unique<Gate>(std::move(sockets), limits, relays, tls, hand_over, note);
    gate_->start();
  }

  const Gate& gate() const { return *gate_; }

  // From an address of the loopback network.
  FileDescriptor connect(const char* from = "127.0.0.1") const {
    FileDescriptor fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    ::inet_pton(AF_INET, from, &address.sin_addr);
    EXPECT_EQ(::bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    address.sin_port = htons(static_cast<uint16_t>(port_));
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::connect(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
    return fd;
  }
  // gRPC's end of the connection that was admitted next.
  FileDescriptor admitted() {
    std::unique_lock lock(mutex_);
    EXPECT_TRUE(changed_.wait_for(lock, kTimeout, [this] { return !for_grpc_.empty(); }))
        << "no connection was admitted";
    if (for_grpc_.empty()) return {};
    FileDescriptor fd = std::move(for_grpc_.front());
    for_grpc_.pop_front();
    return fd;
  }
  // The next reason for which a connection was refused or cut.
  std::string reason() {
    std::unique_lock lock(mutex_);
    if (!changed_.wait_for(lock, kTimeout, [this] { return !reasons_.empty(); }))
      return "no connection was refused or cut";
    std::string first = std::move(reasons_.front());
    reasons_.pop_front();
    return first;
  }
  // What gRPC calls the client at the other end.
  static std::string peer_name(int grpc) {
    sockaddr_un address{};
    socklen_t length = sizeof(address);
    ::getpeername(grpc, reinterpret_cast<sockaddr*>(&address), &length);
    return "unix-abstract:" + std::string(address.sun_path + 1, length - offsetof(sockaddr_un, sun_path) - 1);
  }

 private:
  int port_ = 0;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<FileDescriptor> for_grpc_;  // guarded by mutex_
  std::deque<std::string> reasons_;      // guarded by mutex_
  std::unique_ptr<Gate> gate_;
};

// A client and gRPC's end of its connection.
struct Pair {
  explicit Pair(GateWorld& world, const char* from = "127.0.0.1")
      : client(world.connect(from)), grpc(world.admitted()) {}
  // True when these bytes come through to gRPC.
  bool pass(const std::string& bytes) const {
    send_all(client.get(), bytes);
    return receive(grpc.get(), bytes.size()) == bytes;
  }
  // A call was accepted.
  void accept(const GateWorld& world) const { world.gate().note_accepted(GateWorld::peer_name(grpc.get())); }
  FileDescriptor client, grpc;
};

}  // namespace sightline::test
