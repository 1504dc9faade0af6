// The thread that moves the messages of streams: one completion queue of gRPC's and one thread that waits at it.
//
// One thread, since of several at one queue (as gRPC's callback API has them) each wakes the next one whenever something
// happens: with a hundred streams of an echo that is a third of what a message costs. A machine with many cores has several loops,
// each with calls of its own. `sightline bench` drives its load by one too.
//
// A short step is taken on this thread, once nothing is left to be read: to wake another one would take as long. While more
// comes in, or when this thread has not rested for a while, they are passed on to threads that step, so that this one keeps reading.
// What the first event after a long rest asks for is done at once: to see that nothing else is ready takes gRPC some 7 us then.
#pragma once

#include <grpcpp/completion_queue.h>

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <memory>
#include <mutex>
#include <thread>

namespace sightline {

// What an operation of gRPC's is tagged with: told once, when the operation is over.
class Event {
 public:
  // On the loop's thread. `ok`: as gRPC says for the operation.
  virtual void ready(bool ok) = 0;

 protected:
  ~Event() = default;
};

// Work that can be done on the loop's thread or on another.
class ShortWork {
 public:
  virtual ~ShortWork() = default;
  virtual void do_here() = 0;
  virtual void pass_on() = 0;  // returns at once
};

class EventLoop {
 public:
  // Starts its thread.
  explicit EventLoop(std::unique_ptr<grpc::CompletionQueue> queue);
  // The server, if it is one's, must have shut down. Returns once every call has ended and every event was told.
  ~EventLoop();
  EventLoop(const EventLoop&) = delete;
  EventLoop& operator=(const EventLoop&) = delete;

  grpc::CompletionQueue& queue() { return *queue_; }
  // Of a loop that was made with one of a server.
  grpc::ServerCompletionQueue& server_queue() { return static_cast<grpc::ServerCompletionQueue&>(*queue_); }

  // For when nothing is left to be read, or the event is over that came first after a long rest. On the loop's thread only.
  void soon(std::shared_ptr<ShortWork> work);

  // A call that may still start operations, which the loop waits for at its end. From any thread.
  void call_begins();
  void call_ends();

 private:
  void run();
  bool next(Event*& event, bool& ok);
  bool lags() const;
  void do_eldest();

  const std::unique_ptr<grpc::CompletionQueue> queue_;
  // The loop's thread only.
  std::deque<std::shared_ptr<ShortWork>> waiting_;
  std::chrono::steady_clock::time_point rested_{};  // when it last had nothing to do
  bool woke_ = false;                               // what came last came after a long rest

  std::mutex mutex_;
  std::condition_variable none_left_;
  size_t calls_ = 0;  // guarded by mutex_

  std::thread thread_;
};

}  // namespace sightline
