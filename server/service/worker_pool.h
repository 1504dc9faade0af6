// Threads for work that can take seconds: reading scenes, opening sessions. No step waits for it.
#pragma once

#include <deque>
#include <functional>
#include <list>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "server/base/mutex.h"

namespace sightline {

// Runs tasks on `threads` threads. Clients take turns: one that has many tasks delays another's by one task for each
// thread. With several threads one client has at most all but one of them, so that the next client need not wait for
// its long tasks. The tasks of one client start in the order in which they were posted. The queue has no bound of its
// own. Every stream and upload keeps at most one task in it, and their number is limited. Thread-safe.
class WorkerPool {
 public:
  // The system gives its threads less time beside others that want it, the higher `niceness` is, at most 19.
  explicit WorkerPool(unsigned threads, int niceness = 0);
  // Runs the queued tasks, then joins the threads. Nothing may be posted from then on.
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // Tasks must not throw. `client` is the name of the client that it is for. Throws std::bad_alloc, and has posted
  // nothing then.
  void post(std::function<void()> task, const std::string& client = {});
  unsigned threads() const { return static_cast<unsigned>(threads_.size()); }

 private:
  using Task = std::function<void()>;
  struct Client;
  using Clients = std::map<std::string, Client>;
  using Turns = std::list<Clients::iterator>;
  struct Client {
    std::deque<Task> tasks;
    unsigned running = 0;
    Turns turn;  // its place in turns_, while it is not there
  };

  void work(int niceness);
  void give_turn(Client& client) NEEDS(mutex_);
  // There must be a turn.
  Clients::iterator take(Task& task) NEEDS(mutex_);
  void finish(Clients::iterator client) NEEDS(mutex_);

  const unsigned most_of_client_;
  Mutex mutex_;
  ConditionVariable wake_;
  Clients clients_ GUARDED(mutex_);     // that have tasks, waiting or running
  Turns turns_ GUARDED(mutex_);         // those whose next task may run, next first
  size_t waiting_ GUARDED(mutex_) = 0;  // tasks of all clients
  bool stopping_ GUARDED(mutex_) = false;

  std::vector<std::thread> threads_;  // constant after construction
};

}  // namespace sightline
