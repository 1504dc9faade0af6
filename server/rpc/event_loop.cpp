#include "server/rpc/event_loop.h"

#include <grpcpp/alarm.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <utility>

#include "server/base/process_figures.h"

namespace sightline {
namespace {

// Tasks that may be deferred; beyond that the oldest goes to another thread. Waking that thread costs part of a short
// step. With a hundred sessions on two cores, 6 takes a tenth less processor time than 1, and no reply is later.
constexpr size_t kMostDeferred = 6;
// A loop that has not rested for kLongestBusy is not keeping up. Shorter waits than kLeastRest do not count as rest:
// gRPC looks at one connection at a time, so an event can be ready although one look found nothing.
constexpr std::chrono::microseconds kLongestBusy{2000}, kLeastRest{20};
// After a rest this long the caches are cold, and to see that nothing else is ready takes gRPC about 7 us.
constexpr std::chrono::microseconds kLongRest{100};

}  // namespace

EventLoop::EventLoop(std::unique_ptr<grpc::CompletionQueue> queue, Clock now, const char* name)
    : queue_(std::move(queue)), now_(std::move(now)), name_(name), thread_([this] { run(); }) {}

// The queue is shut down only after the last call, because a call that is still stepping starts operations at its end.
EventLoop::~EventLoop() {
  {
    MutexLock lock(mutex_);
    none_left_.wait(lock, [this]() NEEDS(mutex_) { return calls_ == 0; });
  }
  queue_->Shutdown();
  thread_.join();
}

void EventLoop::defer(std::shared_ptr<ShortTask> task) {
  deferred_.push_back(std::move(task));
  if (deferred_.size() <= kMostDeferred) return;
  deferred_.front()->hand_over();
  deferred_.pop_front();
}

bool EventLoop::lags() const {
  return now_() - rested_ > kLongestBusy;
}

void EventLoop::run_oldest() {
  const std::shared_ptr<ShortTask> task = std::move(deferred_.front());
  deferred_.pop_front();
  lags() ? task->hand_over() : task->run_on_loop();
}

void EventLoop::call_begins() {
  const MutexLock lock(mutex_);
  ++calls_;
}

void EventLoop::call_ends() {
  const MutexLock lock(mutex_);
  if (--calls_ == 0) none_left_.notify_all();
}

// gRPC delivers an alarm whose time is over at once, on this thread and without its timers. With the present time it
// would not: it rounds times up to milliseconds, and waits for the rest by the wall clock.
void EventLoop::post(Event& event) {
  grpc::Alarm alarm;
  alarm.Set(queue_.get(), gpr_inf_past(GPR_CLOCK_MONOTONIC), &event);
}

// A ping comes through the queue like every other event, so it also shows a loop that hangs inside gRPC.
EventLoop::Silence EventLoop::silence() {
  const auto now = now_();
  const auto busy = busy_time_of_thread(thread_id_);
  const MutexLock lock(ping_.mutex);
  if (ping_.owed) return {now - ping_.since, busy - ping_.busy};
  ping_.owed = true;
  ping_.since = now;
  ping_.busy = busy;
  call_begins();
  post(ping_);
  return {};
}

void EventLoop::Ping::ready(bool) {
  {
    const MutexLock lock(mutex);
    owed = false;
  }
  loop.call_ends();
}

// Returns false when nothing more will come.
bool EventLoop::next(Event*& event, bool& ok) {
  using grpc::CompletionQueue;
  void* tag = nullptr;
  const gpr_timespec at_once = gpr_time_0(GPR_CLOCK_MONOTONIC), whenever = gpr_inf_future(GPR_CLOCK_MONOTONIC);
  for (;;) {
    const bool rests = deferred_.empty();
    const auto before = now_();
    const CompletionQueue::NextStatus found = queue_->AsyncNext(&tag, &ok, rests ? whenever : at_once);
    after_long_rest_ = false;
    if (rests) {
      const auto now = now_();
      if (now - before >= kLeastRest) rested_ = now;
      after_long_rest_ = now - before >= kLongRest;
    }
    if (found == CompletionQueue::SHUTDOWN && rests) return false;
    if (found == CompletionQueue::GOT_EVENT) {
      event = static_cast<Event*>(tag);
      return true;
    }
    run_oldest();
  }
}

void EventLoop::run() {
  ::prctl(PR_SET_NAME, name_);
  thread_id_ = ::gettid();
  rested_ = now_();
  Event* event = nullptr;
  bool ok = false;
  while (next(event, ok)) {
    event->ready(ok);
    if (after_long_rest_ && !deferred_.empty()) run_oldest();
  }
}

}  // namespace sightline
