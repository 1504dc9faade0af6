// RPCs GetServerInfo (version and sampler) and GetServerStats (counters of the daemon, and what it holds).
#pragma once

#include <cstdint>
#include <string_view>
#include <utility>
#include <vector>

#include "server/service/callers.h"
#include "server/service/parts.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

inline constexpr const char* kVersion = SIGHTLINE_VERSION;
// The compiler and those options that can change a reply.
inline constexpr const char* kBuild = SIGHTLINE_BUILD;

void get_server_info(const ServiceParts& parts, v1::GetServerInfoResponse& info);
// How often each limit refused or ended something, by the flag that sets it, without dashes.
std::vector<std::pair<std::string_view, uint64_t>> limit_hits(const ServiceParts& parts, const GateCounts& gate);
// Sets everything but `ready`.
void get_server_stats(const ServiceParts& parts, const Callers& callers, v1::GetServerStatsResponse& stats);

}  // namespace sightline
