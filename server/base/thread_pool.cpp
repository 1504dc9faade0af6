#include "server/base/thread_pool.h"

#include <chrono>
#include <system_error>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace sightline {
namespace {

// Longer than a step does other things than what its helpers help with.
constexpr std::chrono::microseconds kWatch(500);
constexpr int kLooksBetweenClocks = 32;
// So many runs are without helpers when one lost its core: what was lost then, some milliseconds, is little beside them.
constexpr int kAloneAfterLoss = 256;

void breathe() {
#if defined(__x86_64__)
  _mm_pause();
#else
  std::this_thread::yield();
#endif
}

// Looks until it is so, or for kWatch: then false. Going to sleep and being woken would take longer than most of what is waited for.
template <typename IsSo>
bool look_until(IsSo is_so) {
  const auto end = std::chrono::steady_clock::now() + kWatch;
  do {
    for (int i = 0; i < kLooksBetweenClocks; ++i) {
      if (is_so()) return true;
      breathe();
    }
  } while (std::chrono::steady_clock::now() < end);
  return false;
}

}  // namespace

ThreadPool::ThreadPool(size_t hands) {
  try {
    while (helpers_.size() + 1 < hands) {
      const size_t hand = helpers_.size() + 1;
      helpers_.emplace_back([this, hand] { help(hand); });
    }
  } catch (const std::system_error&) {  // no more threads: those that there are do it
  }
}

ThreadPool::~ThreadPool() {
  {
    const std::lock_guard lock(mutex_);
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
    const std::lock_guard lock(mutex_);
    work_ = &work;
    ++calls_;
  }
  called_.notify_all();
  work(0);
  {
    const std::lock_guard lock(mutex_);
    work_ = nullptr;
  }
  if (look_until([this] { return inside_ == 0; })) return;
  alone_ = kAloneAfterLoss;
  std::unique_lock lock(mutex_);
  left_.wait(lock, [this] { return inside_ == 0; });
}

void ThreadPool::help(size_t hand) {
  uint64_t known_calls = 0;
  while (true) {
    look_until([&] { return calls_ != known_calls; });
    std::unique_lock lock(mutex_);
    called_.wait(lock, [&] { return calls_ != known_calls; });
    if (ended_) return;
    known_calls = calls_;
    if (!work_) continue;  // too late
    const std::function<void(size_t)>& work = *work_;
    ++inside_;
    lock.unlock();
    work(hand);
    lock.lock();
    if (--inside_ == 0) left_.notify_one();
  }
}

}  // namespace sightline
