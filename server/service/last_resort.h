// Ends the process when its orderly end takes too long.
//
// A daemon that is asked to stop joins its threads. One of them may be in a library that does not come back. The
// platform would kill the daemon later, and recordings would lose what is still in memory.
#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <thread>

#include "server/base/mutex.h"

namespace sightline {

class LastResort {
 public:
  using Duration = std::chrono::steady_clock::duration;

  static constexpr std::chrono::seconds kRescueTime{4};

  // `end` ends the process. `rescue_time`: how long it waits for the rescue.
  explicit LastResort(std::function<void()> end, Duration rescue_time = kRescueTime);
  // The end was orderly.
  ~LastResort();
  LastResort(const LastResort&) = delete;
  LastResort& operator=(const LastResort&) = delete;

  // When `after` has passed, `rescue` runs on a thread of its own. Once it is over, or has taken too long, `end`
  // follows. Called again it sets another time.
  void arm(Duration after, std::function<void()> rescue);

 private:
  void run();

  const std::function<void()> end_;
  const Duration rescue_time_;
  Mutex mutex_;
  ConditionVariable changed_;
  std::optional<std::chrono::steady_clock::time_point> deadline_ GUARDED(mutex_);
  std::function<void()> rescue_ GUARDED(mutex_);
  bool stopping_ GUARDED(mutex_) = false;

  std::thread thread_;
};

}  // namespace sightline
