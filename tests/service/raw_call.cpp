#include "tests/service/raw_call.h"

#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/grpcpp.h>

#include <future>

namespace sightline {

RawReply call_raw(const std::shared_ptr<grpc::Channel>& channel, const std::string& method, const std::string& bytes) {
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(20));
  const grpc::Slice slice(bytes);
  const grpc::ByteBuffer request(&slice, 1);
  grpc::ByteBuffer response;
  std::promise<grpc::Status> done;
  grpc::GenericStub(channel).UnaryCall(&context, method, {}, &request, &response,
                                       [&done](grpc::Status status) { done.set_value(std::move(status)); });
  RawReply reply{done.get_future().get(), ""};
  grpc::Slice whole;
  if (reply.status.ok() && response.DumpToSingleSlice(&whole).ok()) {
    reply.bytes.assign(reinterpret_cast<const char*>(whole.begin()), whole.size());
  }
  return reply;
}

int health_of(const std::shared_ptr<grpc::Channel>& channel, const std::string& service) {
  // HealthCheckRequest: field 1, a string. HealthCheckResponse: field 1, an enum.
  std::string request;
  if (!service.empty()) request = std::string("\x0a") + static_cast<char>(service.size()) + service;
  const RawReply reply = call_raw(channel, "/grpc.health.v1.Health/Check", request);
  return reply.status.ok() && reply.bytes.size() == 2 ? reply.bytes[1] : -1;
}

}  // namespace sightline
