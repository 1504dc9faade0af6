// gRPC's reflection service, for tools such as grpcurl.
//
// gRPC's own is not used, because each of its calls occupies a thread of the synchronous RPCs for as long as the client is
// silent. This one is answered by an event loop; its calls are few and short.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "grpc/reflection/v1alpha/reflection.grpc.pb.h"
#include "server/rpc/event_loop.h"

namespace sightline {

// Thread-safe, as gRPC asks. It must outlive the gRPC server and the loops.
class ReflectionService final : public grpc::reflection::v1alpha::ServerReflection::AsyncService {
 public:
  // A further call is refused. A call ends after kMostTime.
  static constexpr size_t kMostCalls = 16;
  static constexpr std::chrono::seconds kMostTime{10};

  // Called once, before take_calls. A call is refused with the status that `admit` gives, unless that is OK.
  void admit_by(std::function<grpc::Status(const grpc::ServerContext&)> admit) { admit_ = std::move(admit); }
  // Called for each call that is refused because kMostCalls are open. Set before take_calls; runs on the loop's thread.
  void tell_refused_to(std::function<void()> refused) { refused_ = std::move(refused); }
  // `loop` takes all calls from now until the server shuts down. `services` are the full names to be listed.
  void take_calls(EventLoop& loop, std::vector<std::string> services);

 private:
  class Call;
  void take_calls(EventLoop& loop);

  std::function<grpc::Status(const grpc::ServerContext&)> admit_ = [](const grpc::ServerContext&) { return grpc::Status::OK; };
  std::function<void()> refused_ = [] {};
  std::vector<std::string> services_;
  std::atomic<size_t> open_{0};
};

// The answer to one request.
grpc::reflection::v1alpha::ServerReflectionResponse reflect(
    const grpc::reflection::v1alpha::ServerReflectionRequest& request, const std::vector<std::string>& services);

}  // namespace sightline
