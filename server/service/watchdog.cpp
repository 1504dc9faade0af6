#include "server/service/watchdog.h"

#include <sys/prctl.h>

#include <utility>

namespace sightline {

Watchdog::Watchdog(std::vector<Watched> watched, Seconds limit, Seconds period, Look look)
    : watched_(std::move(watched)), limit_(limit), period_(period), look_(std::move(look)), thread_([this] {
        run();
      }) {}

Watchdog::~Watchdog() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

std::vector<std::string> Watchdog::hanging() const {
  std::vector<std::string> names;
  for (const Watched& watched : watched_)
    if (watched.silence() > limit_) names.push_back(watched.name);
  return names;
}

void Watchdog::run() {
  ::prctl(PR_SET_NAME, "watchdog");  // for ps and debuggers
  MutexLock lock(mutex_);
  while (!stopping_) {
    lock.unlock();
    look_(hanging());
    lock.lock();
    wake_.wait_for(lock, period_, [this]() NEEDS(mutex_) { return stopping_; });
  }
}

}  // namespace sightline
