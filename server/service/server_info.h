// RPC GetServerInfo: the version, the sampler, and counters of the daemon.
#pragma once

#include "server/service/parts.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

inline constexpr const char* kVersion = SIGHTLINE_VERSION;
// The compiler and those options that can change a reply.
inline constexpr const char* kBuild = SIGHTLINE_BUILD;

void get_server_info(const ServiceParts& parts, v1::ServerInfo& info);

}  // namespace sightline
