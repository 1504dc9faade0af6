// Timers of the daemon's own: a thread that waits by the steady clock.
//
// gRPC 1.51 waits for its timers by the wall clock. When that is set back by a minute, they all come a minute late,
// those with a steady deadline too. So what has to happen in time does not use them: grpc::Alarm, and the deadline of
// grpc::Server::Shutdown.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <thread>
#include <utility>

#include "server/base/mutex.h"

namespace sightline {

// Thread-safe. It must outlive what its actions refer to, or every timer must have been cancelled.
class Timers {
 public:
  using Duration = std::chrono::steady_clock::duration;
  // Runs on the thread of the timers, and must return at once. It must not throw.
  using Action = std::function<void()>;
  // Names a timer that was started.
  using Timer = std::pair<std::chrono::steady_clock::time_point, uint64_t>;

  Timers();
  // Timers that have not run out never will.
  ~Timers();
  Timers(const Timers&) = delete;
  Timers& operator=(const Timers&) = delete;

  Timer start(Duration after, Action action);
  // True: the action will not run. False: it has run, or is running now.
  bool cancel(const Timer& timer);
  // For how long an action has run, or should have: about zero unless the thread hangs.
  Duration late() const;

 private:
  using Time = std::chrono::steady_clock::time_point;

  void run();

  mutable Mutex mutex_;
  ConditionVariable changed_;
  std::map<Timer, Action> actions_ GUARDED(mutex_);  // by their time
  std::optional<Time> runs_since_ GUARDED(mutex_);   // of the action that runs now
  uint64_t last_number_ GUARDED(mutex_) = 0;
  bool stopping_ GUARDED(mutex_) = false;

  std::thread thread_;
};

}  // namespace sightline
