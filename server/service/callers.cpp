#include "server/service/callers.h"

#include <strings.h>

#include <optional>
#include <string_view>

namespace sightline {
namespace {

constexpr char kMetadata[] = "authorization";
constexpr std::string_view kScheme = "Bearer ";

// The token that was sent. Metadata of another form is a token that nobody has.
std::optional<std::string_view> token_of(const grpc::ServerContext& context) {
  const auto& metadata = context.client_metadata();
  const auto [first, last] = metadata.equal_range(kMetadata);
  if (first == last) return std::nullopt;
  const std::string_view value(first->second.data(), first->second.size());
  const bool bearer = value.size() > kScheme.size() && ::strncasecmp(value.data(), kScheme.data(), kScheme.size()) == 0;
  return bearer && std::next(first) == last ? value.substr(kScheme.size()) : std::string_view();
}

}  // namespace

tl::expected<Caller, grpc::Status> Callers::identify(const grpc::ServerContext& context, Need need) const {
  const std::string name = context.peer();
  const Peer peer = gate_ ? gate_->peer_of(name) : Peer{name, std::nullopt, {}, false};
  auto caller = credentials_.access().identify(peer, token_of(context), need);
  if (caller) {
    if (gate_) gate_->note_accepted(name);
    return std::move(*caller);
  }
  const auto code = caller.error().known ? grpc::StatusCode::PERMISSION_DENIED : grpc::StatusCode::UNAUTHENTICATED;
  return tl::unexpected(grpc::Status(code, caller.error().reason));
}

}  // namespace sightline
