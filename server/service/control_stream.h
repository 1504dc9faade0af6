// RPC Control: one session over one stream.
//
// Newest tick wins, nothing is lost. The stream reads as long as its inbox has room. A worker takes
// everything that has arrived, applies every tick in order, and takes ONE step for the newest. No step starts
// before all replies to the last one are handed to the transport, so a client that stops reading holds on the
// server at most the replies to one inbox, a full inbox and the transport's window (64 KiB).
//
// A reply is due one tick interval after its tick arrived; the scheduler goes by that. What the steps cost decides what
// they leave out under overload (step_budget).
//
// A tick can ask that no step be taken for it (StepControl.merge_into_next), and so can all that are there: then they
// are applied and nothing is answered. What asks so behind a tick that wants its answer stays in the inbox until that
// is given.
//
// Threads. Reactions (on_read, on_write, on_cancel, on_done) run on the loop's thread and only move messages. `plan` and
// `finish` run on a worker, one after the other for one stream (`busy_`): a thread of the scheduler; the loop's, when the
// last step was short, nothing else is to be read and a turn is free (`may_step_here`, `do_here`); or a loader, when it may
// take long. drain and end come from the thread that stops the server. All meet in `advance`, which decides what comes next.
//
// Order of gRPC operations. At most one read and one write are under way (`reading_`, `writing_`). `finish_call` is
// called once, when no worker is busy and no write is under way; nothing is started after it.
#pragma once

#include <grpcpp/alarm.h>
#include <grpcpp/support/async_stream.h>

#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "server/rpc/call.h"
#include "server/service/inbox.h"
#include "server/service/parts.h"
#include "server/service/session_tape.h"
#include "server/schedule/step_budget.h"
#include "server/schedule/tick_pace.h"
#include "server/session/session.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

using ControlCall = AsyncCall<grpc::ServerAsyncReaderWriter<v1::ControlResponse, v1::ControlRequest>>;

class ControlStream final : public ControlCall, public Drainable, public Scheduled, public ShortWork {
 public:
  // Takes a new call. It is registered and lives until gRPC is done with it. When the registry is full or drains, the call
  // is refused (RESOURCE_EXHAUSTED with a retry time, UNAVAILABLE). On the loop's thread.
  static void start(const ServiceParts& parts, const ServiceLimits& limits, EventLoop& loop,
                    std::unique_ptr<Incoming> incoming, std::string session_id);

  ControlStream(const ServiceParts& parts, const ServiceLimits& limits, EventLoop& loop,
                std::unique_ptr<Incoming> incoming, std::string session_id);
  ~ControlStream() override = default;

  void drain(const std::string& reason) override;
  void end(const grpc::Status& status) override;

 private:
  using Messages = std::deque<Inbox::Message>;
  using Replies = std::deque<v1::ControlResponse>;

  struct Work {
    Messages messages;
    std::optional<std::string> drain_reason;
    bool may_take_long = false;  // on a loader
    bool needs_loader = false;   // the oldest message that is left does
    v1::ControlResponse written;    // a camera's that nobody needs any more: its memory is the next one's
  };
  struct Outcome {
    Replies replies;
    std::optional<grpc::Status> end;  // close the call with it once the replies are written
  };
  // Of a step, as it was when its answer was ready.
  struct StepEnd {
    int64_t end_ns = 0;
    int64_t due_ns = 0;
    int64_t cost_ns = 0;  // of a thread's time
    bool behind = false;  // ticks came faster than they were stepped
    bool late() const { return end_ns > due_ns; }
  };
  struct Tally {
    uint64_t ticks = 0, steps = 0, degraded = 0, late = 0, rejections = 0;
  };

  // A client that does not speak.
  struct Silence final : Event {
    explicit Silence(ControlStream& its_stream) : stream(its_stream) {}
    void ready(bool ran_out) override;
    ControlStream& stream;
  };

