#include "server/service/last_resort.h"

#include <sys/prctl.h>

#include <memory>
#include <system_error>
#include <utility>

#include "server/base/mutex.h"

namespace sightline {
namespace {

using std::chrono::steady_clock;

// Returns when the rescue is over, or when its time is. Its thread may outlive the call.
void rescue_in_time(std::function<void()> rescue, LastResort::Duration time) {
  struct Shared {
    Mutex mutex;
    ConditionVariable changed;
    bool done GUARDED(mutex) = false;
  };
  const auto shared = std::make_shared<Shared>();
  const auto work = [shared, rescue = std::move(rescue)] {
    rescue();
    const MutexLock lock(shared->mutex);
    shared->done = true;
    shared->changed.notify_all();
  };
  try {
    std::thread(work).detach();
  } catch (const std::system_error&) {
    work();  // the system has no further thread
  }
  MutexLock lock(shared->mutex);
  shared->changed.wait_for(lock, time, [&]() NEEDS(shared->mutex) { return shared->done; });
}

}  // namespace

LastResort::LastResort(std::function<void()> end, Duration rescue_time)
    : end_(std::move(end)), rescue_time_(rescue_time), thread_([this] { run(); }) {}

LastResort::~LastResort() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void LastResort::arm(Duration after, std::function<void()> rescue) {
  const MutexLock lock(mutex_);
  deadline_ = steady_clock::now() + after;
  rescue_ = std::move(rescue);
  changed_.notify_all();
}

void LastResort::run() {
  ::prctl(PR_SET_NAME, "last-resort");  // for ps and debuggers
  MutexLock lock(mutex_);
  while (!stopping_) {
    if (!deadline_) {
      changed_.wait(lock);
    } else if (steady_clock::now() < *deadline_) {
      changed_.wait_until(lock, *deadline_);
    } else {
      const auto rescue = std::exchange(rescue_, {});
      lock.unlock();
      rescue_in_time(rescue, rescue_time_);
      return end_();
    }
  }
}

}  // namespace sightline
