// Errors as clients get them: of a tick, and of a call.
#include "server/wire/error_to_proto.h"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <utility>

#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "server/session/session.h"
#include "server/wire/to_proto.h"
#include "sightline/v1/camera_control.pb.h"
#include "tests/wire/from_proto_fixture.h"

namespace sightline::test {
namespace {

v1::TickError reject(const Error& error, const SceneMirror* mirror) {
  v1::TickError rejection;
  tick_error_to_proto(error, 12, mirror, rejection);
  return rejection;
}

TEST(TickError, NamesTheTickTheFieldAndTheReason) {
  const v1::TickError rejection = reject({ErrorCode::kInvalidArgument, "tick.dt_s", "must not be negative"}, nullptr);
  EXPECT_EQ(rejection.sequence(), 12u);
  EXPECT_EQ(rejection.code(), v1::TickError::CODE_INVALID_ARGUMENT);
  EXPECT_EQ(rejection.message(), "tick.dt_s: must not be negative");
  ASSERT_EQ(rejection.field_violations_size(), 1);
  EXPECT_EQ(rejection.field_violations(0).field(), "tick.dt_s");
  EXPECT_EQ(rejection.field_violations(0).description(), "must not be negative");
}

TEST(TickError, HasTheCodeOfTheError) {
  using E = ErrorCode;
  using T = v1::TickError;
  const std::pair<E, T::Code> codes[] = {{E::kInvalidArgument, T::CODE_INVALID_ARGUMENT},
                                         {E::kUnsupported, T::CODE_INVALID_ARGUMENT},
                                         {E::kDataLoss, T::CODE_INVALID_ARGUMENT},
                                         {E::kNotFound, T::CODE_NOT_FOUND},
                                         {E::kAlreadyExists, T::CODE_ALREADY_EXISTS},
                                         {E::kFailedPrecondition, T::CODE_FAILED_PRECONDITION},
                                         {E::kResourceExhausted, T::CODE_RESOURCE_EXHAUSTED},
                                         {E::kUnavailable, T::CODE_UNAVAILABLE},
                                         {E::kInternal, T::CODE_INTERNAL}};
  for (const auto& [code, sent] : codes) EXPECT_EQ(reject({code, "", "text"}, nullptr).code(), sent);
  EXPECT_EQ(reject({E::kInternal, "", "text"}, nullptr).message(), "text");
  EXPECT_EQ(reject({E::kInternal, "", "text"}, nullptr).field_violations_size(), 0);
}

TEST_F(FromProto, ATickErrorAsksForAResyncWhenTheMirrorsDisagree) {
  SessionOptions options = must_read(make_open());
  options.targets.clear();  // so that no sampler is needed
  const auto session = *Session::open(std::move(options), nullptr, nullptr);
  const SceneMirror* mirror = &session->mirror();
  using E = ErrorCode;
  EXPECT_TRUE(reject({E::kNotFound, "tick.transforms.ids[3]", ""}, mirror).has_resync());
  EXPECT_TRUE(reject({E::kNotFound, "tick.targets.targets[0].id", ""}, mirror).has_resync());
  EXPECT_TRUE(reject({E::kFailedPrecondition, "tick.delta.base_revision", ""}, mirror).has_resync());
  EXPECT_TRUE(reject({E::kAlreadyExists, "tick.delta.added_instances[0].id", ""}, mirror).has_resync());
  EXPECT_FALSE(reject({E::kFailedPrecondition, "tick.delta.removed_ids[0]", ""}, mirror).has_resync());
  EXPECT_FALSE(reject({E::kNotFound, "tick.delta.added_instances[0].mesh.scene_name", ""}, mirror).has_resync());
  EXPECT_FALSE(reject({E::kInvalidArgument, "tick.transforms.ids[3]", ""}, mirror).has_resync());
  const v1::TickError rejection = reject({E::kNotFound, "tick.transforms.ids[3]", ""}, mirror);
  EXPECT_EQ(rejection.resync().mirror_revision(), 1u);
  EXPECT_EQ(rejection.resync().mirror_hash(), mirror->hash());
}

TEST(StatusFromError, CarriesABadRequestThatAnyClientDecodes) {
  const grpc::Status status = status_from_error(
      {ErrorCode::kNotFound, "open.targets[2].id", "no instance has the id 7"});
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(status.error_message(), "open.targets[2].id: no instance has the id 7");
  google::rpc::Status details;
  ASSERT_TRUE(details.ParseFromString(status.error_details()));
  EXPECT_EQ(details.code(), 5);  // google.rpc.Code.NOT_FOUND
  ASSERT_EQ(details.details_size(), 1);
  EXPECT_EQ(details.details(0).type_url(), "type.googleapis.com/google.rpc.BadRequest");
  google::rpc::BadRequest bad_request;
  ASSERT_TRUE(bad_request.ParseFromString(details.details(0).value()));
  ASSERT_EQ(bad_request.field_violations_size(), 1);
  EXPECT_EQ(bad_request.field_violations(0).field(), "open.targets[2].id");
}

TEST(StatusFromError, WithoutAFieldHasNoDetails) {
  const grpc::Status status = status_from_error({ErrorCode::kUnavailable, "", "the device was lost"});
  EXPECT_EQ(status.error_code(), grpc::StatusCode::UNAVAILABLE);
  EXPECT_EQ(status.error_message(), "the device was lost");
  EXPECT_TRUE(status.error_details().empty());
}

// Headers have little room.
TEST(StatusFromError, AMessageOfMoreThanAThousandBytesIsCutBetweenCharacters) {
  const auto sent = [](const std::string& message) {
    return status_from_error({ErrorCode::kUnavailable, "", message}).error_message();
  };
  const std::string fits(1000, 'x');
  EXPECT_EQ(sent(fits), fits);
  EXPECT_EQ(sent(fits + "y"), fits + "...");
  EXPECT_EQ(sent(fits.substr(0, 999) + "\u00e9"), fits.substr(0, 999) + "...") << "a character of two bytes";
}

TEST(StatusFromError, HasTheCodeOfTheError) {
  using E = ErrorCode;
  using S = grpc::StatusCode;
  const std::pair<E, S> codes[] = {{E::kInvalidArgument, S::INVALID_ARGUMENT},
                                   {E::kNotFound, S::NOT_FOUND},
                                   {E::kAlreadyExists, S::ALREADY_EXISTS},
                                   {E::kFailedPrecondition, S::FAILED_PRECONDITION},
                                   {E::kResourceExhausted, S::RESOURCE_EXHAUSTED},
                                   {E::kUnavailable, S::UNAVAILABLE},
                                   {E::kInternal, S::INTERNAL}};
  for (const auto& [code, sent] : codes) EXPECT_EQ(status_from_error({code, "", "text"}).error_code(), sent);
}

TEST(StatusFromError, OfAFullServerSaysWhenToTryAgain) {
  const grpc::Status status = exhausted_status("too many sessions", std::chrono::seconds(7));
  EXPECT_EQ(status.error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
  EXPECT_EQ(status.error_message(), "too many sessions");
  google::rpc::Status details;
  ASSERT_TRUE(details.ParseFromString(status.error_details()));
  EXPECT_EQ(details.code(), 8);  // google.rpc.Code.RESOURCE_EXHAUSTED
  EXPECT_EQ(details.message(), "too many sessions");
  google::rpc::RetryInfo retry;
  ASSERT_TRUE(details.details_size() == 1 && details.details(0).UnpackTo(&retry));
  EXPECT_EQ(retry.retry_delay().seconds(), 7);
}

TEST(StatusFromError, UnusableInputIsTheSendersFault) {
  EXPECT_EQ(status_from_error({ErrorCode::kUnsupported, "", ""}).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
  EXPECT_EQ(status_from_error({ErrorCode::kDataLoss, "", ""}).error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

}  // namespace
}  // namespace sightline::test
