// RPC Control: the transport of one stream. It moves messages between gRPC and the session, which SessionDriver holds.
//
// The stream reads as long as its inbox has room. When messages wait, a worker takes a turn: all messages that have
// arrived go to the driver, which applies them and takes one step. The next turn starts only after all replies of the
// last one were handed to gRPC. A client that stops reading therefore holds at most the replies to one inbox, a full
// inbox and gRPC's window (64 KiB) on the server.
//
// A turn is due one tick interval after the newest tick arrived; the scheduler orders turns by that deadline.
//
// Threads. Reactions (on_read, on_write, on_cancel, on_alarm, on_done) run on the loop's thread and only move messages.
// A turn (`plan`, then `finish`) runs on one of three:
//   - a thread of the scheduler, as a rule;
//   - a loader, when it opens the session or may take long (SessionDriver says so);
//   - the loop's own thread, when the last step was short, nothing else is to be read and a turn is free.
// `drain` and `end` come from the thread that stops the server. All of them meet in `advance`, which decides what comes
// next.
//
// A resumable session outlives its stream (kept_sessions.h). A stream that begins with `resume` has no session of its
// own until it gets one. A stream that breaks, or that another one replaces, gives its session up: `detach`. A client
// that closes its side ends the session in order. gRPC reports the end of the messages first. Only later it reports
// whether the call was cancelled, as it is when the connection broke. A resumable session is therefore freed at the
// very end of the call.
//
// A client that does not read cannot hold its place: when an end is wanted, it has kLastWrites to take what is written
// for it. After that the call is cancelled, and with it the write.
//
// Order of gRPC operations. At most one read and one write are under way. `finish_call` is called once, when no turn
// and no write is under way; nothing is started after it.
#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "server/base/mutex.h"
#include "server/gate/access.h"
#include "server/rpc/call.h"
#include "server/rpc/timers.h"
#include "server/schedule/scheduler.h"
#include "server/schedule/tick_pace.h"
#include "server/service/inbox.h"
#include "server/service/incoming_message.h"
#include "server/service/kept_sessions.h"
#include "server/service/outbox.h"
#include "server/service/parts.h"
#include "server/service/session_driver.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// Messages arrive as bytes (incoming_message.h says why).
using ControlCall = AsyncCall<grpc::ServerAsyncReaderWriter<v1::ControlResponse, grpc::ByteBuffer>>;

// All streams use these beside the parts. They must outlive the streams.
struct StreamHelpers {
  WorkerPool& parsers;   // of large messages
  WorkerPool& claimers;  // of sessions to resume, which wait for no message
  MessageMemory& messages;
  KeptSessions& kept;
  Timers& timers;
};

class ControlStream final : public ControlCall, public ResumableStream, public Scheduled, public ShortTask {
 public:
  // Takes a new call. It is registered and lives until gRPC is done with it. When the registry is full or drains, the
  // call is refused (RESOURCE_EXHAUSTED with a retry time, UNAVAILABLE). So it is when there is no `caller`, but a
  // status. Runs on the loop's thread.
  static void start(const ServiceParts& parts, const ServiceLimits& limits, const StreamHelpers& helpers,
                    EventLoop& loop, std::unique_ptr<Incoming> incoming, const std::string& session_id,
                    const tl::expected<Caller, grpc::Status>& caller);

  ControlStream(const ServiceParts& parts, const ServiceLimits& limits, const StreamHelpers& helpers, EventLoop& loop,
                std::unique_ptr<Incoming> incoming, const std::string& session_id, SceneReader reader);
  ~ControlStream() override = default;

  void drain(const std::string& reason) override;
  void end(const grpc::Status& status) override;
  void give_session_up() override;
  bool take_session(std::unique_ptr<DetachedSession>& session, const Drainable* holder) override;

 private:
  // Parsing: a large message is on another thread. Resuming: it waits for the session. Ended: the client has closed its
  // side, or is gone.
  enum class Reading { kPaused, kUnderWay, kParsing, kResuming, kEnded };
  enum class TurnState { kNone, kOnWorker, kOnLoop };  // waiting for its thread, or running on it

  // Reactions.
  void on_read(bool ok) override;
  void on_write(bool ok) override;
  void on_cancel() override;
  void on_alarm(bool ran_out) override;  // the client may have been silent for too long
  void on_done() override;
  void on_no_memory() override;

  // A turn on the loop's thread, or its way to the scheduler instead.
  void run_on_loop() override;
  void hand_over() override;

  // A turn, on any of its threads.
  TakeJob plan() override;
  void finish(const TakenMaps& taken) override;
  void fill_turn();
  void end_turn(const TakenMaps& taken);

  // On the thread of the parsers, without mutex_.
  Status parse_large(v1::ControlRequest& request);

