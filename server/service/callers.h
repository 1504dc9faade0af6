// Who calls: the bearer token of a call, together with what the gate knows of its connection.
#pragma once

#include <grpcpp/server_context.h>
#include <grpcpp/support/status.h>

#include <tl/expected.hpp>

#include "server/gate/credentials.h"
#include "server/gate/gate.h"

namespace sightline {

// Thread-safe.
class Callers {
 public:
  // `credentials` must outlive it.
  explicit Callers(const Credentials& credentials) : credentials_(credentials) {}

  // Called once, before the first call. Without a gate, callers are named by their peer.
  void come_through(const Gate& gate) { gate_ = &gate; }

  // The caller, or the status that refuses the call: UNAUTHENTICATED when it may not speak, PERMISSION_DENIED when its
  // role does not allow this.
  tl::expected<Caller, grpc::Status> identify(const grpc::ServerContext& context, Need need) const;

  const Credentials& credentials() const { return credentials_; }
  GateCounts connections() const { return gate_ ? gate_->counts() : GateCounts{}; }

 private:
  const Credentials& credentials_;
  const Gate* gate_ = nullptr;
};

}  // namespace sightline
