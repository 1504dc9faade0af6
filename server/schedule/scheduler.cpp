#include "server/schedule/scheduler.h"

#include <sys/prctl.h>

#include <algorithm>
#include <utility>

namespace sightline {

Scheduler::Scheduler(unsigned threads, SamplerDevice& device, StageClock clock, StageClock busy)
    : device_(device),
      clock_(std::move(clock)),
      busy_(std::move(busy)),
      best_batch_(std::max<size_t>(1, device.best_batch())),
      thread_count_(threads),
      queue_(best_batch_ > 1 ? 1 : threads),
      running_since_ns_(threads, kNotRunning) {
  threads_.reserve(threads);
  for (unsigned i = 0; i < threads; ++i) threads_.emplace_back([this] { work(); });
}

Scheduler::~Scheduler() {
  {
    const MutexLock lock(mutex_);
    stopping_ = true;
    queue_.hold_none();  // a thread that waits for a held task would not see the end
  }
  wake_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

void Scheduler::join(Scheduled& task, const std::string& client) {
  const MutexLock lock(mutex_);
  queue_.join(task, client);
}

// A busy thread looks at the queue before it waits, so only a waiting thread needs to be woken.
void Scheduler::post(std::shared_ptr<Scheduled> task, int64_t deadline_ns, bool may_be_long) {
  bool wakes = false;
  {
    const MutexLock lock(mutex_);
    Scheduled& scheduled = *task;
    scheduled.self_ = std::move(task);
    queue_.push(scheduled, deadline_ns, may_be_long);
    wakes = idle_ > 0 && running_ < thread_count_;
  }
  if (wakes) wake_.notify_one();
}

void Scheduler::run_now(Scheduled& task) {
  Round round;
  round.tasks.emplace_back(std::shared_ptr<Scheduled>(), &task);
  run(round);
}

bool Scheduler::try_run_now(Scheduled& task, int64_t deadline_ns) {
  Round round;
  {
    const MutexLock lock(mutex_);
    const int64_t now_ns = clock_();
    if (best_batch_ > 1 || stopping_ || queue_.ready(now_ns) || running_ >= thread_count_) return false;
    if (queue_.apart(task, now_ns)) return false;
    if (!spare_rounds_.empty()) {
      round = std::move(spare_rounds_.back());
      spare_rounds_.pop_back();
    }
    starts(round);
    // The task passes through the queue, in which nothing else may step, so that the round is charged against its own
    // deadline.
    queue_.push(task, deadline_ns);
    queue_.take(task, now_ns);
  }
  round.tasks.emplace_back(std::shared_ptr<Scheduled>(), &task);
  const int64_t before_ns = busy_();
  run(round);
  const int64_t busy_ns = busy_() - before_ns;
  bool wakes = false;
  {
    const MutexLock lock(mutex_);
    charge(round);
    queue_.note_elsewhere(task, busy_ns, round.end_ns);
    round.tasks.clear();
    ends(round);
    spare_rounds_.push_back(std::move(round));
    wakes = idle_ > 0 && may_run();
  }
  if (wakes) wake_.notify_one();
  return true;
}

// At most as many rounds run as there are threads, so one of the places is free.
void Scheduler::starts(Round& round) {
  ++running_;
  const auto free = std::find(running_since_ns_.begin(), running_since_ns_.end(), kNotRunning);
  *free = clock_();
  round.place = static_cast<size_t>(free - running_since_ns_.begin());
}

void Scheduler::ends(const Round& round) {
  --running_;
  running_since_ns_[round.place] = kNotRunning;
}

int64_t Scheduler::longest_running_ns() const {
  const MutexLock lock(mutex_);
  const auto oldest = std::min_element(running_since_ns_.begin(), running_since_ns_.end());
  if (oldest == running_since_ns_.end() || *oldest == kNotRunning) return 0;
  return std::max<int64_t>(0, clock_() - *oldest);
}

void Scheduler::charge(const Round& round) {
  for (size_t i = 0; i < round.tasks.size(); ++i) queue_.charge(*round.tasks[i], round.costs_ns[i], round.end_ns);
}

void Scheduler::work() {
  ::prctl(PR_SET_NAME, "step");  // for ps and debuggers
  Round round;
  for (;;) {
    MutexLock lock(mutex_);
    charge(round);
    if (!round.tasks.empty()) {
      ends(round);
      // These may be the last references. The tasks are destroyed without the lock, which others wait for.
      lock.unlock();
      round.tasks.clear();
      lock.lock();
    }
    ++idle_;
    wake_.wait(lock, [this]() NEEDS(mutex_) { return (stopping_ && queue_.empty()) || may_run(); });
    --idle_;
    if (queue_.empty()) return;
    starts(round);
    choose(round);
    lock.unlock();
    run(round);
  }
}

// A thread takes no more than its part of the queue, so that the other threads work at the same time.
void Scheduler::choose(Round& round) {
  const int64_t now_ns = clock_();
  const size_t part = (queue_.size() + threads() - 1) / std::max(threads(), 1u);
  for (size_t left = std::min(best_batch_, part); left > 0; --left) {
    DeadlineQueue::Flow* const flow = queue_.pop(now_ns);
    if (!flow) return;  // the others are held
    round.tasks.push_back(std::move(static_cast<Scheduled*>(flow)->self_));
  }
}

// The cost of the maps is divided among the tasks in proportion to the number of maps that they asked for.
void Scheduler::run(Round& round) {
  round.jobs.clear();
  round.costs_ns.clear();
  size_t requests = 0;
  for (int64_t before_ns = clock_(); const auto& task : round.tasks) {
    round.jobs.push_back(task->plan());
    requests += round.jobs.back().requests.size();
    const int64_t now_ns = clock_();
    round.costs_ns.push_back(now_ns - std::exchange(before_ns, now_ns));
  }
  std::exception_ptr trouble;
  const int64_t take_ns = requests > 0 ? take(round, trouble) : 0;
  round.end_ns = clock_();
  for (size_t i = 0, asked = 0; i < round.tasks.size(); ++i) {
    TakenMaps taken;
    if (const size_t own = round.jobs[i].requests.size(); own > 0) {
      taken.status = std::move(round.asked[asked++].taken);
      taken.trouble = trouble;
      round.costs_ns[i] += take_ns * static_cast<int64_t>(own) / static_cast<int64_t>(requests);
    }
    taken.cost_ns = round.costs_ns[i];
    round.tasks[i]->finish(taken);
    const int64_t now_ns = clock_();
    round.costs_ns[i] += now_ns - std::exchange(round.end_ns, now_ns);
  }
}

int64_t Scheduler::take(Round& round, std::exception_ptr& trouble) {
  const int64_t before_ns = clock_();
  round.asked.clear();
  for (const TakeJob& job : round.jobs)
    if (!job.requests.empty()) round.asked.push_back(job);
  try {
    device_.take_all(round.asked);
  } catch (...) {
    trouble = std::current_exception();
  }
  return clock_() - before_ns;
}

}  // namespace sightline
