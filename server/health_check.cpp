#include "server/health_check.h"

#include <grpcpp/grpcpp.h>

#include <chrono>

#include "grpc/health/v1/health.grpc.pb.h"

namespace sightline {
namespace {

// Probes usually have one second or more; the daemon answers within milliseconds.
constexpr std::chrono::seconds kPatience{2};

}  // namespace

int check_health(const std::string& address, const std::string& service, std::ostream& out, std::ostream& err) {
  namespace health = grpc::health::v1;
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);  // a proxy that the environment names is not for this host
  const auto stub = health::Health::NewStub(grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments));
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kPatience);
  health::HealthCheckRequest request;
  request.set_service(service);
  health::HealthCheckResponse response;
  const grpc::Status status = stub->Check(&context, request, &response);
  if (!status.ok()) {
    err << address << ": " << service << " is not known: " << status.error_message() << '\n';
    return 1;
  }
  if (response.status() == health::HealthCheckResponse::SERVING) {
    out << address << ": " << service << " is SERVING\n";
    return 0;
  }
  err << address << ": " << service << " is " << health::HealthCheckResponse::ServingStatus_Name(response.status()) << '\n';
  return 1;
}

}  // namespace sightline
