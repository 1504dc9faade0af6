// The refusal "full, try again later", in gRPC's standard form.
#pragma once

#include <grpcpp/support/status.h>

#include <chrono>
#include <string>

namespace sightline {

// RESOURCE_EXHAUSTED with a google.rpc.RetryInfo in its details.
grpc::Status exhausted_status(const std::string& message, std::chrono::seconds retry_delay);

}  // namespace sightline
