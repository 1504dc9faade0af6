#include "server/service/control_stream.h"

#include <algorithm>
#include <new>
#include <utility>

#include "server/wire/error_to_proto.h"

namespace sightline {
namespace {

constexpr std::chrono::seconds kRetryDelay{5};
// A longer step is never taken on the loop's thread, because the loop cannot read meanwhile.
constexpr int64_t kShortStepNs = 1'000'000;
// A turn is due no sooner than this from now. A turn can start late because its client reads slowly or because a file
// was read first. That is no overload, and must not count as a missed deadline.
constexpr int64_t kLeastNoticeNs = 2'000'000;

// From the moment when an end is wanted, a client has this long to take the replies and the status. A client that reads
// needs milliseconds.
constexpr std::chrono::milliseconds kLastWrites{3000};

// A session is asked for a sign of life this often within the time that it may be silent.
constexpr int kAlarmsInSilence = 4;

const Error kNotKept{ErrorCode::kNotFound, "resume.token", "no session of this client is kept under this token"};
const grpc::Status kResumedElsewhere{grpc::StatusCode::ABORTED, "the session goes on in another call"};

grpc::Status refusal(Admission admission, const StreamRegistry& streams) {
  if (admission == Admission::kClientFull)
    return exhausted_status("all " + std::to_string(streams.max_per_client()) +
                                " sessions of this client are in use (--max-sessions-per-client)",
                            kRetryDelay);
  if (admission == Admission::kDraining) return {grpc::StatusCode::UNAVAILABLE, "the server is shutting down"};
  return exhausted_status("all " + std::to_string(streams.max_streams()) + " sessions are in use (--max-sessions)",
                          kRetryDelay);
}

void note_refusal(Admission admission, const std::string& client, const ServiceParts& parts) {
  parts.log.warn("session refused", {{"reason", to_string(admission)}, {"client", client}});
  if (admission == Admission::kFull) parts.stats.limits.hit(Limit::kMaxSessions);
  if (admission == Admission::kClientFull) parts.stats.limits.hit(Limit::kMaxSessionsPerClient);
}

Error too_large(size_t bytes, size_t most) {
  return {ErrorCode::kResourceExhausted, "message",
          "has " + std::to_string(bytes) + " bytes; " + std::to_string(most) + " are allowed (--max-message-mib)"};
}

// The next step can then take far longer than the last one, but for its targets. New poses can have that effect too,
// where things come together: the scheduler learns that from the first such step.
bool changes_settings(const v1::Tick& tick) {
  return tick.has_settings() || tick.has_tuning() || tick.step_control().has_quality_level();
}

// The tick that a reply answers; 0: it answers none.
uint64_t answered_by(const v1::ControlResponse& reply) {
  return reply.has_camera() ? reply.camera().sequence() : reply.tick_error().sequence();
}

}  // namespace

void ControlStream::start(const ServiceParts& parts, const ServiceLimits& limits, const StreamHelpers& helpers,
                          EventLoop& loop, std::unique_ptr<Incoming> incoming, const std::string& session_id,
                          const tl::expected<Caller, grpc::Status>& caller) {
  const SceneReader reader = caller ? SceneReader{caller->name, caller->sees_all()} : SceneReader{};
  const auto stream = std::make_shared<ControlStream>(parts, limits, helpers, loop, std::move(incoming), session_id,
                                                      reader);
  // Once it is registered another thread may drain it, which has to wait until it is complete.
  const MutexLock lock(stream->mutex_);
  stream->self_ = stream;
  if (!caller) {
    parts.log.warn("session refused", {{"reason", caller.error().error_message()}});
    stream->finished_ = true;
    return stream->finish_call(caller.error());
  }
  const std::string& client = caller->name;
  if (const Admission admission = parts.streams.add(stream, client); admission != Admission::kAdmitted) {
    if (!helpers.kept.enabled() || !parts.streams.add_waiting(stream, client)) {
      note_refusal(admission, client, parts);
      stream->finished_ = true;
      return stream->finish_call(refusal(admission, parts.streams));
    }
    stream->only_resumes_ = admission;
  }
  parts.scheduler.join(*stream, client);
  stream->read_if_room();
  stream->set_alarm(limits.open_timeout);
}

ControlStream::ControlStream(const ServiceParts& parts, const ServiceLimits& limits, const StreamHelpers& helpers,
                             EventLoop& loop, std::unique_ptr<Incoming> incoming, const std::string& session_id,
                             SceneReader reader)
    : ControlCall(loop, std::move(incoming)),
      parts_(parts),
      parsers_(helpers.parsers),
      claimers_(helpers.claimers),
      kept_(helpers.kept),
      timers_(helpers.timers),
      client_(reader.client),
      share_(helpers.messages.of(client_)),
      max_message_bytes_(limits.max_message_bytes),
      max_message_memory_(limits.max_message_memory),
      idle_limit_(limits.session_idle),
      driver_(std::make_unique<SessionDriver>(parts, session_id, std::move(reader))),
      inbox_(limits.inbox_messages, limits.inbox_bytes, share_) {
  turn_.unwanted = [this] { return unwanted_.load(); };
}

// --- reactions
// ---------------------------------------------------------------------------------------------------

void ControlStream::on_read(bool ok) {
  std::shared_ptr<ControlStream> for_loop;
  {
    const MutexLock lock(mutex_);
    reading_ = ok ? Reading::kPaused : Reading::kEnded;
    if (ok) parse(parts_.clock());
    if (may_run_on_loop()) {
      begin_turn(TurnState::kOnLoop);
      for_loop = self_;
    } else {
      read_if_room();
      advance();
    }
  }
  if (for_loop) loop().defer(std::move(for_loop));
}

void ControlStream::parse(int64_t arrival_ns) {
  if (bytes_.Length() > max_message_bytes_) return refuse_message(too_large(bytes_.Length(), max_message_bytes_));
  if (bytes_.Length() > kParsedOnLoop) return parse_elsewhere(arrival_ns);
  v1::ControlRequest request;
  if (const Status parsed = parse_message(bytes_, max_message_memory_, request))
    take_in(std::move(request), arrival_ns);
  else
    refuse_message(parsed.error());
}

// Nothing more is read meanwhile, so the order of the messages stays.
void ControlStream::parse_elsewhere(int64_t arrival_ns) {
  reading_ = Reading::kParsing;
  parsers_.post(
      [self = self_, arrival_ns] {
        v1::ControlRequest request;
        Status parsed;
        try {
          parsed = self->parse_large(request);
        } catch (const std::bad_alloc&) {
          parsed = fail(ErrorCode::kResourceExhausted, "message", "the server is out of memory");
        }
        const MutexLock lock(self->mutex_);
        if (self->finished_) return;
        self->reading_ = Reading::kPaused;
        parsed ? self->take_in(std::move(request), arrival_ns) : self->refuse_message(parsed.error());
        self->read_if_room();
        self->advance();
      },
      client_);
}

Status ControlStream::parse_large(v1::ControlRequest& request) {
  const size_t room = share_->room();
  const Status parsed = parse_message(bytes_, std::min(room, max_message_memory_), request);
  if (parsed || parsed.error().code != ErrorCode::kResourceExhausted || room >= max_message_memory_) return parsed;
  return fail(ErrorCode::kResourceExhausted, "message",
              "finds no memory beside the messages that wait (--messages-memory-mib)");
}

void ControlStream::refuse_message(const Error& error) {
  if (const auto limit = limit_of(error)) parts_.stats.limits.hit(*limit);
  if (!end_status_) end_status_ = status_from_error(error);
}

void ControlStream::take_in(v1::ControlRequest request, int64_t arrival_ns) {
  // The alarm for the opening becomes the one for silence.
  if (!std::exchange(heard_, true)) {
    cancel_alarm();
    begin(request);
    if (request.has_resume()) return;
  }
  if (!writing_) silent_alarms_ = 0;
  if (request.has_tick()) {
    const v1::Tick& tick = request.tick();
    note_changes(tick);
    pace_.observe(parts_.scheduler.now_ns(), {.time_s = tick.time_s(),
                                              .dt_s = tick.has_dt_s() ? std::optional(tick.dt_s()) : std::nullopt,
                                              .wants_reply = !tick.step_control().merge_into_next()});
  }
  inbox_.push(std::move(request), arrival_ns);
}

void ControlStream::note_changes(const v1::Tick& tick) {
  const int targets = tick.has_targets() ? tick.targets().targets_size() : targets_;
  const bool settings = changes_settings(tick);
  changes_.add(
      {.may_be_long = settings || targets > targets_,
       .not_only_poses = settings || tick.has_targets() || tick.has_delta() || tick.has_lens() || tick.has_shot()});
  targets_ = targets;
}

// The first message.
void ControlStream::begin(const v1::ControlRequest& request) {
  resumable_ = kept_.enabled() && request.open().resumable();
  targets_ = request.open().targets_size();
  if (request.has_resume()) return claim(request.resume());
  if (!only_resumes_) return;
  note_refusal(*only_resumes_, client_, parts_);
  end_status_ = refusal(*only_resumes_, parts_.streams);
}

// On another thread, since the answer may come at once, and takes the lock.
void ControlStream::claim(const v1::ResumeSession& request) {
  reading_ = Reading::kResuming;
  answered_ = request.answered_sequence();
  claimers_.post(
      [self = self_, token = request.token()] {
        try {
          self->kept_.claim(token, self->client_, self);
        } catch (const std::bad_alloc&) {
          self->on_no_memory();
        }
      },
      client_);
}

bool ControlStream::take_session(std::unique_ptr<DetachedSession>& session, const Drainable* holder) {
  const MutexLock lock(mutex_);
  if (finished_ || cancelled_ || end_status_ || reading_ != Reading::kResuming) return false;
  if (!session) {
    end_status_ = status_from_error(kNotKept);
    advance();
    return true;
  }
  if (!parts_.streams.move_place(holder, self_)) return false;
  token_ = std::move(session->token);
  driver_ = std::move(session->driver);
  pace_ = session->pace;
  opening_ = needs_loader_ = false;
  v1::ControlResponse reply;
  v1::SessionOpened& opened = *reply.mutable_opened();
  driver_->describe(opened);
  opened.set_resumed(true);
  opened.set_resume_token(token_);
  opened.set_resume_grace_s(std::chrono::duration<double>(kept_.grace()).count());
  outbox_.keep_written();
  outbox_.push(std::move(reply));
  for (v1::ControlResponse& answer : session->answers)
    if (answered_by(answer) > answered_) outbox_.push(std::move(answer));
  session.reset();
  reading_ = Reading::kPaused;
  read_if_room();
  advance();
  return true;
}

void ControlStream::give_session_up() {
  const MutexLock lock(mutex_);
  if (finished_) return;  // it is on its way already
  gives_up_ = true;
  // The client may be gone, and the present write would then never end.
  if (writing_) cancel_call();
  advance();
}

void ControlStream::on_write(bool ok) {
  const MutexLock lock(mutex_);
  writing_ = false;
  silent_alarms_ = 0;
  outbox_.pop();
  if (!ok) cancelled_ = true;
  advance();
}

void ControlStream::on_cancel() {
  const MutexLock lock(mutex_);
  cancelled_ = true;
  // A session that is kept goes on as if its stream had not broken.
  if (token_.empty()) unwanted_ = true;
  if (freed_at_the_end_ && detach()) freed_at_the_end_ = false;
  advance();
}

void ControlStream::on_alarm(bool ran_out) {
  const MutexLock lock(mutex_);
  alarm_set_ = false;
  if (finished_) return;
  if (end_status_) return hurried_ && ran_out ? cancel_call() : hurry();
  if (!heard_) {
    parts_.stats.limits.hit(Limit::kOpenTimeout);
    end_status_ = grpc::Status(grpc::StatusCode::DEADLINE_EXCEEDED, "`open` was not sent in time (--open-timeout-s)");
    return advance();
  }
  if (idle_limit_.count() == 0) return;
  // A session whose scene is still being read is not silent.
  silent_alarms_ = ran_out && turn_state_ == TurnState::kNone ? silent_alarms_ + 1 : 0;
  if (silent_alarms_ > kAlarmsInSilence) {
    parts_.stats.limits.hit(Limit::kSessionIdle);
    end_status_ = grpc::Status(grpc::StatusCode::DEADLINE_EXCEEDED,
                               "no tick came, or no reply was taken, for too long (--session-idle-s)");
    return advance();
  }
  set_alarm(idle_limit_ / kAlarmsInSilence);
}

void ControlStream::set_alarm(std::chrono::milliseconds timeout) {
  alarm_set_ = true;
  start_alarm(timers_, timeout);
}

// There is only one alarm, so that for silence ends first: on_alarm comes back here.
void ControlStream::hurry() {
  if (hurried_) return;
  if (alarm_set_) return cancel_alarm();
  hurried_ = true;
  set_alarm(kLastWrites);
}

void ControlStream::on_done() {
  // A worker may still be leaving `finish` with a reference of its own. The last reference destroys the stream, which
  // must not happen while the lock is held.
  std::shared_ptr<ControlStream> last;
  const MutexLock lock(mutex_);
  if (freed_at_the_end_) free_session(grpc::Status::OK);
  last = std::move(self_);
}

// A reaction, or a task of another thread, found no memory. What it had begun is not known, so the session ends.
void ControlStream::on_no_memory() {
  const MutexLock lock(mutex_);
  end_without_memory();
}

void ControlStream::end_without_memory() {
  if (finished_) return;
  if (!end_status_) end_status_ = grpc::Status(grpc::StatusCode::RESOURCE_EXHAUSTED, "the server is out of memory");
  advance();
}

void ControlStream::drain(const std::string& reason) {
  const MutexLock lock(mutex_);
  if (finished_) return;
  // Nobody waits for a file to be read while the server shuts down.
  if (opening_) unwanted_ = true;
  v1::ControlResponse reply;
  reply.mutable_drain()->set_reason(reason);
  outbox_.push(std::move(reply));
  advance();
}

void ControlStream::end(const grpc::Status& status) {
  const MutexLock lock(mutex_);
  if (!end_status_) end_status_ = status;
  unwanted_ = true;
  advance();
}

// --- what comes next
// ---------------------------------------------------------------------------------------------

// gRPC is called with the lock held, so that the order of its operations is the order of our decisions. That is safe
// because gRPC never runs a reaction inside such a call: reactions come from the loop.
void ControlStream::read_if_room() {
  if (reading_ != Reading::kPaused || finished_ || turn_state_ == TurnState::kOnLoop || inbox_.full()) return;
  reading_ = Reading::kUnderWay;
  start_read(bytes_);
}

void ControlStream::begin_turn(TurnState where) {
  turn_state_ = where;
  due_ns_ = std::max(pace_.deadline_ns(), parts_.scheduler.now_ns() + kLeastNoticeNs);
}

void ControlStream::advance() {
  if (finished_ || turn_state_ != TurnState::kNone) return;
  if (writing_) {
    if (end_status_) hurry();
    return;
  }
  if (cancelled_) return close(hurried_ ? *end_status_ : grpc::Status::CANCELLED);
  if (gives_up_) return close(kResumedElsewhere);
  if (!outbox_.empty()) {
    writing_ = true;
    if (end_status_) hurry();
    return start_write(outbox_.front());
  }
  if (end_status_) return close(*end_status_);
  if (!inbox_.empty()) {
    begin_turn(TurnState::kOnWorker);
    if (!needs_loader_) return parts_.scheduler.post(self_, due_ns_, changes_.may_be_long);
    return parts_.loaders.post([self = self_] { self->parts_.scheduler.run_now(*self); }, client_);
  }
  if (reading_ == Reading::kEnded) close(driver_->status_after_last_message());
}

// The session is freed before the call ends, then its entry in the registry. A client that has seen the end finds both
// free. A resumable session is freed only after the call, once it is certain that its stream did not break.
void ControlStream::close(const grpc::Status& status) {
  finished_ = true;
  const bool may_be_kept = !token_.empty() && driver_->opened() && !end_status_;
  if (may_be_kept && !cancelled_ && !gives_up_)
    freed_at_the_end_ = true;
  else if (!may_be_kept || !detach())
    free_session(status);
  inbox_.clear();
  cancel_alarm();
  finish_call(status);
}

// False: the session cannot be kept. Messages that have come and were not applied are forgotten: the client sends them
// again.
bool ControlStream::detach() {
  auto session = std::make_unique<DetachedSession>();
  session->token = token_;
  session->driver = std::move(driver_);
  session->pace = pace_;
  session->answers = outbox_.take_all();
  if (kept_.keep(this, session)) return true;
  driver_ = std::move(session->driver);
  return false;
}

void ControlStream::free_session(const grpc::Status& status) {
  freed_at_the_end_ = false;
  driver_->close(status);
  outbox_.clear();
  parts_.streams.remove(this);
  if (!token_.empty()) kept_.forget(token_);
}

// --- a turn
// -----------------------------------------------------------------------------------------------------

// A short step runs on the thread that read its tick, because waking another thread would take as long. A step is
// expected to be short if the last one was, and if nothing but poses has changed.
bool ControlStream::may_run_on_loop() const {
  if (finished_ || turn_state_ != TurnState::kNone || writing_ || cancelled_ || end_status_) return false;
  if (needs_loader_ || changes_.not_only_poses || !outbox_.empty() || inbox_.empty()) return false;
  return driver_->last_cost_ns() > 0 && driver_->last_cost_ns() <= kShortStepNs;
}

// The next read starts only after the step. Starting it makes gRPC send a window update at once, which delays the
// reply, and this thread could not read earlier anyway.
void ControlStream::run_on_loop() {
  if (!parts_.scheduler.try_run_now(*this, due_ns_)) return hand_over();
  const MutexLock lock(mutex_);
  read_if_room();
}

void ControlStream::hand_over() {
  const MutexLock lock(mutex_);
  turn_state_ = TurnState::kOnWorker;
  read_if_room();
  parts_.scheduler.post(self_, due_ns_);
}

TakeJob ControlStream::plan() {
  fill_turn();
  return driver_->plan(turn_);
}

// Opening takes one message, so that the ticks behind it are worked through by the scheduler's threads. A call that has
// ended while it waited for a worker gets nothing, since scenes may take seconds to read.
void ControlStream::fill_turn() {
  const MutexLock lock(mutex_);
  turn_.messages.clear();
  turn_.spare = outbox_.take_spare();
  turn_.tick_interval_ns = pace_.interval_ns();
  turn_.may_take_long = needs_loader_;
  changes_of_turn_ = std::exchange(changes_, {});
  if (cancelled_ || end_status_) return;
  if (driver_->opened())
    inbox_.take_all(turn_.messages);
  else if (!inbox_.empty())
    turn_.messages.push_back(inbox_.take_one());
  read_if_room();
}

void ControlStream::finish(const TakenMaps& taken) try { end_turn(taken); } catch (const std::bad_alloc&) {
  const MutexLock lock(mutex_);
  turn_state_ = TurnState::kNone;
  end_without_memory();
}

void ControlStream::end_turn(const TakenMaps& taken) {
  const int64_t start_ns = parts_.scheduler.now_ns();
  const bool stepped = driver_->finish(turn_, taken);
  const MutexLock lock(mutex_);
  const int64_t end_ns = parts_.scheduler.now_ns();
  const QualityControl::StepTimes times{
      .end_ns = end_ns, .due_ns = due_ns_, .cost_ns = taken.cost_ns + (end_ns - start_ns), .behind = !inbox_.empty()};
  turn_state_ = TurnState::kNone;
  opening_ = !driver_->opened();
  needs_loader_ = opening_ || turn_.needs_loader;
  if (!stepped || !turn_.messages.empty()) changes_.add(changes_of_turn_);
  for (const Inbox::Message& left : turn_.messages) note_changes(left.request.tick());
  inbox_.put_back(turn_.messages);
  if (resumable_ && token_.empty() && driver_->opened()) issue_token();
  for (v1::ControlResponse& reply : turn_.replies) outbox_.push(std::move(reply));
  if (turn_.end && !end_status_) end_status_ = std::move(turn_.end);
  advance();
  // This runs after the reply was sent, which it would otherwise delay.
  if (stepped && !finished_) driver_->account(times);
}

// Puts the token into the reply to the opening. The recording has that reply without the token, which is a secret.
void ControlStream::issue_token() {
  token_ = kept_.issue(client_, self_);
  outbox_.keep_written();
  v1::SessionOpened& opened = *turn_.replies.front().mutable_opened();
  opened.set_resume_token(token_);
  opened.set_resume_grace_s(std::chrono::duration<double>(kept_.grace()).count());
}

}  // namespace sightline
