#include "server/rpc/timers.h"

#include <sys/prctl.h>

#include <algorithm>

namespace sightline {

using std::chrono::steady_clock;

Timers::Timers() : thread_([this] { run(); }) {}

Timers::~Timers() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

Timers::Timer Timers::start(Duration after, Action action) {
  const MutexLock lock(mutex_);
  const Timer timer(steady_clock::now() + after, ++last_number_);
  const auto at = actions_.emplace(timer, std::move(action)).first;
  if (at == actions_.begin()) changed_.notify_all();
  return timer;
}

// The action may hold the last reference to something, which must not be destroyed under the lock.
bool Timers::cancel(const Timer& timer) {
  Action cancelled;
  const MutexLock lock(mutex_);
  const auto at = actions_.find(timer);
  if (at == actions_.end()) return false;
  cancelled = std::move(at->second);
  actions_.erase(at);
  return true;
}

Timers::Duration Timers::late() const {
  const MutexLock lock(mutex_);
  const auto now = steady_clock::now();
  if (runs_since_) return now - *runs_since_;
  return actions_.empty() ? Duration::zero() : std::max(Duration::zero(), now - actions_.begin()->first.first);
}

void Timers::run() {
  ::prctl(PR_SET_NAME, "timers");  // for ps and debuggers
  MutexLock lock(mutex_);
  while (!stopping_) {
    const auto first = actions_.begin();
    if (first == actions_.end()) {
      changed_.wait(lock);
    } else if (const auto due = first->first.first; due > steady_clock::now()) {
      changed_.wait_until(lock, due);
    } else {
      Action action = std::move(first->second);
      actions_.erase(first);
      runs_since_ = steady_clock::now();
      lock.unlock();
      action();
      action = nullptr;
      lock.lock();
      runs_since_.reset();
    }
  }
}

}  // namespace sightline
