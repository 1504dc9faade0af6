// Watches the threads of the daemon, and says when one of them hangs.
//
// A thread hangs when it has not gone round for the limit: an event loop, the timers or a thread of the gate that do
// not come back to wait for the next event, or a stepping thread that is still at the same round of steps. A hung
// daemon fails its liveness, so that what runs it can restart it. The threads that read scenes and open sessions
// (WorkerPool) are not watched. On a small share of a CPU a large scene may take longer than the limit. A restart would
// then lose every session, and the next attempt would be no faster.
#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "server/base/mutex.h"

namespace sightline {

class Watchdog {
 public:
  using Seconds = std::chrono::duration<double>;
  struct Watched {
    std::string name;                  // "event loop"
    std::function<Seconds()> silence;  // since it last went round; called from any thread, must not wait
  };
  // Runs on the watchdog's thread after each look, with the names of what hangs; usually none.
  using Look = std::function<void(const std::vector<std::string>& hanging)>;

  // Looks every `period`. What `watched` and `look` refer to must outlive it.
  Watchdog(std::vector<Watched> watched, Seconds limit, Seconds period, Look look);
  ~Watchdog();
  Watchdog(const Watchdog&) = delete;
  Watchdog& operator=(const Watchdog&) = delete;

  // The names of what hangs now. From any thread.
  std::vector<std::string> hanging() const;

 private:
  void run();

  const std::vector<Watched> watched_;
  const Seconds limit_, period_;
  const Look look_;
  Mutex mutex_;
  ConditionVariable wake_;
  bool stopping_ GUARDED(mutex_) = false;
  std::thread thread_;
};

}  // namespace sightline
