#include "server/wire/error_to_proto.h"

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace sightline {
namespace {

grpc::StatusCode code_of(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalidArgument:
    case ErrorCode::kUnsupported:
    case ErrorCode::kDataLoss:
      return grpc::StatusCode::INVALID_ARGUMENT;
    case ErrorCode::kNotFound:
      return grpc::StatusCode::NOT_FOUND;
    case ErrorCode::kAlreadyExists:
      return grpc::StatusCode::ALREADY_EXISTS;
    case ErrorCode::kFailedPrecondition:
      return grpc::StatusCode::FAILED_PRECONDITION;
    case ErrorCode::kResourceExhausted:
      return grpc::StatusCode::RESOURCE_EXHAUSTED;
    case ErrorCode::kUnavailable:
      return grpc::StatusCode::UNAVAILABLE;
    case ErrorCode::kInternal:
      return grpc::StatusCode::INTERNAL;
  }
  return grpc::StatusCode::INTERNAL;
}

grpc::Status detailed(grpc::StatusCode code, const std::string& message, const google::protobuf::Message& detail) {
  google::rpc::Status details;
  details.set_code(code);
  details.set_message(message);
  details.add_details()->PackFrom(detail);
  return {code, message, details.SerializeAsString()};
}

// A status travels in headers, which clients take up to 8 KiB; the message is in it twice, once in base64.
constexpr size_t kMaxStatusText = 1000;

Error shortened(Error error) {
  if (error.message.size() <= kMaxStatusText) return error;
  size_t end = kMaxStatusText;
  while (end > 0 && (error.message[end] & 0xC0) == 0x80) --end;  // not within a character of UTF-8
  error.message.replace(end, std::string::npos, "...");
  return error;
}

}  // namespace

std::string describe(const Error& error) {
  return error.field.empty() ? error.message : error.field + ": " + error.message;
}

grpc::Status status_from_error(const Error& whole) {
  const Error error = shortened(whole);
  const grpc::StatusCode code = code_of(error.code);
  const std::string message = describe(error);
  if (error.field.empty()) return {code, message};
  google::rpc::BadRequest bad_request;
  google::rpc::BadRequest::FieldViolation& violation = *bad_request.add_field_violations();
  violation.set_field(error.field);
  violation.set_description(error.message);
  return detailed(code, message, bad_request);
}

grpc::Status exhausted_status(const std::string& message, std::chrono::seconds retry_delay) {
  google::rpc::RetryInfo retry;
  retry.mutable_retry_delay()->set_seconds(retry_delay.count());
  return detailed(grpc::StatusCode::RESOURCE_EXHAUSTED, message, retry);
}

}  // namespace sightline
