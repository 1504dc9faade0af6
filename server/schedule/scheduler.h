// The threads that take the steps of sessions, in the order of DeadlineQueue.
//
// The threads work in rounds: plan the steps of the next sessions, take their depth maps, finish each step. Some
// devices gain nothing from taking the maps of several sessions together (SamplerDevice::best_batch is 1). A round is
// then the step of one session, from its inputs to its reply on one thread. On other devices a free thread takes its
// part of all waiting sessions, up to the best batch.
#pragma once

#include <cstdint>
#include <exception>
#include <limits>
#include <memory>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "server/base/mutex.h"
#include "server/base/work_limit.h"
#include "server/sample/sampler.h"
#include "server/schedule/deadline_queue.h"
#include "server/step/step.h"

namespace sightline {

// The result of taking a planned step's maps.
struct TakenMaps {
  Status status;               // of the sampler
  std::exception_ptr trouble;  // the exception that the sampler threw, or null
  int64_t cost_ns = 0;         // time of the plan, and this step's part of the time for the maps
};

// Something that is scheduled: one session. The calls come from several threads, but never overlap; `plan` and `finish`
// alternate.
class Scheduled : public DeadlineQueue::Flow {
 public:
  virtual ~Scheduled() = default;
  // Returns the maps to be taken, which may be none. The job's references must stay valid until `finish`. Must not
  // throw.
  virtual TakeJob plan() = 0;
  // Follows every `plan`, and may post the session again. Must not throw.
  virtual void finish(const TakenMaps& taken) = 0;

 private:
  friend class Scheduler;
  std::shared_ptr<Scheduled> self_;  // while it waits
};

// Thread-safe.
class Scheduler {
 public:
  // `device` and `clock` (nanoseconds, monotonic, from any thread) must outlive it. `busy` is the processor time of the
  // calling thread, in nanoseconds.
  Scheduler(unsigned threads, SamplerDevice& device, StageClock clock, StageClock busy = thread_cpu_ns);
  // Runs everything that waits, then joins the threads. Nothing may be posted from then on.
  ~Scheduler();
  Scheduler(const Scheduler&) = delete;
  Scheduler& operator=(const Scheduler&) = delete;

  // Names the client whose session `task` is, once and before it is posted. Tasks of one client share its part of the
  // time.
  void join(Scheduled& task, const std::string& client);
  // Schedules a round of `task`, which should be done by `deadline_ns`. The task must not be waiting already; it is
  // kept alive until it has run. The queue has no bound of its own: it is as long as there are sessions, which are
  // limited. `may_be_long`: it may take far longer than the rounds before.
  void post(std::shared_ptr<Scheduled> task, int64_t deadline_ns, bool may_be_long = false);
  // Runs a round of `task` at once on this thread, outside the schedule.
  void run_now(Scheduled& task);
  // Runs a round of `task` at once on this thread when no task waits and fewer rounds run than there are threads.
  // Otherwise it does nothing and returns false. The round counts as one of the threads' rounds. This saves the way to
  // another thread and back, which on an idle machine takes as long as a short step. It also returns false for a while
  // after a long step of the task's client on such a thread, and always on a device that gains from taking several maps
  // together.
  bool try_run_now(Scheduled& task, int64_t deadline_ns);

  // Time since the start of the oldest round that still runs, in nanoseconds; 0 when none runs. From any thread.
  int64_t longest_running_ns() const;

  unsigned threads() const { return thread_count_; }
  int64_t now_ns() const { return clock_(); }

 private:
  // The state of one round. Its memory is used again by the thread's next one.
  struct Round {
    std::vector<std::shared_ptr<Scheduled>> tasks;
    std::vector<TakeJob> jobs, asked;
    std::vector<int64_t> costs_ns;  // by task
    int64_t end_ns = 0;
    size_t place = 0;  // in running_since_ns_
  };
  void starts(Round& round) NEEDS(mutex_);
  void ends(const Round& round) NEEDS(mutex_);
  void work();
  void choose(Round& round) NEEDS(mutex_);
  void run(Round& round);
  void charge(const Round& round) NEEDS(mutex_);
  bool may_run() const NEEDS(mutex_) { return running_ < thread_count_ && queue_.ready(clock_()); }
  int64_t take(Round& round, std::exception_ptr& trouble);

  SamplerDevice& device_;
  const StageClock clock_, busy_;
  const size_t best_batch_;
  const unsigned thread_count_;  // the first threads ask for it while the constructor still starts the others

  mutable Mutex mutex_;
  ConditionVariable wake_;
  DeadlineQueue queue_ GUARDED(mutex_);
  unsigned idle_ GUARDED(mutex_) = 0;                      // waiting threads
  size_t running_ GUARDED(mutex_) = 0;                     // rounds, including those of try_run_now
  std::vector<int64_t> running_since_ns_ GUARDED(mutex_);  // one place for each thread; kNotRunning when free
  static constexpr int64_t kNotRunning = std::numeric_limits<int64_t>::max();
  std::vector<Round> spare_rounds_ GUARDED(mutex_);  // memory for try_run_now
  bool stopping_ GUARDED(mutex_) = false;
  std::vector<std::thread> threads_;  // used by the constructor and the destructor alone
};

}  // namespace sightline
