#include "client/cpp/client_error.h"

#include "client/cpp/sightline_client.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace sightline {
namespace {

ErrorCode code_from_status(grpc::StatusCode code) {
  switch (code) {
    case grpc::StatusCode::INVALID_ARGUMENT:
    case grpc::StatusCode::OUT_OF_RANGE:
      return ErrorCode::kInvalidArgument;
    case grpc::StatusCode::NOT_FOUND:
      return ErrorCode::kNotFound;
    case grpc::StatusCode::ALREADY_EXISTS:
      return ErrorCode::kAlreadyExists;
    case grpc::StatusCode::FAILED_PRECONDITION:
    case grpc::StatusCode::UNAUTHENTICATED:
    case grpc::StatusCode::PERMISSION_DENIED:
      return ErrorCode::kFailedPrecondition;
    case grpc::StatusCode::RESOURCE_EXHAUSTED:
      return ErrorCode::kResourceExhausted;
    case grpc::StatusCode::UNIMPLEMENTED:
      return ErrorCode::kUnsupported;
    case grpc::StatusCode::DATA_LOSS:
      return ErrorCode::kDataLoss;
    case grpc::StatusCode::UNAVAILABLE:
    case grpc::StatusCode::CANCELLED:
    case grpc::StatusCode::DEADLINE_EXCEEDED:
      return ErrorCode::kUnavailable;
    default:
      return ErrorCode::kInternal;
  }
}

ErrorCode code_from_rejection(v1::TickError::Code code) {
  switch (code) {
    case v1::TickError::CODE_INVALID_ARGUMENT:
      return ErrorCode::kInvalidArgument;
    case v1::TickError::CODE_NOT_FOUND:
      return ErrorCode::kNotFound;
    case v1::TickError::CODE_ALREADY_EXISTS:
      return ErrorCode::kAlreadyExists;
    case v1::TickError::CODE_FAILED_PRECONDITION:
      return ErrorCode::kFailedPrecondition;
    case v1::TickError::CODE_RESOURCE_EXHAUSTED:
      return ErrorCode::kResourceExhausted;
    case v1::TickError::CODE_UNAVAILABLE:
      return ErrorCode::kUnavailable;
    default:
      return ErrorCode::kInternal;
  }
}

v1::TickError::Code rejection_code(ErrorCode code) {
  switch (code) {
    case ErrorCode::kNotFound:
      return v1::TickError::CODE_NOT_FOUND;
    case ErrorCode::kAlreadyExists:
      return v1::TickError::CODE_ALREADY_EXISTS;
    case ErrorCode::kFailedPrecondition:
      return v1::TickError::CODE_FAILED_PRECONDITION;
    case ErrorCode::kResourceExhausted:
      return v1::TickError::CODE_RESOURCE_EXHAUSTED;
    default:
      return v1::TickError::CODE_INVALID_ARGUMENT;
  }
}

void take_first_violation(const google::rpc::BadRequest& bad, Error& error) {
  if (bad.field_violations().empty()) return;
  error.field = bad.field_violations(0).field();
  error.message = bad.field_violations(0).description();
}

}  // namespace

Error error_from_status(const grpc::Status& status) {
  Error error{code_from_status(status.error_code()), "", status.error_message()};
  if (status.error_code() == grpc::StatusCode::DEADLINE_EXCEEDED) error.field = "deadline";
  const bool not_trusted = status.error_code() == grpc::StatusCode::UNAUTHENTICATED ||
                           status.error_code() == grpc::StatusCode::PERMISSION_DENIED;
  if (not_trusted) error.field = "credentials";
  google::rpc::Status details;
  if (!details.ParseFromString(status.error_details())) return error;
  for (const auto& detail : details.details()) {
    google::rpc::BadRequest bad;
    if (detail.UnpackTo(&bad)) take_first_violation(bad, error);
  }
  return error;
}

v1::TickError to_refusal(const Error& error, uint64_t sequence) {
  v1::TickError refusal;
  refusal.set_sequence(sequence);
  refusal.set_code(rejection_code(error.code));
  refusal.set_message(to_string(error));
  if (error.field.empty()) return refusal;
  v1::FieldViolation& violation = *refusal.add_field_violations();
  violation.set_field(error.field);
  violation.set_description(error.message);
  return refusal;
}

Error to_error(const v1::TickError& rejection) {
  Error error{code_from_rejection(rejection.code()), "", rejection.message()};
  if (rejection.field_violations().empty()) return error;
  error.field = rejection.field_violations(0).field();
  error.message = rejection.field_violations(0).description();
  return error;
}

}  // namespace sightline
