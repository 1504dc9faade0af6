// Converts gRPC statuses to Error values.
#pragma once

#include <grpcpp/grpcpp.h>

#include "server/base/error.h"

namespace sightline {

// `status` must not be OK. Decodes the first field violation of a google.rpc.BadRequest in the details.
Error error_from_status(const grpc::Status& status);

}  // namespace sightline
