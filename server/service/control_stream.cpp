#include "server/service/control_stream.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <new>
#include <utility>

#include "server/wire/from_proto.h"
#include "server/service/retry_info.h"
#include "server/wire/error_to_proto.h"
#include "server/wire/to_proto.h"

namespace sightline {
namespace {

constexpr std::chrono::seconds kRetryDelay{5};
// Reading waits for no longer than this.
constexpr int64_t kShortStepNs = 1'000'000;
constexpr int64_t kLeastNoticeNs = 2'000'000;

grpc::Status refusal(Admission admission, size_t max_streams) {
  if (admission == Admission::kDraining) return {grpc::StatusCode::UNAVAILABLE, "the server is going away"};
  return exhausted_status("all " + std::to_string(max_streams) + " sessions are in use (--max-sessions)",
                          kRetryDelay);
}

const Error kNotOpened{ErrorCode::kInvalidArgument, "open",
                       "the first message of a Control call must be `open`"};
const Error kOpenedTwice{ErrorCode::kFailedPrecondition, "open", "the session is open already"};
const Error kEmptyMessage{ErrorCode::kInvalidArgument, "message", "neither `open` nor `tick` is set"};

// How many of the newest messages are ticks that ask to be merged into what comes next.
size_t ask_to_be_merged(const std::deque<Inbox::Message>& messages) {
  const auto other = std::find_if(messages.rbegin(), messages.rend(), [](const Inbox::Message& message) {
    return !message.request.tick().step().merge_into_next();
  });
  return static_cast<size_t>(other - messages.rbegin());
}

// Whose memory is worth keeping: what is drawn of a step takes much of it.
bool is_usual(const v1::ControlReply& reply) {
  return reply.has_camera() && !reply.camera().has_candidates() && reply.camera().depth_maps().empty();
}

}  // namespace

void ControlStream::start(const ServiceParts& parts, const ServiceLimits& limits, EventLoop& loop,
                          std::unique_ptr<Incoming> incoming, std::string session_id) {
  const auto stream =
      std::make_shared<ControlStream>(parts, limits, loop, std::move(incoming), std::move(session_id));
  // Once registered it may be drained, from another thread: not before it is whole.
  const std::lock_guard lock(stream->mutex_);
  stream->self_ = stream;
  if (const Admission admission = parts.streams.add(stream); admission != Admission::kAdmitted) {
    parts.log.warn("session refused", {{"reason", admission == Admission::kFull ? "full" : "draining"}});
    stream->finished_ = true;
    return stream->finish_call(refusal(admission, parts.streams.max_streams()));
  }
  stream->reading_ = true;
  stream->start_read(stream->request_);
  stream->wait_for_first_message(limits.open_timeout);
}

ControlStream::ControlStream(const ServiceParts& parts, const ServiceLimits& limits, EventLoop& loop,
                             std::unique_ptr<Incoming> incoming, std::string session_id)
    : ControlCall(loop, std::move(incoming)),
      parts_(parts),
      session_id_(std::move(session_id)),
      tape_(parts.recording, parts.clock, parts.scenes, parts.log),
      inbox_(limits.inbox_messages, limits.inbox_bytes) {}

// --- reactions
// ---------------------------------------------------------------------------------------------------

void ControlStream::on_read(bool ok) {
  std::shared_ptr<ControlStream> here;
  {
    const std::lock_guard lock(mutex_);
    reading_ = false;
    if (ok) {
      heard_ = true;
      take_in(parts_.clock());
    } else {
      reads_done_ = true;
    }
    if (may_step_here()) {
      ask_for_turn();
      here_ = true;
      here = self_;
    } else {
      read_if_room();
      advance();
    }
  }
  if (here) loop().soon(std::move(here));
}

// A short step is taken where its tick was read, when a thread would be free for it: another one need not be woken.
bool ControlStream::may_step_here() const {
  const bool free = !finished_ && !busy_ && !writing_ && !cancelled_ && !end_status_ && outbox_.empty();
  if (!free || !opened_ || needs_loader_ || drain_reason_ || inbox_.empty()) return false;
  return last_cost_ns_ > 0 && last_cost_ns_ <= kShortStepNs;
}

// To ask for the next message tells the client how much it may send, at once and before the reply: so it is asked for after the
// step, for this thread would not read it before.
void ControlStream::do_here() {
  if (!parts_.steppers.try_here(*this)) return pass_on();
  const std::lock_guard lock(mutex_);
  here_ = false;
  read_if_room();
}

void ControlStream::pass_on() {
  const std::lock_guard lock(mutex_);
  here_ = false;
  read_if_room();
  parts_.steppers.post(self_, due_ns_);
}

void ControlStream::take_in(int64_t arrival_ns) {
  if (request_.has_tick()) {
    const std::optional<double> dt_s = told_dt_s(request_.tick());
    // One that asks for no step sets nobody a deadline.
    if (!request_.tick().step().merge_into_next()) pace_.observe(parts_.steppers.now_ns(), dt_s);
  }
  inbox_.push(std::exchange(request_, {}), arrival_ns);
}

// Of a tick, as Session::apply takes it.
std::optional<double> ControlStream::told_dt_s(const v1::Tick& tick) {
  const double time_s = tick.time_s();
  const std::optional<double> former_s = std::exchange(told_time_s_, time_s);
  if (tick.has_dt_s()) return tick.dt_s();
  return former_s ? std::optional(time_s - *former_s) : std::nullopt;
}

void ControlStream::on_write(bool ok) {
  const std::lock_guard lock(mutex_);
  writing_ = false;
  if (is_usual(outbox_.front())) written_ = std::move(outbox_.front());
  outbox_.pop_front();
  if (!ok) cancelled_ = true;
  advance();
}

void ControlStream::on_cancel() {
  const std::lock_guard lock(mutex_);
  cancelled_ = true;
  advance();
}

void ControlStream::on_done() {
  // A worker may still be on its way out of `run` with a reference of its own; the last one destroys this.
  std::shared_ptr<ControlStream> last;
  const std::lock_guard lock(mutex_);
  last = std::move(self_);
}

void ControlStream::drain(const std::string& reason) {
  const std::lock_guard lock(mutex_);
  drain_reason_ = reason;
  advance();
}

void ControlStream::end(const grpc::Status& status) {
  const std::lock_guard lock(mutex_);
  if (!end_status_) end_status_ = status;
  advance();
}

void ControlStream::wait_for_first_message(std::chrono::milliseconds timeout) {
  begin();
  silence_alarm_.Set(&loop().queue(), std::chrono::system_clock::now() + timeout, &silence_);
}

// `close` cancels the alarm, or it would keep the call.
void ControlStream::Silence::ready(bool ran_out) {
  if (ran_out) stream.end_if_silent();
  stream.over();
}

void ControlStream::end_if_silent() {
  const std::lock_guard lock(mutex_);
  if (heard_ || end_status_) return;
  end_status_ =
      grpc::Status(grpc::StatusCode::DEADLINE_EXCEEDED, "no `open` came in time (--open-timeout-s)");
  advance();
}

// --- what comes next
// ---------------------------------------------------------------------------------------------

// gRPC is called with the lock held, so that the order of its operations is the order of our decisions. That
// is safe because it never runs a reaction inside such a call: reactions come from the loop.
void ControlStream::read_if_room() {
  if (reading_ || reads_done_ || finished_ || here_ || inbox_.full()) return;
  reading_ = true;
  start_read(request_);
}

bool ControlStream::has_work() const {
  return !inbox_.empty() || drain_reason_.has_value();
}

void ControlStream::ask_for_turn() {
  busy_ = true;
  // Who asks late, since its client reads slowly or a file was read first, has not been kept waiting by the others.
  due_ns_ = std::max(pace_.deadline_ns(), parts_.steppers.now_ns() + kLeastNoticeNs);
}

void ControlStream::advance() {
  if (finished_ || busy_ || writing_) return;
  if (cancelled_) return close(grpc::Status::CANCELLED);
  if (!outbox_.empty()) {
    writing_ = true;
    return start_write(outbox_.front());
  }
  if (end_status_) return close(*end_status_);
  if (has_work()) {
    ask_for_turn();
    if (opened_ && !needs_loader_) return parts_.steppers.post(self_, due_ns_);
    return parts_.loaders.post([self = self_] { self->parts_.steppers.run_here(*self); });
  }
  if (reads_done_) close(opened_ ? grpc::Status::OK : status_from_error(kNotOpened));
}

// The session goes first and the place in the registry next, so that a client that has seen the end finds
// both free.
void ControlStream::close(const grpc::Status& status) {
  finished_ = true;
  session_.reset();
  tape_.close();
  if (budget_) parts_.shares.leave(share_slot_);
  inbox_.clear();
  outbox_.clear();
  parts_.streams.remove(this);
  parts_.log.info("session closed",
                  {{"session", session_id_},
                   {"status", std::to_string(status.error_code())},
                   {"reason", status.error_message()},
                   {"ticks", std::to_string(tally_.ticks)},
                   {"steps", std::to_string(tally_.steps)},
                   {"degraded", std::to_string(tally_.degraded)},
                   {"late", std::to_string(tally_.late)},
                   {"step_us", budget_ ? std::to_string(std::lround(budget_->full_cost_ns() * 1e-3)) : "0"},
                   {"rejections", std::to_string(tally_.rejections)},
                   {"recording", tape_.name().empty() ? "none" : tape_.name()}});
  silence_alarm_.Cancel();
  finish_call(status);
}

// --- on a worker
// -------------------------------------------------------------------------------------------------

TakeJob ControlStream::plan() {
  take_work();
  outcome_.replies.clear();
  outcome_.end.reset();
  if (work_.drain_reason)
    *outcome_.replies.emplace_back().mutable_drain()->mutable_reason() = *work_.drain_reason;
  TakeJob job;
  guarded([&] { job = work_through(); });
  return job;
}

void ControlStream::finish(const TakenMaps& taken) {
  const int64_t start_ns = parts_.steppers.now_ns();
  const bool stepped = stepping_.has_value();
  guarded([&] {
    if (taken.trouble) std::rethrow_exception(taken.trouble);
    if (stepping_) answer(*stepping_, taken.status, outcome_);
  });
  stepping_.reset();
  const std::lock_guard lock(mutex_);
  const int64_t end_ns = parts_.steppers.now_ns();
  const StepEnd end{.end_ns = end_ns,
                    .due_ns = due_ns_,
                    .cost_ns = taken.cost_ns + (end_ns - start_ns),
                    .behind = merged_ || !inbox_.empty()};
  busy_ = false;
  opened_ = session_ != nullptr;
  needs_loader_ = work_.needs_loader;
  inbox_.put_back(work_.messages);
  for (v1::ControlReply& reply : outcome_.replies) outbox_.push_back(std::move(reply));
  if (outcome_.end && !end_status_) end_status_ = std::move(outcome_.end);
  advance();
  // Behind the reply, which it would keep waiting.
  if (stepped && !finished_) account(end);
}

// What throws is out of memory or wrong in itself. It costs this session, which may be half changed, and no
// other.
template <typename Part>
void ControlStream::guarded(const Part& part) try {
  part();
} catch (const std::bad_alloc&) {
  tape_.fault(stepping_.value_or(0), "session", "out of memory");
  outcome_.end = grpc::Status(grpc::StatusCode::RESOURCE_EXHAUSTED, "out of memory");
} catch (const std::exception& trouble) {
  parts_.log.error("session failed", {{"session", session_id_}, {"reason", trouble.what()}});
  tape_.fault(stepping_.value_or(0), "session", trouble.what());
  outcome_.end = grpc::Status(grpc::StatusCode::INTERNAL, "the session failed; the server's log says why");
}

TakeJob ControlStream::work_through() {
  if (!session_) {
    open(work_.messages, outcome_);
    return {};
  }
  const std::optional<uint64_t> newest = take_ticks(work_, outcome_);
  if (!newest) return {};
  level_ = told_level_.value_or(budget_->level());
  TakeJob job = session_->begin_step(level_);
  stepping_ = newest;
  merged_ = false;
  return job;
}

// What the session may use of a thread, once it was told what it asks for. A step at a level that the client chose
// says nothing of what the others cost.
double ControlStream::share_of_thread(const StepEnd& end) {
  const double cost_ns = told_level_ ? static_cast<double>(last_cost_ns_) : budget_->full_cost_ns();
  const double demand = std::min(cost_ns / static_cast<double>(interval_ns_), 1.0);
  return parts_.shares.tell(share_slot_, demand, end.late(), end.end_ns);
}

// Needs mutex_.
void ControlStream::account(const StepEnd& end) {
  const int level = budget_->level();
  last_cost_ns_ = end.cost_ns;
  tally_.late += end.late();
  parts_.stats.late.fetch_add(end.late(), std::memory_order_relaxed);
  const double share = share_of_thread(end);
  if (told_level_) return;
  budget_->stepped({.end_ns = end.end_ns,
                    .cost_ns = end.cost_ns,
                    .interval_ns = interval_ns_,
                    .behind = end.behind,
                    .share = share});
  if (budget_->level() != level) tell_economy(level);
}

void ControlStream::tell_economy(int former_level) const {
  if (!session_) return;
  const int level = budget_->level();
  const std::string leaves_out = describe_degradation(session_->settings(), level);
  parts_.log.info("session economy", {{"session", session_id_},
                                      {"level", std::to_string(level)},
                                      {"former", std::to_string(former_level)},
                                      {"leaves_out", leaves_out.empty() ? "nothing" : leaves_out}});
}

// Opening takes one message, so that the ticks behind it are worked through by the steppers. A call
// that has ended while it waited for a worker costs that worker nothing: scenes may take seconds to read.
void ControlStream::take_work() {
  const std::lock_guard lock(mutex_);
  work_.messages.clear();
  work_.written = std::move(written_);
  work_.drain_reason.reset();
  work_.may_take_long = work_.needs_loader = false;
  if (cancelled_ || end_status_) return;
  work_.drain_reason.swap(drain_reason_);
  interval_ns_ = pace_.interval_ns();
  if (session_) {
    inbox_.take_all(work_.messages);
    work_.may_take_long = needs_loader_;
  } else if (!inbox_.empty()) {
    work_.messages.push_back(inbox_.take_one());
  }
  read_if_room();
}

void ControlStream::open(Messages& messages, Outcome& outcome) {
  if (messages.empty()) return;
  const Inbox::Message message = std::move(messages.front());
  messages.pop_front();
  v1::ControlReply reply;
  const Status opened =
      message.request.has_open()
          ? open_session(message.request.open(), message.arrival_ns, *reply.mutable_opened())
          : tl::unexpected(kNotOpened);
  if (opened) {
    outcome.replies.push_back(std::move(reply));
  } else {
    parts_.log.warn("open refused", {{"session", session_id_}, {"reason", to_string(opened.error())}});
    outcome.end = status_from_error(opened.error());
  }
}

Status ControlStream::open_session(const v1::OpenSession& request, int64_t arrival_ns,
                                   v1::SessionOpened& opened) {
  std::vector<std::string> warnings;
  auto options = session_options_from_proto(request, SceneSource{parts_.scenes, parts_.geometry}, warnings);
  if (!options) return tl::unexpected(std::move(options.error()));
  options->extents = &parts_.extents;
  auto session = Session::open(std::move(*options), parts_.sampler.make_sampler(), parts_.clock);
  if (!session) return tl::unexpected(std::move(session.error()));
  session_ = std::move(*session);
  BudgetRules rules = parts_.budget;
  rules.degrade = rules.degrade && !request.never_degrade();
  budget_.emplace(rules);
  share_slot_ = parts_.shares.join();
  opened_to_proto(*session_, opened);
  opened.set_session_id(session_id_);
  opened.set_sampler(parts_.sampler.kind());
  for (std::string& warning : warnings) opened.add_warnings(std::move(warning));
  tape_.open(request, arrival_ns, opened);
  parts_.log.info("session opened", {{"session", session_id_},
                                     {"label", request.label()},
                                     {"instances", std::to_string(opened.instances())},
                                     {"triangles", std::to_string(opened.triangles())},
                                     {"targets", std::to_string(session_->targets().size())}});
  return {};
}

// Every tick is applied; one step is taken for the newest that was, unless that one asks for none. A tick for which a
// file must be read or a sample table built, and those behind it, are left to a loader: the steps of other sessions do
// not wait for it.
std::optional<uint64_t> ControlStream::take_ticks(Work& work, Outcome& outcome) {
  std::optional<uint64_t> newest;
  Messages& messages = work.messages;
  for (size_t left_for_next = ask_to_be_merged(messages); !messages.empty(); messages.pop_front()) {
    const Inbox::Message& message = messages.front();
    const v1::Tick& tick = message.request.tick();
    if (newest && wants_step_ && messages.size() <= left_for_next) break;
    work.needs_loader = !work.may_take_long &&
                        (takes_long(tick, *session_, parts_.scenes) || tape_.lacks_scenes(tick));
    if (work.needs_loader) break;
    if (const Status applied = apply(message)) {
      newest = tick.sequence();
      note_step_control(tick.step());
      tape_.attach_scenes(tick);
    } else {
      reject(applied.error(), tick.sequence(), outcome);
    }
  }
  return wants_step_ ? newest : std::nullopt;
}

void ControlStream::note_step_control(const v1::StepControl& step) {
  wants_step_ = !step.merge_into_next();
  asked_merges_ += step.merge_into_next();
  told_level_.reset();
  if (step.has_economy_level()) told_level_ = static_cast<int>(step.economy_level());
}

Status ControlStream::apply(const Inbox::Message& message) {
  if (message.request.has_open()) return tl::unexpected(kOpenedTwice);
  if (!message.request.has_tick()) return tl::unexpected(kEmptyMessage);
  ++tally_.ticks;
  tape_.tick(message.request.tick(), message.arrival_ns);
  auto tick = tick_from_proto(message.request.tick(), *session_, SceneSource{parts_.scenes, parts_.geometry});
  if (!tick) return tl::unexpected(std::move(tick.error()));
  tick->arrival_ns = message.arrival_ns;
  return session_->apply(*tick);
}

void ControlStream::answer(uint64_t newest_sequence, const Status& taken, Outcome& outcome) {
  const auto answer = session_->finish_step(taken);
  if (!answer) {
    Error error = answer.error();
    error.message.insert(0, "the tick was applied, its step failed: ");
    tape_.fault(newest_sequence, "sample", to_string(answer.error()));
    return reject(error, newest_sequence, outcome);
  }
  const bool degraded = answer->degraded.has_value();
  merged_ = answer->merged_ticks > std::exchange(asked_merges_, 0);
  ++tally_.steps;
  tally_.degraded += degraded;
  parts_.stats.steps.fetch_add(1, std::memory_order_relaxed);
  parts_.stats.degraded.fetch_add(degraded, std::memory_order_relaxed);
  parts_.stats.queue.add(answer->queue_ns);
  v1::CameraReply& reply = *outcome.replies.emplace_back(std::move(work_.written)).mutable_camera();
  camera_reply_to_proto(*answer, *session_, session_->diagnostics(), reply);
  tape_.reply(reply);
}

void ControlStream::reject(const Error& error, uint64_t sequence, Outcome& outcome) {
  ++tally_.rejections;
  parts_.log.debug(
      "tick refused",
      {{"session", session_id_}, {"sequence", std::to_string(sequence)}, {"reason", to_string(error)}});
  v1::Rejection& rejection = *outcome.replies.emplace_back().mutable_rejected();
  rejection_to_proto(error, sequence, &session_->mirror(), rejection);
  tape_.rejection(rejection);
}

}  // namespace sightline
