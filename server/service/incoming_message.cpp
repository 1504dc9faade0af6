#include "server/service/incoming_message.h"

#include <grpcpp/impl/codegen/proto_utils.h>
#include <grpcpp/support/slice.h>

#include <span>

#include "server/wire/message_weight.h"

namespace sightline {

Status parse_message(grpc::ByteBuffer& bytes, size_t max_memory, v1::ControlRequest& request) {
  grpc::Slice whole;
  const bool one = bytes.TrySingleSlice(&whole).ok() || bytes.DumpToSingleSlice(&whole).ok();
  bytes.Clear();
  if (!one) return fail(ErrorCode::kInternal, "", "the message could not be read");
  const auto span = std::as_bytes(std::span(whole.begin(), whole.size()));
  // Even the heaviest message of this size is light enough to be parsed unseen.
  if (span.size() > kParsedOnLoop &&
      message_weight(*v1::ControlRequest::descriptor(), span, max_memory) >= max_memory) {
    return fail(ErrorCode::kResourceExhausted, "message",
                "takes more than " + std::to_string(max_memory >> 20) + " MiB of memory (--max-message-memory-mib)");
  }
  if (!request.ParseFromArray(whole.begin(), static_cast<int>(whole.size())))
    return invalid("message", "is not a ControlRequest");
  return {};
}

}  // namespace sightline
