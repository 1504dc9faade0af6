// gRPC's reflection service, for tools such as grpcurl: version 1, and 1alpha for older tools.
//
// gRPC's own is not used, because each of its calls occupies a thread of the synchronous RPCs for as long as the client
// is silent. This one is answered by an event loop; its calls are few and short.
#pragma once

#include <grpcpp/server_builder.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "grpc/reflection/v1/reflection.grpc.pb.h"
#include "grpc/reflection/v1alpha/reflection.grpc.pb.h"
#include "server/rpc/event_loop.h"
#include "server/rpc/timers.h"

namespace sightline {

// Thread-safe, as gRPC asks. It must outlive the gRPC server and the loops.
class ReflectionService final {
 public:
  // A call ends after this time.
  static constexpr std::chrono::seconds kMostTime{10};

  // Called once, before the server starts.
  void register_at(grpc::ServerBuilder& builder);
  // Called once, before take_calls. A call is refused with the status that `admit` gives, unless that is OK.
  void admit_by(std::function<grpc::Status(const grpc::ServerContext&)> admit) { admit_ = std::move(admit); }
  // The most calls at the same time, of both versions together. `refused` is called for each further one. Set before
  // take_calls; it runs on the loop's thread.
  void limit_calls_to(size_t most, std::function<void()> refused) {
    most_calls_ = most;
    refused_ = std::move(refused);
  }
  // `loop` takes all calls from now until the server shuts down. `services` are the full names to be listed, beside
  // those of both versions of this service. `timers` must outlive the loop.
  void take_calls(EventLoop& loop, Timers& timers, std::vector<std::string> services);

 private:
  struct V1;
  struct V1Alpha;
  template <typename Version>
  class Call;
  template <typename Version>
  void take_calls_of(typename Version::Service::AsyncService& service, EventLoop& loop, Timers& timers);

  std::function<grpc::Status(const grpc::ServerContext&)> admit_ = [](const grpc::ServerContext&) {
    return grpc::Status::OK;
  };
  size_t most_calls_ = 16;
  std::function<void()> refused_ = [] {};
  std::vector<std::string> services_;
  std::atomic<size_t> open_{0};
  grpc::reflection::v1::ServerReflection::AsyncService v1_;
  grpc::reflection::v1alpha::ServerReflection::AsyncService v1alpha_;
};

}  // namespace sightline
