#include "server/health_check.h"

#include <grpcpp/grpcpp.h>
#include <grpcpp/security/tls_credentials_options.h>

#include <chrono>
#include <memory>

#include "grpc/health/v1/health.grpc.pb.h"
#include "server/gate/small_file.h"
#include "server/rpc/timers.h"

namespace sightline {
namespace {

// Probes usually have one second or more; the daemon answers within milliseconds.
constexpr std::chrono::seconds kPatience{2};

using ChannelCredentials = std::shared_ptr<grpc::ChannelCredentials>;

Result<ChannelCredentials> credentials_for(const HealthAddress& where) {
  if (!where.tls) return grpc::InsecureChannelCredentials();
  grpc::experimental::TlsChannelCredentialsOptions options;
  options.set_verify_server_certs(false);
  options.set_check_call_host(false);
  options.set_certificate_verifier(std::make_shared<grpc::experimental::NoOpCertificateVerifier>());
  if (!where.certificate.empty()) {
    Result<std::string> certificate = read_small_file(where.certificate, "--tls-cert"),
                        key = read_small_file(where.key, "--tls-key");
    if (!certificate) return tl::unexpected(std::move(certificate.error()));
    if (!key) return tl::unexpected(std::move(key.error()));
    options.set_certificate_provider(std::make_shared<grpc::experimental::StaticDataCertificateProvider>(
        std::vector<grpc::experimental::IdentityKeyCertPair>{{std::move(*key), std::move(*certificate)}}));
    options.watch_identity_key_cert_pairs();
  }
  return grpc::experimental::TlsCredentials(options);
}

}  // namespace

int check_health(const HealthAddress& where, const std::string& service, std::ostream& out, std::ostream& err) {
  namespace health = grpc::health::v1;
  const std::string& address = where.address;
  const Result<ChannelCredentials> credentials = credentials_for(where);
  if (!credentials) {
    err << address << ": " << service << " is not known: " << to_string(credentials.error()) << '\n';
    return 1;
  }
  grpc::ChannelArguments arguments;
  arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);  // a proxy that the environment names is not for this host
  const auto stub = health::Health::NewStub(grpc::CreateCustomChannel(address, *credentials, arguments));
  grpc::ClientContext context;
  context.set_deadline(std::chrono::system_clock::now() + kPatience);
  Timers timers;  // gRPC's own may be late (server/rpc/timers.h)
  timers.start(2 * kPatience, [&context] { context.TryCancel(); });
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
  err << address << ": " << service << " is " << health::HealthCheckResponse::ServingStatus_Name(response.status())
      << '\n';
  return 1;
}

}  // namespace sightline
