// The sending half of a bidirectional stream of gRPC's callback API. Messages go out one at a time and in order; what the
// connection does not take yet waits in a queue, whose bound is its owner's affair.
#pragma once

#include <grpcpp/support/client_callback.h>

#include <deque>
#include <mutex>

namespace sightline {

// A base for reactors: they add reading and the end. Queueing and stopping need mutex_.
template <typename Sent, typename Received>
class QueuedStream : public grpc::ClientBidiReactor<Sent, Received> {
 protected:
  // Before the call starts. Writes start outside the reactions, so the stream is held open until the last of them.
  void hold_open() { this->AddHold(); }

  // After messages were put at the end of unsent_.
  void send_queued() {
    if (!writing_ && !unsent_.empty()) start_next_write();
  }
  // Nothing may be queued any more; what waits still goes out.
  void stop_writing() {
    closing_ = true;
    if (!writing_) finish_writing();
  }

  mutable std::mutex mutex_;
  // guarded by mutex_
  std::deque<Sent> unsent_;  // the front is on its way while writing_
  bool closing_ = false;

 private:
  void OnWriteDone(bool ok) final {
    const std::lock_guard lock(mutex_);
    writing_ = false;
    unsent_.pop_front();
    if (!ok) {
      closing_ = true;
      unsent_.clear();
    }
    if (!unsent_.empty())
      start_next_write();
    else if (closing_)
      finish_writing();
  }
  void start_next_write() {
    writing_ = true;
    this->StartWrite(&unsent_.front());
  }
  void finish_writing() {
    if (writes_done_) return;
    writes_done_ = true;
    this->StartWritesDone();
    this->RemoveHold();
  }

  // guarded by mutex_
  bool writing_ = false;
  bool writes_done_ = false;  // the hold is released
};

}  // namespace sightline
