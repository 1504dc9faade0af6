// Threads that take the steps of sessions, in the order that DeadlineQueue says.
//
// A round is: plan the steps of those whose turn it is, take their maps, finish each. On a device that gains nothing
// from taking the maps of several sessions together (SamplerDevice::best_batch is 1) a round is one session's, from its
// inputs to its reply on one thread without a break. On one that does, a free thread takes its part of all that wait,
// up to the best batch.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <exception>
#include <memory>
#include <mutex>
#include <span>
#include <thread>
#include <vector>

#include "server/schedule/deadline_queue.h"
#include "server/sample/sampler.h"
#include "server/step/step.h"

namespace sightline {

// What became of a planned step's maps.
struct TakenMaps {
  Status status;               // of the sampler
  std::exception_ptr trouble;  // what the sampler threw; else null
  int64_t cost_ns = 0;         // of the plan, and this step's part of the take
};

// One whose steps are scheduled. The calls come from the scheduler's threads, one at a time, `plan` and `finish` in
// turn.
class Scheduled : public DeadlineQueue::Flow {
 public:
  virtual ~Scheduled() = default;
  // Which maps are to be taken; maybe none. What the job refers to must stay until `finish`. Must not throw.
  virtual TakeJob plan() = 0;
  // Always follows; may post this again. Must not throw.
  virtual void finish(const TakenMaps& taken) = 0;

 private:
  friend class Scheduler;
  std::shared_ptr<Scheduled> self_;  // while it waits
};

// Thread-safe.
class Scheduler {
 public:
  // `device` and `clock` (nanoseconds, monotonic, from any thread) must outlive it.
  Scheduler(unsigned threads, SamplerDevice& device, StageClock clock);
  // Runs what waits, then joins. Nothing may be posted from then on.
  ~Scheduler();
  Scheduler(const Scheduler&) = delete;
  Scheduler& operator=(const Scheduler&) = delete;

  // A round of `task`, wanted by `deadline_ns`. It must not wait already; it is kept alive until it has run. The queue
  // has no bound of its own: it is as long as there are tasks, and sessions are limited.
  void post(std::shared_ptr<Scheduled> task, int64_t deadline_ns);
  // The same at once, on this thread, beside what is scheduled.
  void run_here(Scheduled& task);

  // A round of `task` at once, on this thread, if nobody waits and fewer rounds run than there are threads; else nothing, and false.
  // It counts as one of those rounds, and is charged like them. It saves the way to another thread and back, which on an idle machine takes
  // as long as a short step; the caller does nothing else meanwhile. Never on a device that gains by taking several together.
  bool try_here(Scheduled& task);

  unsigned threads() const { return static_cast<unsigned>(threads_.size()); }
  int64_t now_ns() const { return clock_(); }

 private:
  // Of one thread; memory is reused from round to round.
  struct Round {
    std::vector<std::shared_ptr<Scheduled>> tasks;
    std::vector<TakeJob> jobs, asked;
    std::vector<int64_t> costs_ns;  // by task
    int64_t end_ns = 0;
  };
  void work();
  void choose(Round& round);  // needs mutex_
  void run(Round& round);
  void charge(const Round& round);  // needs mutex_
  bool may_run() const { return !queue_.empty() && running_ < threads_.size(); }  // needs mutex_
  int64_t take(Round& round, std::exception_ptr& trouble);

  SamplerDevice& device_;
  const StageClock clock_;
  const size_t best_batch_;

  std::mutex mutex_;
  std::condition_variable wake_;
  DeadlineQueue queue_;               // guarded by mutex_
  unsigned idle_ = 0;                 // threads that wait; guarded by mutex_
  size_t running_ = 0;                // rounds, those of try_here too; guarded by mutex_
  std::vector<Round> spare_rounds_;   // memory for try_here; guarded by mutex_
  bool stopping_ = false;             // guarded by mutex_
  std::vector<std::thread> threads_;  // constant after construction
};

}  // namespace sightline
