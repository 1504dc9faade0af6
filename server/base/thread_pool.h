// A crew: threads that wait to lend a hand with work that is done over and over and takes a fraction of a millisecond, as the maps of
// one step. parallel_for (parallel.h), which starts its threads each time, is for work that takes longer.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace sightline {

// Used by one thread at a time. After work its helpers watch for more for half a millisecond, which keeps their cores busy; then they
// sleep. One that loses its core amid work is waited for; then the work to come is done without helpers for a while, so that on a
// machine where others want the cores little is lost.
class ThreadPool {
 public:
  // So many hands, at least 1, that of the caller among them. Where no thread can be had there are fewer.
  explicit ThreadPool(size_t hands);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  size_t size() const { return helpers_.size() + 1; }

  // Calls work(0) here, and work(k), k < size(), on each helper that comes before that has returned; returns when all are done. Nobody
  // waits for a helper to come: so each takes its share from what is left until nothing is. `work` throws nothing.
  void run(const std::function<void(size_t hand)>& work);

 private:
  void help(size_t hand);

  std::mutex mutex_;
  std::condition_variable called_, left_;
  const std::function<void(size_t)>* work_ = nullptr;  // guarded by mutex_; null: nothing to join in
  bool ended_ = false;                                 // guarded by mutex_
  std::atomic<uint64_t> calls_{0};                     // changes under mutex_
  std::atomic<size_t> inside_{0};                      // helpers at work; changes under mutex_
  int alone_ = 0;                                      // so many runs to come are without helpers
  std::vector<std::thread> helpers_;
};

}  // namespace sightline
