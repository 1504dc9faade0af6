// Threads for work that can take seconds: reading scenes, opening sessions. No step waits for it.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace sightline {

// Runs tasks on `threads` threads, in the order in which they were posted. The queue has no bound of its own. Every
// stream and upload keeps at most one task in it, and their number is limited. Thread-safe.
class WorkerPool {
 public:
  explicit WorkerPool(unsigned threads);
  // Runs the queued tasks, then joins the threads. Nothing may be posted from then on.
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // Tasks must not throw.
  void post(std::function<void()> task);
  unsigned threads() const { return static_cast<unsigned>(threads_.size()); }

 private:
  void work();

  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> tasks_;  // guarded by mutex_
  bool stopping_ = false;                    // guarded by mutex_
  std::vector<std::thread> threads_;         // constant after construction
};

}  // namespace sightline