  // Reactions.
  void on_read(bool ok) override;
  void on_write(bool ok) override;
  void on_cancel() override;
  void on_done() override;

  void wait_for_first_message(std::chrono::milliseconds timeout);
  void end_if_silent();

  // Need mutex_.
  void take_in(int64_t arrival_ns);
  std::optional<double> told_dt_s(const v1::Tick& tick);
  void advance();  // starts what can be done next, if anything
  void read_if_room();
  void ask_for_turn();
  bool may_step_here() const;
  bool has_work() const;
  void close(const grpc::Status& status);

  // A step on the loop's thread, or not; while busy_.
  void do_here() override;
  void pass_on() override;

  // On a worker, while busy_.
  TakeJob plan() override;
  void finish(const TakenMaps& taken) override;
  template <typename Part>
  void guarded(const Part& part);
  TakeJob work_through();  // leaves the messages that need a loader, or wait for the answer to those before
  void take_work();
  void open(Messages& messages, Outcome& outcome);
  Status open_session(const v1::OpenSession& request, int64_t arrival_ns, v1::SessionOpened& opened);
  std::optional<uint64_t> take_ticks(Work& work, Outcome& outcome);
  Status apply(const Inbox::Message& message);
  void note_step_control(const v1::StepControl& step);
  void answer(uint64_t newest_sequence, const Status& taken, Outcome& outcome);
  double share_of_thread(const StepEnd& end);
  void account(const StepEnd& end);
  void tell_economy(int former_level) const;
  void reject(const Error& error, uint64_t sequence, Outcome& outcome);

  // Constant after construction.
  const ServiceParts& parts_;
  const std::string session_id_;

  // By the worker while busy_; by close, which is called only when no worker is busy.
  std::unique_ptr<Session> session_;
  Tally tally_;
  std::optional<StepBudget> budget_;  // once opened
  FairShares::Slot share_slot_ = 0;   // once opened
  SessionTape tape_;
  // Of the ticks applied since the last step:
  uint32_t asked_merges_ = 0;      // those that asked to be merged
  bool wants_step_ = false;        // the newest did not
  std::optional<int> told_level_;  // what the newest says
  // Between `plan` and `finish`; the same memory every time:
  Work work_;
  Outcome outcome_;
  std::optional<uint64_t> stepping_;  // the newest tick of the step that is under way
  int level_ = 0;                     // of economy, of that step
  bool merged_ = false;               // it answers for others too, that did not ask for it
  int64_t interval_ns_ = 0;           // of the ticks

  // By gRPC while reading_, else guarded by mutex_.
  v1::ControlRequest request_;

  Silence silence_{*this};
  grpc::Alarm silence_alarm_;  // set once, at the start

  std::mutex mutex_;
  // Guarded by mutex_. The front of outbox_ belongs to gRPC while writing_.
  Inbox inbox_;
  Replies outbox_;
  v1::ControlResponse written_;  // the newest usual answer that was
  TickPace pace_;
  std::optional<double> told_time_s_;  // of the newest tick, as it says
  bool heard_ = false;         // a message has come
  bool opened_ = false;        // session_ exists
  bool needs_loader_ = false;  // the oldest tick takes long (takes_long)
  bool busy_ = false;          // a worker runs, or is about to
  bool here_ = false;          // on the loop's thread, and reads no further meanwhile
  int64_t last_cost_ns_ = 0;   // of the last step, of a thread's time; 0 before the first
  int64_t due_ns_ = 0;         // by when it is to be done
  bool reading_ = false;       // a read is under way
  bool writing_ = false;       // a write is under way
  bool reads_done_ = false;    // the client has closed its side, or is gone
  bool cancelled_ = false;
  bool finished_ = false;
  std::optional<std::string> drain_reason_;  // still to be told
  std::optional<grpc::Status> end_status_;   // close with it once everything in outbox_ is written
  std::shared_ptr<ControlStream> self_;      // from the start until on_done
};

}  // namespace sightline
