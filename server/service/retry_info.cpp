#include "server/service/retry_info.h"

#include "sightline/v1/errors.pb.h"

namespace sightline {

grpc::Status exhausted_status(const std::string& message, std::chrono::seconds retry_delay) {
  v1::RetryInfo retry;
  retry.mutable_retry_delay()->set_seconds(retry_delay.count());
  v1::StatusDetails details;
  details.set_code(grpc::StatusCode::RESOURCE_EXHAUSTED);
  details.set_message(message);
  google::protobuf::Any& any = *details.add_details();
  any.set_type_url("type.googleapis.com/google.rpc.RetryInfo");
  any.set_value(retry.SerializeAsString());
  return {grpc::StatusCode::RESOURCE_EXHAUSTED, message, details.SerializeAsString()};
}

}  // namespace sightline
