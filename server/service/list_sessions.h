// RPC ListSessions: the open sessions, and what their cameras show.
#pragma once

#include <cstdint>

#include "server/service/session_table.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

void camera_figures_to_proto(const CameraSums& sums, v1::CameraFigures& out);
// `now_ns` is by the clock of the steps.
void list_sessions(const SessionTable& table, int64_t now_ns, v1::ListSessionsResponse& response);

}  // namespace sightline
