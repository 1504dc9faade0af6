// A thread pool for work that is repeated often and takes a fraction of a millisecond, such as the maps of one step.
// parallel_for (parallel.h) starts its threads in each call and is meant for longer work.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <thread>
#include <vector>

#include "server/base/mutex.h"

namespace sightline {

// Used by one thread at a time. After a run the pool's threads spin for half a millisecond, then sleep. When a thread
// loses its core in the middle of a run, the caller waits for it. The caller then does the next 256 runs alone, so that
// the pool costs little on a busy machine.
class ThreadPool {
 public:
  // `size` threads, at least 1, including the caller's. Fewer when the system refuses to start more.
  explicit ThreadPool(size_t size);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  size_t size() const { return helpers_.size() + 1; }

  // Calls work(0) on this thread, and work(k), 0 < k < size(), on each other thread that wakes up before work(0) has
  // returned. Returns when all calls have. A late thread is not waited for, so `work` must take pieces from a shared
  // counter until none is left. `work` must not throw.
  void run(const std::function<void(size_t thread)>& work);

 private:
  void help(size_t thread);

  Mutex mutex_;
  ConditionVariable called_, left_;
  const std::function<void(size_t)>* work_ GUARDED(mutex_) = nullptr;  // null between runs
  bool ended_ GUARDED(mutex_) = false;
  std::atomic<uint64_t> calls_{0};  // changes under mutex_
  std::atomic<size_t> inside_{0};   // helpers inside `work`; changes under mutex_
  int alone_ = 0;                   // number of coming runs without helpers
  std::vector<std::thread> helpers_;
};

}  // namespace sightline