  void end_without_memory() NEEDS(mutex_);
  void take_in(v1::ControlRequest request, int64_t arrival_ns) NEEDS(mutex_);
  void begin(const v1::ControlRequest& request) NEEDS(mutex_);
  void note_changes(const v1::Tick& tick) NEEDS(mutex_);
  void claim(const v1::ResumeSession& request) NEEDS(mutex_);
  void issue_token() NEEDS(mutex_);
  void parse(int64_t arrival_ns) NEEDS(mutex_);
  void parse_elsewhere(int64_t arrival_ns) NEEDS(mutex_);
  void refuse_message(const Error& error) NEEDS(mutex_);
  void advance() NEEDS(mutex_);  // starts what comes next
  void hurry() NEEDS(mutex_);    // gives the client little time to take what is written, once an end is wanted
  void set_alarm(std::chrono::milliseconds timeout) NEEDS(mutex_);
  void read_if_room() NEEDS(mutex_);
  void begin_turn(TurnState where) NEEDS(mutex_);
  bool may_run_on_loop() const NEEDS(mutex_);
  void close(const grpc::Status& status) NEEDS(mutex_);
  bool detach() NEEDS(mutex_);
  void free_session(const grpc::Status& status) NEEDS(mutex_);

  // Constant after construction.
  const ServiceParts& parts_;
  WorkerPool& parsers_;
  WorkerPool& claimers_;
  KeptSessions& kept_;
  Timers& timers_;
  const std::string client_;
  const std::shared_ptr<MessageMemory::Share> share_;  // of its client, in the memory for messages
  const size_t max_message_bytes_, max_message_memory_;
  const std::chrono::milliseconds idle_limit_;  // 0: none

  // Used by the turn while there is one, otherwise under mutex_, which clang cannot check.
  std::unique_ptr<SessionDriver> driver_;  // null: another stream has the session, or may have it
  SessionDriver::Turn turn_;
  int64_t due_ns_ = 0;  // deadline of the turn

  // Used by gRPC while a read is under way, by a parser while that works, otherwise under mutex_.
  grpc::ByteBuffer bytes_;

  Mutex mutex_;
  Inbox inbox_ GUARDED(mutex_);
  Outbox outbox_ GUARDED(mutex_);  // its front is used by gRPC while writing_
  TickPace pace_ GUARDED(mutex_);
  Reading reading_ GUARDED(mutex_) = Reading::kPaused;
  TurnState turn_state_ GUARDED(mutex_) = TurnState::kNone;
  bool writing_ GUARDED(mutex_) = false;  // a write is under way
  bool heard_ GUARDED(mutex_) = false;    // a message has come
  // alarms since the last message, or since the client took the last reply if one is being written
  int silent_alarms_ GUARDED(mutex_) = 0;
  bool alarm_set_ GUARDED(mutex_) = false;  // an alarm is under way
  bool opening_ GUARDED(mutex_) = true;     // no turn has opened the session
  // the next turn may take long: it opens the session, or the driver said so
  bool needs_loader_ GUARDED(mutex_) = true;
  // What messages have changed since the last step, as far as the steps before say nothing of how long the next takes.
  struct Changes {
    bool may_be_long = false;  // it may take far longer than any of them
    bool not_only_poses = false;
    void add(const Changes& more) {
      may_be_long = may_be_long || more.may_be_long, not_only_poses = not_only_poses || more.not_only_poses;
    }
  };
  Changes changes_ GUARDED(mutex_), changes_of_turn_ GUARDED(mutex_);
  int targets_ GUARDED(mutex_) = 0;  // of the newest message that lists them
  // Resuming.
  std::optional<Admission> only_resumes_ GUARDED(mutex_);  // why the stream has no place for a session of its own
  bool resumable_ GUARDED(mutex_) = false;                 // the client asked for it
  std::string token_ GUARDED(mutex_);                      // of the session; empty: it ends with the stream
  uint64_t answered_ GUARDED(mutex_) = 0;  // of the session to resume: its client has the answer to this tick
  bool gives_up_ GUARDED(mutex_) = false;  // another stream resumes the session
  // How the call ends.
  bool cancelled_ GUARDED(mutex_) = false;                  // at once
  std::atomic<bool> unwanted_{false};                       // what it loads; set under mutex_, asked without
  std::optional<grpc::Status> end_status_ GUARDED(mutex_);  // with this status, once outbox_ is written
  bool hurried_ GUARDED(mutex_) = false;                    // the last alarm has begun; then the call is cancelled
  bool finished_ GUARDED(mutex_) = false;                   // `finish_call` was called
  bool freed_at_the_end_ GUARDED(mutex_) = false;           // the call is finished and the session is not freed so far
  std::shared_ptr<ControlStream> self_ GUARDED(mutex_);     // from the start until on_done
};

}  // namespace sightline
