// Threads for work that can take seconds: reading scenes, opening sessions. No step waits for it.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <list>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

namespace sightline {

// Runs tasks on `threads` threads. Clients take turns: one that has many tasks delays another's by one task for each thread. The
// tasks of one client start in the order in which they were posted. The queue has no bound of its own. Every
// stream and upload keeps at most one task in it, and their number is limited. Thread-safe.
class WorkerPool {
 public:
  explicit WorkerPool(unsigned threads);
  // Runs the queued tasks, then joins the threads. Nothing may be posted from then on.
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // Tasks must not throw. `client` is the name of the client that it is for. Throws std::bad_alloc, and has posted nothing then.
  void post(std::function<void()> task, const std::string& client = {});
  unsigned threads() const { return static_cast<unsigned>(threads_.size()); }

 private:
  using Task = std::function<void()>;
  void work();
  // These need mutex_; `take` also needs a task.
  void begin_turns(const std::string& client, Task task);
  Task take();

  std::mutex mutex_;
  std::condition_variable wake_;
  // Guarded by mutex_.
  std::map<std::string, std::deque<Task>> tasks_;  // by client; none is empty
  std::list<std::string> turns_;                   // the clients of tasks_, next first
  bool stopping_ = false;

  std::vector<std::thread> threads_;  // constant after construction
};

}  // namespace sightline
