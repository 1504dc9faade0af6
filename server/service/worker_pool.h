// Threads that do the work of sessions, so that gRPC's own threads never wait.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace sightline {

// Runs tasks in the order in which they were posted, on `threads` threads. The queue has no bound of its own:
// every poster keeps at most one task in it (a stream is posted again only after its task ran), so it is as
// long as there are streams, uploads and calls, which are limited. Thread-safe.
class WorkerPool {
 public:
  explicit WorkerPool(unsigned threads);
  // Runs what is queued, then joins. Nothing may be posted from then on.
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
