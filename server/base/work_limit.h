// The end of long work, such as reading a file: nobody wants its result any more, or it has taken too much processor
// time. Time in which the thread does not run does not count, so a busy machine ends nothing.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <thread>

#include "server/base/error.h"
#include "server/base/mutex.h"

namespace sightline {

// The processor time that the calling thread has used, in nanoseconds.
int64_t thread_cpu_ns();
using ThreadClock = int64_t (*)();

// Shared by the threads that do the work. Thread-safe.
class WorkLimit {
 public:
  struct Rules {
    ThreadClock clock = thread_cpu_ns;
    int64_t most_ns = 0;       // of all threads together; 0: any
    std::string refusal = {};  // the message of the error when it is used up; names the flag
  };
  // `unwanted` is asked from the threads of the work, and must return at once.
  explicit WorkLimit(Rules rules, std::function<bool()> unwanted = {})
      : rules_(std::move(rules)), unwanted_(std::move(unwanted)) {}

  // The part of one thread, used by it alone. It looks at the clock only once in kUnits, since that is a call of the
  // system. Parts of a thread may be nested; their time counts once.
  class Part {
   public:
    // Null: nothing ends the work.
    explicit Part(WorkLimit* limit);
    ~Part();
    Part(const Part&) = delete;
    Part& operator=(const Part&) = delete;

    // True when the work has to end: from then on always, and for all threads. Call it for every few units of work; a
    // unit takes up to a microsecond.
    bool ends(uint64_t units = 1) {
      if (!limit_) return false;
      if ((units_ += units) >= kUnits) look();
      return limit_->ended();
    }
    // The same, between parts of the work that are long.
    bool ends_now() { return ends(kUnits); }
    WorkLimit* limit() const { return limit_; }

   private:
    static constexpr uint64_t kUnits = 4096;
    void look();

    WorkLimit* const limit_;
    uint64_t units_ = 0;
  };

  bool ended() const { return end_ != End::kNone; }
  // Why it ended.
  Error error() const;

 private:
  enum class End { kNone, kUnwanted, kTooLong };
  struct OfThread {
    int64_t charged_ns = 0;  // when its time was charged last, by its clock
    int parts = 0;           // that are alive
  };
  void charge_this_thread();

  const Rules rules_;
  const std::function<bool()> unwanted_;
  std::atomic<int64_t> spent_ns_{0};
  Mutex mutex_;
  std::map<std::thread::id, OfThread> threads_ GUARDED(mutex_);
  std::atomic<End> end_{End::kNone};
};

}  // namespace sightline
