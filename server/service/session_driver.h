// One session from its opening to its end, without a transport: messages in, replies out.
//
// The driver works in turns. `plan` applies the messages of the turn: `open` opens the session, every tick is applied
// in order. It then plans ONE step, for the newest tick. `finish` receives the depth maps of that step and makes the
// reply. Messages that arrive during a turn wait for the next one, so the newest tick wins and no tick is lost.
//
// A tick can ask to be merged into the next one (StepControl.merge_into_next). It is applied, but no step is taken for
// it. When such ticks follow one that wants its reply, they are left for the next turn.
//
// Opening a session, and a tick for which a file must be read or a sample table built, can take seconds. Such messages
// are worked through only in a turn that may take long; in any other they are left and `needs_loader` is set.
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "server/schedule/quality_control.h"
#include "server/schedule/scheduler.h"
#include "server/schedule/step_stats.h"
#include "server/service/inbox.h"
#include "server/service/parts.h"
#include "server/service/session_recording.h"
#include "server/service/session_table.h"
#include "server/service/shape_memory.h"
#include "server/session/session.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// Not thread-safe: calls must not overlap, but may come from different threads.
class SessionDriver {
 public:
  // The input and output of a turn. Used again for every turn, which keeps its memory.
  struct Turn {
    // Set by the owner before `plan`:
    std::deque<Inbox::Message> messages;  // oldest first; `plan` leaves those that must wait for the next turn
    bool may_take_long = false;           // the turn runs on a loader
    // nobody waits for the turn any more; asked while it takes long, from any thread
    std::function<bool()> unwanted;
    int64_t tick_interval_ns = 1;  // as TickPace says, > 0
    v1::ControlResponse spare;     // a written reply whose memory the next reply uses
    // Set by `plan` and `finish`:
    std::deque<v1::ControlResponse> replies;
    std::optional<grpc::Status> end;  // close the call with this status once the replies are written
    bool needs_loader = false;        // the oldest message that is left needs a turn that may take long
  };

  // `parts` must outlive it. `reader` is the client, which may open its own uploads.
  SessionDriver(const ServiceParts& parts, std::string session_id, SceneReader reader = {});

  // Begins a turn. The job refers to the session and stays valid until `finish`; it is empty when no step is due.
  // Never throws: a failure ends the session with `turn.end`.
  TakeJob plan(Turn& turn);
  // Ends the turn. True: a step was taken, and `account` must follow.
  bool finish(Turn& turn, const TakenMaps& taken);
  // Learns from the step that was just finished: counters, share of the threads, quality level. Kept apart from
  // `finish` so that the reply need not wait for it. `times.behind` and `times.interval_ns` are completed here.
  void account(QualityControl::StepTimes times);
  // Ends the session and frees what it holds. Nothing may follow.
  void close(const grpc::Status& status);

  bool opened() const { return session_ != nullptr; }
  const std::string& session_id() const { return session_id_; }
  // Sequence number of the newest tick that was applied or refused; 0: there was none.
  uint64_t newest_sequence() const { return newest_sequence_; }
  // Describes an open session to a client that resumes it.
  void describe(v1::SessionOpened& opened) const;
  // The status of a call whose client has closed its side: OK, or INVALID_ARGUMENT when it never opened the session.
  grpc::Status status_after_last_message() const;
  // Time that the last step took of a thread, in nanoseconds; 0 before the first.
  int64_t last_cost_ns() const { return quality_ ? quality_->last_cost_ns() : 0; }

 private:
  using Messages = std::deque<Inbox::Message>;

  template <typename Part>
  void guarded(Turn& turn, const Part& part);

  void open(Turn& turn);
  Status open_session(const v1::OpenSession& request, int64_t arrival_ns, WorkLimit& work, v1::SessionOpened& opened);
  TakeJob begin_step(Turn& turn);
  std::optional<uint64_t> apply_ticks(Turn& turn);
  Status apply(const Inbox::Message& message, WorkLimit* work);
  Status check_budgets(const TickInput& tick, const v1::SceneDelta& delta);
  Status check_memory(const v1::SceneDelta& delta, size_t state_bytes, const char* field);
  void account_memory(const v1::SceneDelta& delta);
  Status check_cost(const StepSettings& settings, std::span<const Target> targets, const char* field);
  void note_step_control(const v1::StepControl& step);
  void answer(Turn& turn, const Status& taken);
  void end_by_defect(Turn& turn, const Error& error);
  void reject(Turn& turn, const Error& error, uint64_t sequence);
  void log_level_change(int former_level) const;

  // Constant after construction.
  const ServiceParts& parts_;
  const std::string session_id_;
  const SceneReader reader_;

  // The session and what goes with it.
  std::unique_ptr<Session> session_;       // null: not opened yet, or closed
  std::optional<QualityControl> quality_;  // from the opening to the end
  SessionRecording recording_;
  SessionCounters counters_;
  std::unique_ptr<SessionTable::Place> place_;  // while session_ is open
  InstanceShare instances_;
  ShapeMemory shapes_;
  size_t state_bytes_ = 0;  // as session_state_bytes, with its settings and targets

  // Requests of the ticks since the last step.
  uint32_t merges_asked_ = 0;        // number of ticks that asked to be merged
  bool step_wanted_ = false;         // the newest tick wants a step
  std::optional<int> chosen_level_;  // the quality level that the newest tick sets

  uint64_t newest_sequence_ = 0;

  // The step that is under way, or was the last one.
  std::optional<uint64_t> stepping_;  // sequence of its tick, between `plan` and `finish`
  int64_t newest_arrival_ns_ = 0;     // of its tick
  int64_t tick_interval_ns_ = 1;
  bool merged_ = false;  // its reply also covers ticks that did not ask to be merged
};

}  // namespace sightline
