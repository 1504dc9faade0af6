#include "server/service/daemon_state.h"

namespace sightline {

void DaemonState::enter(Phase phase) {
  const MutexLock lock(mutex_);
  phase_ = phase;
}

bool DaemonState::set_hanging(const std::vector<std::string>& names) {
  const MutexLock lock(mutex_);
  const bool changed = names != hanging_;
  hanging_ = names;
  return changed;
}

std::vector<std::string> DaemonState::hanging() const {
  const MutexLock lock(mutex_);
  return hanging_;
}

std::string DaemonState::hanging_text() const {
  std::string text;
  for (const std::string& name : hanging_) text += (text.empty() ? "does not answer: " : ", ") + name;
  return text;
}

std::string DaemonState::why_not_alive() const {
  const MutexLock lock(mutex_);
  return hanging_text();
}

std::string DaemonState::why_not_ready() const {
  const MutexLock lock(mutex_);
  if (phase_ == Phase::kStarting) return "the daemon is starting";
  if (phase_ == Phase::kStopping) return "the daemon is stopping";
  return hanging_text();
}

}  // namespace sightline
