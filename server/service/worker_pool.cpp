#include "server/service/worker_pool.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <utility>

namespace sightline {

WorkerPool::WorkerPool(unsigned threads, int niceness) : most_of_client_(std::max(1u, threads - 1)) {
  threads_.reserve(threads);
  for (unsigned i = 0; i < threads; ++i) threads_.emplace_back([this, niceness] { work(niceness); });
}

WorkerPool::~WorkerPool() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

// A client is known with all that it needs for its turns, or not at all: they allocate nothing, since the threads of
// the pool have nobody to tell that there is no memory.
void WorkerPool::post(Task task, const std::string& client) {
  {
    const MutexLock lock(mutex_);
    const auto [known, is_new] = clients_.try_emplace(client);
    try {
      if (is_new) known->second.turn.push_back(known);
      known->second.tasks.push_back(std::move(task));
    } catch (...) {
      if (is_new) clients_.erase(known);
      throw;
    }
    ++waiting_;
    give_turn(known->second);
  }
  wake_.notify_one();
}

void WorkerPool::give_turn(Client& client) {
  if (client.turn.empty() || client.tasks.empty() || client.running >= most_of_client_) return;
  turns_.splice(turns_.end(), client.turn);
}

WorkerPool::Clients::iterator WorkerPool::take(Task& task) {
  const Clients::iterator taken = turns_.front();
  Client& client = taken->second;
  client.turn.splice(client.turn.end(), turns_, turns_.begin());
  task = std::move(client.tasks.front());
  client.tasks.pop_front();
  --waiting_;
  ++client.running;
  give_turn(client);
  return taken;
}

void WorkerPool::finish(Clients::iterator client) {
  --client->second.running;
  give_turn(client->second);
  if (client->second.running == 0 && client->second.tasks.empty()) clients_.erase(client);
}

void WorkerPool::work(int niceness) {
  if (niceness > 0) (void)::setpriority(PRIO_PROCESS, static_cast<id_t>(::gettid()), niceness);
  MutexLock lock(mutex_);
  for (;;) {
    wake_.wait(lock, [this]() NEEDS(mutex_) { return !turns_.empty() || (stopping_ && waiting_ == 0); });
    if (turns_.empty()) return;
    Task task;
    const auto client = take(task);
    lock.unlock();
    task();
    task = nullptr;  // what it holds may be large
    lock.lock();
    finish(client);
    wake_.notify_all();
  }
}

}  // namespace sightline
