// Calls of services for which no package has stubs: bytes out, bytes back.
#pragma once

#include <grpcpp/channel.h>
#include <grpcpp/support/status.h>

#include <memory>
#include <string>

namespace sightline {

struct RawReply {
  grpc::Status status;
  std::string bytes;
};

// Sends one message and takes one; also fits a bidirectional method that answers one message for one.
RawReply call_raw(const std::shared_ptr<grpc::Channel>& channel, const std::string& method, const std::string& bytes);

// grpc.health.v1: 1 is SERVING, 2 NOT_SERVING; -1 when the call failed.
int health_of(const std::shared_ptr<grpc::Channel>& channel, const std::string& service);

}  // namespace sightline
