// The protocol of a stream under load: Sightline's Control, or a bare echo of equally long messages. The stream itself
// moves bytes only, so that the same code drives, times and counts both.
#pragma once

#include <grpcpp/support/byte_buffer.h>

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "client/bench/world.h"

namespace sightline {

// The server's description of an opened session; empty for an echo.
struct BenchOpened {
  std::string sampler;
  uint64_t instances = 0, triangles = 0;
};

// One message of the server.
struct BenchAnswer {
  enum class Kind { kOpened, kReply, kRejection, kOther };
  Kind kind = Kind::kOther;
  uint64_t sequence = 0;
  uint32_t merged = 0;  // kReply: the number of earlier ticks that it covers
  // kReply: queue, scene, bound, sample, aggregate, move, step, in microseconds; none from an echo.
  std::optional<std::array<double, 7>> stages_us = {};
  bool degraded = false;
  std::string trouble = {};  // kRejection, kOther: for a person
  BenchOpened opened = {};   // kOpened
};

struct BenchProtocol {
  std::string method;
  std::optional<grpc::ByteBuffer> opening;  // the first message; without it, no answer to it is awaited either
  // Writes tick 1, 2, ..., called in that order on one thread.
  std::function<void(uint64_t sequence, grpc::ByteBuffer& message)> write_tick;
  // Reads an answer, on the loop's thread, while write_tick may run on another. May empty `message`.
  std::function<BenchAnswer(grpc::ByteBuffer& message)> read;
};

// Session `session` of `world`, opened with `open`. `world` must outlive it.
BenchProtocol control_protocol(const BenchWorld& world, size_t session, const v1::OpenSession& open);

struct MessageSizes {
  size_t tick = 0, reply = 0;
};
// Sends a bare echo (tests/bench/echo_server.cpp) messages of `sizes().tick` bytes and asks for answers of
// `sizes().reply` bytes. Neither side uses protobuf. `sizes` is called for every tick.
BenchProtocol echo_protocol(std::function<MessageSizes()> sizes);

// The echo's method, and the first bytes of every message, in the machine's own byte order: both sides run on one
// machine. The answer repeats the header and has `reply_bytes` bytes, but at least a header.
inline constexpr const char* kEchoMethod = "/sightline.bench.Echo/Stream";
struct EchoHeader {
  uint64_t sequence = 0;
  uint64_t reply_bytes = 0;
};
// Writes a message of `size` bytes, but at least a header.
void write_echo(const EchoHeader& header, size_t size, grpc::ByteBuffer& message);
// None when the message is shorter than a header.
std::optional<EchoHeader> read_echo(const grpc::ByteBuffer& message);

}  // namespace sightline
