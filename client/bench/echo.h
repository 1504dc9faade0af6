// A bare gRPC echo: the floor under every round trip. Bytes in, bytes out, nothing between; the same event
// loop and channel arguments as the daemon's listener, so that what it costs is what gRPC costs.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include <grpcpp/generic/async_generic_service.h>
#include <grpcpp/grpcpp.h>

#include "server/base/error.h"
#include "server/rpc/event_loop.h"

namespace sightline {

inline constexpr const char* kEchoMethod = "/sightline.bench.Echo/Stream";

// The first bytes of a request, little-endian: its sequence, and how many bytes to answer. The answer starts with the sequence.
// Shorter requests end the stream; answers have at least 8 bytes and at most kMostEchoBytes.
struct EchoHeader {
  uint64_t sequence = 0;
  uint32_t reply_bytes = 0;
};
inline constexpr size_t kEchoHeaderBytes = 12;
inline constexpr uint32_t kMostEchoBytes = 4u << 20;
void write_echo_header(const EchoHeader& header, uint8_t* bytes);
// False when `message` is shorter than `size`; else its first `size` (<= kEchoHeaderBytes) bytes.
bool first_bytes(const grpc::ByteBuffer& message, size_t size, uint8_t* bytes);
uint64_t sequence_of(const uint8_t* bytes);

class EchoServer {
 public:
  // `address`: "host:port", port 0 taking a free one, or "unix:/path". Serves until it is destroyed.
  static Result<std::unique_ptr<EchoServer>> start(const std::string& address);
  ~EchoServer();

  // What to connect to.
  const std::string& address() const { return address_; }

 private:
  class Call;
  EchoServer();
  void take_calls();

  grpc::AsyncGenericService service_;
  std::unique_ptr<grpc::Server> server_;
  std::unique_ptr<EventLoop> loop_;  // goes when the server has shut down, and before it
  std::string address_;
};

// `sightline echo`: prints the address once it serves, then serves until its standard input ends, as it does when whoever started
// it is gone. 0, or 1 with the reason on the standard error output.
int run_echo_command(const std::string& address);

}  // namespace sightline
