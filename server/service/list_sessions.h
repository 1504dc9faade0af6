// RPC ListSessions: the open sessions, and what their cameras show, in pages.
#pragma once

#include <grpcpp/support/status.h>

#include <cstdint>
#include <string>

#include "server/service/session_table.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

inline constexpr uint32_t kMaxListedSessions = 1000;  // per page, about 250 bytes each; also the default

void camera_figures_to_proto(const CameraSums& sums, v1::CameraFigures& out);
// `now_ns` is by the clock of the steps. A page's token is the number of its last session, so a page is right even if
// sessions open and end between two calls. It begins with `id_prefix` (ServiceParts). So a token of another daemon, or
// of this one before it started again, is not taken for one of this daemon. INVALID_ARGUMENT names `page_size` when it
// is over kMaxListedSessions, and `page_token` when the token is not one of this daemon.
grpc::Status list_sessions(const SessionTable& table, const std::string& id_prefix, int64_t now_ns,
                           const v1::ListSessionsRequest& request, v1::ListSessionsResponse& response);

}  // namespace sightline
