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
    if (!tasks_.contains(client)) turns_.push_back(client);
    tasks_[client].push_back(std::move(task));
  }
  wake_.notify_one();
}

WorkerPool::Task WorkerPool::take() {
  const auto of_client = tasks_.find(turns_.front());
  Task task = std::move(of_client->second.front());
  of_client->second.pop_front();
  if (of_client->second.empty())
    tasks_.erase(of_client);
  else
    turns_.push_back(turns_.front());
  turns_.pop_front();
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
