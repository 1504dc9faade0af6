#include "tests/bench/echo_server.h"

#include <algorithm>

#include "client/bench/protocol.h"
#include "server/rpc/call.h"

namespace sightline {
namespace {

using EchoCall = AsyncCall<grpc::GenericServerAsyncReaderWriter, NoRequest, grpc::GenericServerContext>;

constexpr uint64_t kMostBytes = 4u << 20;

}  // namespace

// Answers each request before it reads the next.
class EchoServer::Call final : public EchoCall {
 public:
  Call(EventLoop& loop, std::unique_ptr<Incoming> incoming) : EchoCall(loop, std::move(incoming)) {
    start_read(request_);
  }

 private:
  void on_read(bool ok) override {
    const auto header = ok ? read_echo(request_) : std::nullopt;
    if (!header) return finish_call(grpc::Status::OK);
    write_echo(*header, std::min(header->reply_bytes, kMostBytes), reply_);
    start_write(reply_);
  }
  void on_write(bool ok) override {
    if (!ok) return finish_call(grpc::Status::OK);
    request_.Clear();
    start_read(request_);
  }
  void on_done() override { delete this; }

  grpc::ByteBuffer request_, reply_;
};

EchoServer::EchoServer() = default;

void EchoServer::take_calls() {
  const auto ask = [this](EchoCall::Incoming& incoming, void* tag) {
    service_.RequestCall(&incoming.context, &incoming.responder, &loop_->queue(), &loop_->server_queue(), tag);
  };
  CallAcceptor<EchoCall::Incoming>::start(*loop_, ask, [this](std::unique_ptr<EchoCall::Incoming> incoming) {
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

}  // namespace sightline
