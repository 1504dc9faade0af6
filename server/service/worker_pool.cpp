#include "server/service/worker_pool.h"

#include <utility>

namespace sightline {

WorkerPool::WorkerPool(unsigned threads) {
  threads_.reserve(threads);
  for (unsigned i = 0; i < threads; ++i) threads_.emplace_back([this] { work(); });
}

WorkerPool::~WorkerPool() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void WorkerPool::post(Task task, const std::string& client) {
  {
    const std::lock_guard lock(mutex_);
    const auto known = tasks_.find(client);
    known == tasks_.end() ? begin_turns(client, std::move(task)) : known->second.push_back(std::move(task));
  }
  wake_.notify_one();
}

// Both lists have the client, or neither.
void WorkerPool::begin_turns(const std::string& client, Task task) {
  std::list<std::string> turn{client};
  std::deque<Task> first;
  first.push_back(std::move(task));
  tasks_.emplace(client, std::move(first));
  turns_.splice(turns_.end(), turn);
}

// Allocates nothing, since the threads of the pool have nobody to tell that there is no memory.
WorkerPool::Task WorkerPool::take() {
  const auto of_client = tasks_.find(turns_.front());
  Task task = std::move(of_client->second.front());
  of_client->second.pop_front();
  turns_.splice(turns_.end(), turns_, turns_.begin());
  if (!of_client->second.empty()) return task;
  tasks_.erase(of_client);
  turns_.pop_back();
  return task;
}

void WorkerPool::work() {
  for (;;) {
    std::unique_lock lock(mutex_);
    wake_.wait(lock, [this] { return stopping_ || !tasks_.empty(); });
    if (tasks_.empty()) return;
    const Task task = take();
    lock.unlock();
    task();
  }
}

}  // namespace sightline
