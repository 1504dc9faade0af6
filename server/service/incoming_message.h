// A message of a client on its way from bytes to a ControlRequest.
//
// gRPC would parse it on the event loop, which serves all streams. A message of 4 MiB of empty parts takes a third of a
// second and a quarter of a gigabyte. Here the loop parses small messages only. Larger ones are first weighed, and then
// parsed on another thread.
#pragma once

#include <grpcpp/support/byte_buffer.h>

#include <cstddef>
#include <string>

#include "server/base/error.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// A message of at most this many bytes is parsed on the loop. That takes less than a millisecond.
inline constexpr size_t kParsedOnLoop = 16 << 10;

// Fails with kResourceExhausted when the message would take more than `max_memory` bytes, and with kInvalidArgument
// when the bytes are no ControlRequest. `bytes` is emptied.
Status parse_message(grpc::ByteBuffer& bytes, size_t max_memory, v1::ControlRequest& request);

}  // namespace sightline
