// Conversion of errors to gRPC statuses.
#pragma once

#include <grpcpp/support/status.h>

#include <chrono>
#include <string>

#include "server/base/error.h"

namespace sightline {

// The status that ends a call: the code of the same meaning, with the message "field: message". If a field is at
// fault, the details hold a google.rpc.Status with a google.rpc.BadRequest. kUnsupported and kDataLoss become
// INVALID_ARGUMENT, because the client's data cannot be used and sending it again will not help. A long message is
// cut, so that it fits into headers.
grpc::Status status_from_error(const Error& error);

// The refusal "full, try again later": RESOURCE_EXHAUSTED with a google.rpc.RetryInfo in its details.
grpc::Status exhausted_status(const std::string& message, std::chrono::seconds retry_delay);

// "open.targets[2].id: no instance has the id 7"; without a field the message alone.
std::string describe(const Error& error);

}  // namespace sightline
