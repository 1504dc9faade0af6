#include "server/base/thread_pool.h"

#include <chrono>
#include <system_error>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace sightline {
namespace {

// Longer than the parts of a step that use one thread.
constexpr std::chrono::microseconds kSpin(500);
constexpr int kChecksBetweenClocks = 32;
// Runs without helpers after one lost its core: the milliseconds lost then are little compared with so many runs.
constexpr int kAloneAfterLoss = 256;

void pause() {
#if defined(__x86_64__)
  _mm_pause();
#else
  std::this_thread::yield();
#endif
}

// Spins until `condition` holds; false when it does not within kSpin. Most waits are shorter than going to sleep and
// waking up.
template <typename Condition>
bool spin_until(Condition condition) {
  const auto end = std::chrono::steady_clock::now() + kSpin;
  do {
    for (int i = 0; i < kChecksBetweenClocks; ++i) {
      if (condition()) return true;
      pause();
    }
  } while (std::chrono::steady_clock::now() < end);
  return false;
}

}  // namespace

ThreadPool::ThreadPool(size_t size) {
  try {
    while (helpers_.size() + 1 < size) {
      const size_t thread = helpers_.size() + 1;
      helpers_.emplace_back([this, thread] { help(thread); });
    }
  } catch (const std::system_error&) {  // the system starts no more threads: go on with those that run
  }
}

ThreadPool::~ThreadPool() {
  {
    const MutexLock lock(mutex_);
    ended_ = true;
    ++calls_;
  }
  called_.notify_all();
  for (std::thread& helper : helpers_) helper.join();
}

void ThreadPool::run(const std::function<void(size_t)>& work) {
  if (alone_ > 0) {
    --alone_;
    return work(0);
  }
  {
    const MutexLock lock(mutex_);
    work_ = &work;
    ++calls_;
  }
  called_.notify_all();
  work(0);
  {
    const MutexLock lock(mutex_);
    work_ = nullptr;
  }
  if (spin_until([this] { return inside_ == 0; })) return;
  alone_ = kAloneAfterLoss;
  MutexLock lock(mutex_);
  left_.wait(lock, [this] { return inside_ == 0; });
}

void ThreadPool::help(size_t thread) {
  uint64_t known_calls = 0;
  while (true) {
    spin_until([&] { return calls_ != known_calls; });
    MutexLock lock(mutex_);
    called_.wait(lock, [&] { return calls_ != known_calls; });
    if (ended_) return;
    known_calls = calls_;
    if (!work_) continue;  // woke up after the run
    const std::function<void(size_t)>& work = *work_;
    ++inside_;
    lock.unlock();
    work(thread);
    lock.lock();
    if (--inside_ == 0) left_.notify_one();
  }
}

}  // namespace sightline
