// Whether the daemon is alive, and whether it is ready for sessions.
#pragma once

#include <string>
#include <vector>

#include "server/base/mutex.h"

namespace sightline {

// Thread-safe.
class DaemonState {
 public:
  enum class Phase { kStarting, kServing, kStopping };

  void enter(Phase phase);
  // The names of the threads that hang now. True when they are not those of the call before.
  bool set_hanging(const std::vector<std::string>& names);

  std::vector<std::string> hanging() const;
  // Ready: it serves, and no thread hangs.
  bool ready() const { return why_not_ready().empty(); }
  // In words, for a person; empty when it is ready, or alive.
  std::string why_not_ready() const;
  std::string why_not_alive() const;

 private:
  std::string hanging_text() const NEEDS(mutex_);

  mutable Mutex mutex_;
  Phase phase_ GUARDED(mutex_) = Phase::kStarting;
  std::vector<std::string> hanging_ GUARDED(mutex_);
};

}  // namespace sightline
