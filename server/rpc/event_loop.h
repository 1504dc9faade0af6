// The thread that moves the messages of streams: one thread that waits at one completion queue of gRPC's.
//
// There is one thread for each queue because several threads at one queue wake each other for every event; gRPC's
// callback API works that way. With a hundred streams of an echo server that was a third of a message's cost. A machine
// with many cores has several loops, each with calls of its own. `sightline bench` drives its load with one too.
//
// A short step can be taken on this thread (`defer`), because waking another thread would take as long as the step. The
// loop takes deferred tasks when nothing is left to be read. It hands them over to the scheduler's threads when too
// many wait, or when it has not rested for a while, so that it keeps reading.
#pragma once

#include <grpcpp/completion_queue.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <thread>

#include "server/base/mutex.h"

namespace sightline {

// The tag of an asynchronous operation of gRPC's. It is called once, when the operation is over.
class Event {
 public:
  // Runs on the loop's thread. gRPC defines `ok` for each kind of operation.
  virtual void ready(bool ok) = 0;

 protected:
  ~Event() = default;
};

// A task that can run on the loop's thread or elsewhere. The loop calls one of the two functions, once for each
// `defer`.
class ShortTask {
 public:
  virtual ~ShortTask() = default;
  virtual void run_on_loop() = 0;
  virtual void hand_over() = 0;  // passes the task to another thread and returns at once
};

class EventLoop {
 public:
  using Clock = std::function<std::chrono::steady_clock::time_point()>;

  // Starts the thread. `now` is monotonic. It is called from several threads at once, and until the destruction ends.
  // `name` is that of the thread, for ps and debuggers.
  explicit EventLoop(std::unique_ptr<grpc::CompletionQueue> queue, Clock now = std::chrono::steady_clock::now,
                     const char* name = "event-loop");
  // When the queue belongs to a server, that server must have shut down. Returns once every call has ended and every
  // event was delivered.
  ~EventLoop();
  EventLoop(const EventLoop&) = delete;
  EventLoop& operator=(const EventLoop&) = delete;

  grpc::CompletionQueue& queue() { return *queue_; }
  // Only for a loop that was constructed with a server's queue.
  grpc::ServerCompletionQueue& server_queue() { return static_cast<grpc::ServerCompletionQueue&>(*queue_); }

  // Takes a task for later, on the loop's thread only. It runs when nothing is left to be read. When the current event
  // is the first one after a long rest, it runs right after that event.
  void defer(std::shared_ptr<ShortTask> task);

  // Brackets a call that may start operations; the loop waits for its end. From any thread.
  void call_begins();
  void call_ends();
  // Delivers an event. From any thread, between the beginning and the end of a call.
  void post(Event& event);

  // Asks the thread for a sign of life, unless it still owes one, and returns how long it has owed it. Called about
  // once a second, the result is less than a second unless an event or a task holds the thread up. From any thread, but
  // not during the destruction.
  struct Silence {
    std::chrono::steady_clock::duration lasted{0};
    std::chrono::nanoseconds busy{0};  // in which the thread ran or waited for a processor
  };
  Silence silence();

 private:
  // The sign of life.
  struct Ping final : Event {
    explicit Ping(EventLoop& of) : loop(of) {}
    void ready(bool ok) override;
    EventLoop& loop;
    Mutex mutex;
    bool owed GUARDED(mutex) = false;
    std::chrono::steady_clock::time_point since GUARDED(mutex){};
    std::chrono::nanoseconds busy GUARDED(mutex){0};  // of the thread until then
  };

  void run();
  bool next(Event*& event, bool& ok);
  bool lags() const;
  void run_oldest();

  const std::unique_ptr<grpc::CompletionQueue> queue_;
  const Clock now_;
  const char* const name_;
  // Used by the loop's thread only.
  std::deque<std::shared_ptr<ShortTask>> deferred_;
  std::chrono::steady_clock::time_point rested_{};  // when it last had nothing to do
  bool after_long_rest_ = false;                    // the current event is the first one after a long rest

  Ping ping_{*this};
  std::atomic<int> thread_id_{0};

  Mutex mutex_;
  ConditionVariable none_left_;
  size_t calls_ GUARDED(mutex_) = 0;

  std::thread thread_;
};

}  // namespace sightline
