// What a caller is told of a call or a tick that failed.
#include "client/cpp/client_error.h"

#include <gtest/gtest.h>

#include "client/cpp/sightline_client.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"

namespace sightline {
namespace {

using grpc::StatusCode;

TEST(ClientError, HasTheCodeOfItsStatus) {
  const std::pair<StatusCode, ErrorCode> cases[] = {{StatusCode::INVALID_ARGUMENT, ErrorCode::kInvalidArgument},
                                                    {StatusCode::OUT_OF_RANGE, ErrorCode::kInvalidArgument},
                                                    {StatusCode::NOT_FOUND, ErrorCode::kNotFound},
                                                    {StatusCode::ALREADY_EXISTS, ErrorCode::kAlreadyExists},
                                                    {StatusCode::FAILED_PRECONDITION, ErrorCode::kFailedPrecondition},
                                                    {StatusCode::RESOURCE_EXHAUSTED, ErrorCode::kResourceExhausted},
                                                    {StatusCode::UNIMPLEMENTED, ErrorCode::kUnsupported},
                                                    {StatusCode::DATA_LOSS, ErrorCode::kDataLoss},
                                                    {StatusCode::UNAVAILABLE, ErrorCode::kUnavailable},
                                                    {StatusCode::CANCELLED, ErrorCode::kUnavailable},
                                                    {StatusCode::INTERNAL, ErrorCode::kInternal},
                                                    {StatusCode::UNKNOWN, ErrorCode::kInternal}};
  for (const auto& [code, expected] : cases) {
    const Error error = error_from_status(grpc::Status(code, "why"));
    EXPECT_EQ(error.code, expected) << code;
    EXPECT_EQ(error.field, "") << code;
    EXPECT_EQ(error.message, "why") << code;
  }
}

TEST(ClientError, OfADeadlineOrOfCredentialsNamesThem) {
  EXPECT_EQ(error_from_status(grpc::Status(StatusCode::DEADLINE_EXCEEDED, "late")).field, "deadline");
  EXPECT_EQ(error_from_status(grpc::Status(StatusCode::DEADLINE_EXCEEDED, "late")).code, ErrorCode::kUnavailable);
  for (const StatusCode code : {StatusCode::UNAUTHENTICATED, StatusCode::PERMISSION_DENIED}) {
    EXPECT_EQ(error_from_status(grpc::Status(code, "who")).field, "credentials");
    EXPECT_EQ(error_from_status(grpc::Status(code, "who")).code, ErrorCode::kFailedPrecondition);
  }
}

TEST(ClientError, NamesTheFirstFieldOfTheDetails) {
  google::rpc::BadRequest bad;
  for (const char* name : {"first", "second"}) {
    google::rpc::BadRequest::FieldViolation& violation = *bad.add_field_violations();
    violation.set_field(name), violation.set_description(std::string(name) + " is wrong");
  }
  google::rpc::Status details;
  details.add_details()->PackFrom(google::rpc::Status());  // of another kind
  details.add_details()->PackFrom(bad);
  const Error error = error_from_status(
      grpc::Status(StatusCode::INVALID_ARGUMENT, "in all", details.SerializeAsString()));
  EXPECT_EQ(error.field, "first");
  EXPECT_EQ(error.message, "first is wrong");
  google::rpc::Status none;
  none.add_details()->PackFrom(google::rpc::BadRequest());
  EXPECT_EQ(error_from_status(grpc::Status(StatusCode::INVALID_ARGUMENT, "in all", none.SerializeAsString())).message,
            "in all");
  EXPECT_EQ(error_from_status(grpc::Status(StatusCode::INVALID_ARGUMENT, "in all", "no message")).message, "in all");
}

TEST(ClientError, OfARefusedTickNamesItsFirstField) {
  const std::pair<v1::TickError::Code, ErrorCode> cases[] = {
      {v1::TickError::CODE_INVALID_ARGUMENT, ErrorCode::kInvalidArgument},
      {v1::TickError::CODE_NOT_FOUND, ErrorCode::kNotFound},
      {v1::TickError::CODE_ALREADY_EXISTS, ErrorCode::kAlreadyExists},
      {v1::TickError::CODE_FAILED_PRECONDITION, ErrorCode::kFailedPrecondition},
      {v1::TickError::CODE_RESOURCE_EXHAUSTED, ErrorCode::kResourceExhausted},
      {v1::TickError::CODE_UNAVAILABLE, ErrorCode::kUnavailable},
      {v1::TickError::CODE_INTERNAL, ErrorCode::kInternal}};
  for (const auto& [code, expected] : cases) {
    v1::TickError rejection;
    rejection.set_code(code), rejection.set_message("tick.lens: is wrong");
    const Error plain = to_error(rejection);
    EXPECT_EQ(plain.code, expected);
    EXPECT_EQ(plain.field, "");
    EXPECT_EQ(plain.message, "tick.lens: is wrong");
    for (const char* name : {"tick.lens", "tick.limits"}) {
      auto& violation = *rejection.add_field_violations();
      violation.set_field(name), violation.set_description(std::string("is wrong in ") + name);
    }
    EXPECT_EQ(to_error(rejection).field, "tick.lens");
    EXPECT_EQ(to_error(rejection).message, "is wrong in tick.lens");
  }
}

}  // namespace
}  // namespace sightline
