// Mutexes whose members say that they are guarded, so that a compiler can check it.
//
// Debian's libstdc++ does not annotate std::mutex, so it is wrapped here. absl::Mutex is annotated, but ThreadSanitizer
// knows nothing of it: Debian's build of it is not instrumented, and every access under it would look like a race. GCC
// ignores the annotations; tests/house/locks_test.py has clang check them.
//
//   class Counter {
//     void add() { const MutexLock lock(mutex_); ++count_; }
//     void reset() NEEDS(mutex_);          // the caller holds it
//     Mutex mutex_;
//     int count_ GUARDED(mutex_) = 0;
//   };
//
// Three things are not checked: constructors and destructors; data behind a pointer or a reference that was taken under
// the mutex; members that one thread at a time uses without a mutex.
#pragma once

#include <condition_variable>
#include <mutex>
#include <utility>

#ifdef __clang__
#define SIGHTLINE_LOCKS(attribute) __attribute__((attribute))
#else
#define SIGHTLINE_LOCKS(attribute)
#endif
// A member with this is read and written only while the mutex is held. Abseil's headers define GUARDED_BY.
#define GUARDED(mutex) SIGHTLINE_LOCKS(guarded_by(mutex))
// The caller of a function with this holds these mutexes. A lambda has it after its parameters.
#define NEEDS(...) SIGHTLINE_LOCKS(requires_capability(__VA_ARGS__))
// A function with this is not checked. The comment beside it says why.
#define LOCKS_NOT_CHECKED SIGHTLINE_LOCKS(no_thread_safety_analysis)

namespace sightline {

class SIGHTLINE_LOCKS(capability("mutex")) Mutex {
 private:
  friend class MutexLock;
  std::mutex mutex_;
};

// Holds a mutex from its construction to its end, but for the time between `unlock` and `lock`.
class SIGHTLINE_LOCKS(scoped_lockable) MutexLock {
 public:
  explicit MutexLock(Mutex& mutex) SIGHTLINE_LOCKS(acquire_capability(mutex)) : lock_(mutex.mutex_) {}
  ~MutexLock() SIGHTLINE_LOCKS(release_capability()) {}
  MutexLock(const MutexLock&) = delete;
  MutexLock& operator=(const MutexLock&) = delete;

  // These two are where the checked mutex meets the standard's, of which clang knows nothing.
  void unlock() SIGHTLINE_LOCKS(release_capability()) LOCKS_NOT_CHECKED { lock_.unlock(); }
  void lock() SIGHTLINE_LOCKS(acquire_capability()) LOCKS_NOT_CHECKED { lock_.lock(); }

 private:
  friend class ConditionVariable;
  std::unique_lock<std::mutex> lock_;
};

// As std::condition_variable. `done` is called with the mutex held; it is a lambda with NEEDS(mutex_).
class ConditionVariable {
 public:
  void notify_one() { condition_.notify_one(); }
  void notify_all() { condition_.notify_all(); }
  void wait(MutexLock& lock) { condition_.wait(lock.lock_); }
  template <typename Done>
  void wait(MutexLock& lock, Done done) {
    condition_.wait(lock.lock_, std::move(done));
  }
  template <typename Time>
  std::cv_status wait_until(MutexLock& lock, const Time& time) {
    return condition_.wait_until(lock.lock_, time);
  }
  template <typename Duration, typename Done>
  bool wait_for(MutexLock& lock, const Duration& duration, Done done) {
    return condition_.wait_for(lock.lock_, duration, std::move(done));
  }

 private:
  std::condition_variable condition_;
};

}  // namespace sightline
