// RPCs GetServerInfo and GetServerStats: what runs here; what it has done and what it holds.
#pragma once

#include "server/service/parts.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

inline constexpr const char* kVersion = SIGHTLINE_VERSION;
// Compiler and options, as far as they can change a reply.
inline constexpr const char* kBuild = SIGHTLINE_BUILD;

void get_server_info(const ServiceParts& parts, v1::GetServerInfoResponse& info);
void get_server_stats(const ServiceParts& parts, v1::GetServerStatsResponse& stats);

}  // namespace sightline
