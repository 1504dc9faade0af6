#include "server/rpc/event_loop.h"

#include <utility>

namespace sightline {
namespace {

// How many wait for this thread before the eldest goes to another. To wake that, and to be told of what it wrote, costs a part
// of a short step: with a hundred sessions on two cores, 6 takes a tenth less processor time than 1 and is not later.
constexpr size_t kMostWaiting = 6;
// One that has not rested for so long is not keeping up. What counts as rest is longer than a look at what is ready takes: gRPC
// looks at one connection at a time, so that nothing ready at one look does not mean that there is nothing.
constexpr std::chrono::microseconds kLongestBusy{2000}, kLeastRest{20};
// After so long a rest the caches have forgotten this thread, and a look takes several times as long as it does under load.
constexpr std::chrono::microseconds kLongRest{100};

}  // namespace

EventLoop::EventLoop(std::unique_ptr<grpc::CompletionQueue> queue)
    : queue_(std::move(queue)), thread_([this] { run(); }) {}

// A call that is stepping would start its last operations at a queue that takes none.
EventLoop::~EventLoop() {
  {
    std::unique_lock lock(mutex_);
    none_left_.wait(lock, [this] { return calls_ == 0; });
  }
  queue_->Shutdown();
  thread_.join();
}

void EventLoop::soon(std::shared_ptr<ShortWork> work) {
  waiting_.push_back(std::move(work));
  if (waiting_.size() <= kMostWaiting) return;
  waiting_.front()->pass_on();
  waiting_.pop_front();
}

bool EventLoop::lags() const {
  return std::chrono::steady_clock::now() - rested_ > kLongestBusy;
}

void EventLoop::do_eldest() {
  const std::shared_ptr<ShortWork> work = std::move(waiting_.front());
  waiting_.pop_front();
  lags() ? work->pass_on() : work->do_here();
}

void EventLoop::call_begins() {
  const std::lock_guard lock(mutex_);
  ++calls_;
}

void EventLoop::call_ends() {
  const std::lock_guard lock(mutex_);
  if (--calls_ == 0) none_left_.notify_all();
}

// False: nothing more will come.
bool EventLoop::next(Event*& event, bool& ok) {
  using grpc::CompletionQueue;
  void* tag = nullptr;
  const gpr_timespec at_once = gpr_time_0(GPR_CLOCK_MONOTONIC), whenever = gpr_inf_future(GPR_CLOCK_MONOTONIC);
  for (;;) {
    const bool rests = waiting_.empty();
    const auto before = std::chrono::steady_clock::now();
    const CompletionQueue::NextStatus found = queue_->AsyncNext(&tag, &ok, rests ? whenever : at_once);
    woke_ = false;
    if (rests) {
      const auto now = std::chrono::steady_clock::now();
      if (now - before >= kLeastRest) rested_ = now;
      woke_ = now - before >= kLongRest;
    }
    if (found == CompletionQueue::SHUTDOWN && rests) return false;
    if (found == CompletionQueue::GOT_EVENT) {
      event = static_cast<Event*>(tag);
      return true;
    }
    do_eldest();
  }
}

void EventLoop::run() {
  rested_ = std::chrono::steady_clock::now();
  Event* event = nullptr;
  bool ok = false;
  while (next(event, ok)) {
    event->ready(ok);
    if (woke_ && !waiting_.empty()) do_eldest();
  }
}

}  // namespace sightline
