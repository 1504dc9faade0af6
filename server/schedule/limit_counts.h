// How often each limit refused or ended something. Counting takes no locks.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "server/base/error.h"

namespace sightline {

// The limits that have no counter elsewhere. Those of connections are counted by the gate (GateCounts), and uploads
// that make way by the scene library (SceneLibrary::DroppedUploads).
enum class Limit : size_t {
  kMaxSessions,
  kMaxSessionsPerClient,
  kMaxMessage,
  kMaxMessageMemory,
  kSessionMemory,
  kSessionsMemory,
  kMaxStepCost,
  kMaxMaps,
  kMaxUpload,  // one file, or all uploads in progress together
  kMaxUploads,
  kOpenTimeout,
  kSessionIdle,
  kUploadTimeout,
  kGeometryMemory,
  kMessagesMemory,
  kClientMemory,
  kClientScenesMemory,
  kReflectionCalls,
  kHealthWatches,
  kMaxLoad,
  kCount
};

// The flags that set them, without dashes, in the order of the enum.
inline constexpr std::array<const char*, static_cast<size_t>(Limit::kCount)> kLimitNames{"max-sessions",
                                                                                         "max-sessions-per-client",
                                                                                         "max-message-mib",
                                                                                         "max-message-memory-mib",
                                                                                         "session-memory-mib",
                                                                                         "sessions-memory-mib",
                                                                                         "max-step-cost-ms",
                                                                                         "max-maps-ms",
                                                                                         "max-upload-mib",
                                                                                         "max-uploads",
                                                                                         "open-timeout-s",
                                                                                         "session-idle-s",
                                                                                         "upload-timeout-s",
                                                                                         "geometry-memory-mib",
                                                                                         "messages-memory-mib",
                                                                                         "client-memory-mib",
                                                                                         "client-scenes-memory-mib",
                                                                                         "max-reflection-calls",
                                                                                         "max-health-watches",
                                                                                         "max-load-s"};

// The limit whose flag a refusal names, as "(--max-uploads)". Other errors, which may quote what a client sent, name
// none.
inline std::optional<Limit> limit_of(const Error& refusal) {
  if (refusal.code != ErrorCode::kResourceExhausted) return std::nullopt;
  for (size_t i = 0; i < kLimitNames.size(); ++i)
    if (refusal.message.find("(--" + std::string(kLimitNames[i]) + ")") != std::string::npos)
      return static_cast<Limit>(i);
  return std::nullopt;
}

// Thread-safe.
class LimitCounts {
 public:
  void hit(Limit limit) { counts_[static_cast<size_t>(limit)].fetch_add(1, std::memory_order_relaxed); }
  uint64_t count(Limit limit) const { return counts_[static_cast<size_t>(limit)].load(std::memory_order_relaxed); }

 private:
  std::array<std::atomic<uint64_t>, kLimitNames.size()> counts_{};
};

}  // namespace sightline
