// Converts gRPC statuses to Error values.
#pragma once

#include <grpcpp/grpcpp.h>

#include "server/base/error.h"
#include "sightline/v1/errors.pb.h"

namespace sightline {

// `status` must not be OK. Decodes the first field violation of a google.rpc.BadRequest in the details.
Error error_from_status(const grpc::Status& status);

// The refusal of a tick that ends each call in which it is sent with this error.
v1::TickError to_refusal(const Error& error, uint64_t sequence);

}  // namespace sightline
