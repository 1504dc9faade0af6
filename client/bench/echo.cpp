#include "client/bench/echo.h"

#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <iostream>
#include <vector>

#include "server/rpc/call.h"

namespace sightline {
namespace {

using EchoCall = AsyncCall<grpc::GenericServerAsyncReaderWriter, NoRequest, grpc::GenericServerContext>;

constexpr size_t kSequenceBytes = 8;

uint64_t little_endian(const uint8_t* bytes, int count) {
  uint64_t value = 0;
  for (int i = 0; i < count; ++i) value |= static_cast<uint64_t>(bytes[i]) << (8 * i);
  return value;
}

void to_little_endian(uint64_t value, int count, uint8_t* bytes) {
  for (int i = 0; i < count; ++i) bytes[i] = static_cast<uint8_t>(value >> (8 * i));
}

}  // namespace

void write_echo_header(const EchoHeader& header, uint8_t* bytes) {
  to_little_endian(header.sequence, kSequenceBytes, bytes);
  to_little_endian(header.reply_bytes, kEchoHeaderBytes - kSequenceBytes, bytes + kSequenceBytes);
}

bool first_bytes(const grpc::ByteBuffer& message, size_t size, uint8_t* bytes) {
  std::vector<grpc::Slice> slices;
  if (!message.Dump(&slices).ok()) return false;
  size_t have = 0;
  for (const grpc::Slice& slice : slices) {
    const size_t more = std::min(size - have, slice.size());
    std::memcpy(bytes + have, slice.begin(), more);
    if ((have += more) == size) return true;
  }
  return false;
}

uint64_t sequence_of(const uint8_t* bytes) {
  return little_endian(bytes, kSequenceBytes);
}

// One request, one answer, one request ...
class EchoServer::Call final : public EchoCall {
 public:
  Call(EventLoop& loop, std::unique_ptr<Incoming> incoming) : EchoCall(loop, std::move(incoming)) {
    start_read(request_);
  }

 private:
  void on_read(bool ok) override {
    uint8_t header[kEchoHeaderBytes];
    if (!ok || !first_bytes(request_, sizeof header, header)) return finish_call(grpc::Status::OK);
    const auto asked =
        static_cast<uint32_t>(little_endian(header + kSequenceBytes, sizeof header - kSequenceBytes));
    answer_.resize(std::clamp<size_t>(asked, kSequenceBytes, kMostEchoBytes));
    std::memcpy(answer_.data(), header, kSequenceBytes);
    const grpc::Slice slice(answer_.data(), answer_.size());
    reply_ = grpc::ByteBuffer(&slice, 1);
    start_write(reply_);
  }
  void on_write(bool ok) override {
    if (!ok) return finish_call(grpc::Status::OK);
    request_.Clear();
    start_read(request_);
  }
  void on_done() override { delete this; }

  grpc::ByteBuffer request_, reply_;
  std::vector<uint8_t> answer_;
};

EchoServer::EchoServer() = default;

void EchoServer::take_calls() {
  const auto ask = [this](EchoCall::Incoming& incoming, void* tag) {
    service_.RequestCall(&incoming.context, &incoming.responder, &loop_->queue(), &loop_->server_queue(), tag);
  };
  Door<EchoCall::Incoming>::open(*loop_, ask, [this](std::unique_ptr<EchoCall::Incoming> incoming) {
    take_calls();
    new Call(*loop_, std::move(incoming));
  });
}

Result<std::unique_ptr<EchoServer>> EchoServer::start(const std::string& address) {
  std::unique_ptr<EchoServer> echo(new EchoServer);
  grpc::ServerBuilder builder;
  builder.AddChannelArgument(GRPC_ARG_ALLOW_REUSEPORT, 0);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_BDP_PROBE, 0);  // as server/service/listener.cpp
  builder.RegisterAsyncGenericService(&echo->service_);
  std::unique_ptr<grpc::ServerCompletionQueue> queue = builder.AddCompletionQueue();
  int port = 0;
  builder.AddListeningPort(address, grpc::InsecureServerCredentials(), &port);
  echo->server_ = builder.BuildAndStart();
  if (!echo->server_ || port == 0) {
    queue->Shutdown();
    return fail(ErrorCode::kUnavailable, "echo", "cannot listen at " + address);
  }
  echo->loop_ = std::make_unique<EventLoop>(std::move(queue));
  echo->take_calls();
  echo->address_ = address.starts_with("unix:")
                       ? address
                       : address.substr(0, address.rfind(':') + 1).append(std::to_string(port));
  return echo;
}

EchoServer::~EchoServer() {
  if (!server_) return;
  server_->Shutdown(std::chrono::system_clock::now());
  server_->Wait();
  loop_.reset();
}

int run_echo_command(const std::string& address) {
  const auto echo = EchoServer::start(address);
  if (!echo) {
    std::cerr << "sightline echo: " << to_string(echo.error()) << '\n';
    return 1;
  }
  std::cout << (*echo)->address() << std::endl;
  char unread[64];
  while (read(STDIN_FILENO, unread, sizeof unread) > 0) {
  }
  return 0;
}

}  // namespace sightline
