#include "server/base/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <system_error>
#include <thread>
#include <vector>

#include "server/base/cpu_budget.h"
#include "server/base/mutex.h"

namespace sightline {
namespace {

// The state that the threads of one parallel_for share.
class Pieces {
 public:
  Pieces(size_t count, const std::function<void(size_t)>& visit) : count_(count), visit_(visit) {}

  // Takes pieces until none is left.
  void work() {
    for (size_t i = next_++; i < count_; i = next_++) {
      try {
        visit_(i);
      } catch (...) {
        note(i, std::current_exception());
      }
    }
  }
  void rethrow() const {
    const MutexLock lock(mutex_);
    if (error_) std::rethrow_exception(error_);
  }

 private:
  void note(size_t i, std::exception_ptr error) {
    const MutexLock lock(mutex_);
    if (error_ && i > error_at_) return;
    error_ = std::move(error);
    error_at_ = i;
  }

  const size_t count_;
  const std::function<void(size_t)>& visit_;
  std::atomic<size_t> next_{0};
  mutable Mutex mutex_;
  size_t error_at_ GUARDED(mutex_) = 0;
  std::exception_ptr error_ GUARDED(mutex_);
};

}  // namespace

void parallel_for(size_t count, const std::function<void(size_t)>& visit) {
  Pieces pieces(count, visit);
  const auto cores = static_cast<size_t>(cpu_budget());
  std::vector<std::thread> helpers;
  try {
    while (helpers.size() + 1 < std::min(cores, count)) helpers.emplace_back([&pieces] { pieces.work(); });
  } catch (const std::system_error&) {  // the system starts no more threads: go on with those that run
  }
  pieces.work();
  for (std::thread& helper : helpers) helper.join();
  pieces.rethrow();
}

}  // namespace sightline
