// Errors as gRPC clients know them.
#pragma once

#include <grpcpp/support/status.h>

#include <string>

#include "server/base/error.h"

namespace sightline {

// A call's end: the code of the same meaning, "field: message", and when a field is at fault a
// google.rpc.Status with a google.rpc.BadRequest in the binary details. kUnsupported and kDataLoss become
// INVALID_ARGUMENT: it is what the client sent that cannot be used, and sending it again will not help. A
// long message is cut, so that it fits into headers.
grpc::Status status_from_error(const Error& error);

// "open.targets[2].id: no instance has the id 7"; without a field the message alone.
std::string describe(const Error& error);

}  // namespace sightline
