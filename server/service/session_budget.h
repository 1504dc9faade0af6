// What one session may take of the server: the memory of its instances and of what its steps keep, and the cost of its
// steps.
#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <utility>

#include "server/base/error.h"
#include "server/base/mutex.h"
#include "server/scene/target.h"
#include "server/schedule/limit_counts.h"
#include "server/settings/step_settings.h"

namespace sightline {

struct SessionLimits {
  size_t session_bytes = 0;       // of the instances, the shapes and the state of one session; 0: no limit
  double max_step_cost_ms = 0.0;  // see step_cost_ms; 0: no limit
};

// About what an instance takes in the mirror and in the structures that are made from it.
inline constexpr size_t kBytesOfInstance = 400;

// The instances, shapes and states of all sessions together, and of those of each client. Thread-safe.
class InstanceMemory {
 public:
  enum class Answer { kDone, kAllFull, kClientFull };

  InstanceMemory(size_t max_bytes, size_t max_client_bytes)
      : max_bytes_(max_bytes), max_client_bytes_(max_client_bytes) {}

  // One session of the client goes from `former` to `now` bytes. With any other answer than kDone nothing has changed.
  // Throws std::bad_alloc only when it grows, and has changed nothing then.
  Answer change(const std::string& client, size_t former, size_t now);

 private:
  const size_t max_bytes_, max_client_bytes_;
  Mutex mutex_;
  size_t bytes_ GUARDED(mutex_) = 0;
  std::map<std::string, size_t> clients_ GUARDED(mutex_);  // those that have any
};

// Counts the instances, the shapes and the state of one session in both limits until it is destroyed.
class InstanceShare {
 public:
  // `memory` may be null: then only the session's own limit holds. `counts`, which may be null, counts refusals.
  InstanceShare(const SessionLimits& limits, InstanceMemory* memory, std::string client, LimitCounts* counts = nullptr)
      : limits_(limits), memory_(memory), client_(std::move(client)), counts_(counts) {}
  ~InstanceShare() { (void)resize(0, 0, 0, ""); }
  InstanceShare(const InstanceShare&) = delete;
  InstanceShare& operator=(const InstanceShare&) = delete;

  // Fails with kResourceExhausted, and `field`; then nothing has changed. `shape_bytes`: of the distinct shapes, each
  // once. `state_bytes`: as session_state_bytes.
  Status resize(size_t instances, size_t shape_bytes, size_t state_bytes, const char* field);

 private:
  void hit(Limit limit) const {
    if (counts_) counts_->hit(limit);
  }
  Status change(size_t bytes, const char* field);

  const SessionLimits& limits_;
  InstanceMemory* const memory_;
  const std::string client_;
  LimitCounts* const counts_;
  size_t bytes_ = 0;
};

// About what a session keeps from step to step, in bytes: maps, and what is known of each candidate for each target.
size_t session_state_bytes(const StepSettings& settings, size_t targets);

// A rough upper estimate of the time of a step with these settings on one core of an ordinary CPU, in milliseconds. It
// counts the rays of the maps, the lookups of the candidates in them, and the spreading of points over the parts of
// targets (`parts`: of all targets together).
double step_cost_ms(const StepSettings& settings, size_t targets, size_t parts = 0);
// Fails with kResourceExhausted, and `field`, when a step would cost too much.
Status check_step_cost(const StepSettings& settings, std::span<const Target> targets, const SessionLimits& limits,
                       const char* field);

}  // namespace sightline
