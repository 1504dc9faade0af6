#include "server/service/session_driver.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <new>
#include <utility>

#include "server/session/target_tables.h"
#include "server/wire/error_to_proto.h"
#include "server/wire/from_proto.h"
#include "server/wire/to_proto.h"

namespace sightline {
namespace {

const Error kNotOpened{ErrorCode::kInvalidArgument, "open",
                       "the first message of a Control call must be `open` or `resume`"};
const Error kOpenedTwice{ErrorCode::kFailedPrecondition, "open", "the session is already open"};
const Error kResumedLate{ErrorCode::kFailedPrecondition, "resume",
                         "`resume` must be the first message of a Control call"};
const Error kEmptyMessage{ErrorCode::kInvalidArgument, "message", "neither `open` nor `tick` is set"};

// Number of ticks at the end of the queue that ask to be merged into the next one.
size_t merges_at_end(const std::deque<Inbox::Message>& messages) {
  const auto other = std::find_if(messages.rbegin(), messages.rend(), [](const Inbox::Message& message) {
    return !message.request.tick().step_control().merge_into_next();
  });
  return static_cast<size_t>(other - messages.rbegin());
}

}  // namespace

SessionDriver::SessionDriver(const ServiceParts& parts, std::string session_id, SceneReader reader)
    : parts_(parts),
      session_id_(std::move(session_id)),
      reader_(std::move(reader)),
      recording_(parts.recording, parts.clock, parts.scenes, reader_, parts.log),
      counters_(parts.stats),
      instances_(parts.session_limits, parts.instance_memory, reader_.client, &parts.stats.limits) {}

TakeJob SessionDriver::plan(Turn& turn) {
  turn.replies.clear();
  turn.end.reset();
  turn.needs_loader = false;
  tick_interval_ns_ = turn.tick_interval_ns;
  TakeJob job;
  guarded(turn, [&] {
    if (session_)
      job = begin_step(turn);
    else
      open(turn);
  });
  return job;
}

bool SessionDriver::finish(Turn& turn, const TakenMaps& taken) {
  const bool stepped = stepping_.has_value();
  guarded(turn, [&] {
    if (taken.trouble) std::rethrow_exception(taken.trouble);
    if (stepped) answer(turn, taken.status);
  });
  stepping_.reset();
  return stepped;
}

void SessionDriver::account(QualityControl::StepTimes times) {
  times.interval_ns = tick_interval_ns_;
  times.behind = times.behind || merged_;
  counters_.deadline(times.late());
  if (const std::optional<int> former = quality_->finish_step(times)) log_level_change(*former);
  counters_.at_level(quality_->level());
}

grpc::Status SessionDriver::status_after_last_message() const {
  return opened() ? grpc::Status::OK : status_from_error(kNotOpened);
}

void SessionDriver::close(const grpc::Status& status) {
  if (session_) counters_.closed(status.error_code());
  session_.reset();
  place_.reset();
  (void)instances_.resize(0, 0, 0, "");
  shapes_ = {};
  recording_.close();
  const double full_cost_us = quality_ ? quality_->full_cost_ns() * 1e-3 : 0.0;
  quality_.reset();
  parts_.log.info("session closed", {{"session", session_id_},
                                     {"status", std::to_string(status.error_code())},
                                     {"reason", status.error_message()},
                                     {"ticks", std::to_string(counters_.ticks())},
                                     {"steps", std::to_string(counters_.steps())},
                                     {"degraded", std::to_string(counters_.degraded())},
                                     {"late", std::to_string(counters_.late())},
                                     {"step_us", std::to_string(std::lround(full_cost_us))},
                                     {"rejections", std::to_string(counters_.rejections())},
                                     {"recording", recording_.name().empty() ? "none" : recording_.name()}});
}

// An exception means that memory has run out or that the server has a defect. It ends this session, which may be half
// changed, and no other.
template <typename Part>
void SessionDriver::guarded(Turn& turn, const Part& part) try {
  part();
} catch (const std::bad_alloc&) {
  recording_.fault(stepping_.value_or(0), "session", "out of memory");
  turn.end = grpc::Status(grpc::StatusCode::RESOURCE_EXHAUSTED, "out of memory");
} catch (const std::exception& trouble) {
  parts_.log.error("session failed", {{"session", session_id_}, {"reason", trouble.what()}});
  recording_.fault(stepping_.value_or(0), "session", trouble.what());
  turn.end = grpc::Status(grpc::StatusCode::INTERNAL, "the session failed; the server's log says why");
}

// --- opening
// ----------------------------------------------------------------------------------------------------

void SessionDriver::open(Turn& turn) {
  if (turn.messages.empty()) return;
  const Inbox::Message message = std::move(turn.messages.front());
  turn.messages.pop_front();
  v1::ControlResponse reply;
  WorkLimit work(parts_.load, turn.unwanted);
  const Status opened = message.request.has_open()
                            ? open_session(message.request.open(), message.arrival_ns, work, *reply.mutable_opened())
                            : tl::unexpected(kNotOpened);
  if (opened) {
    turn.replies.push_back(std::move(reply));
  } else {
    counters_.open_refused();
    if (work.ended() && opened.error().code == ErrorCode::kResourceExhausted) counters_.hit(Limit::kMaxLoad);
    parts_.log.warn("open refused", {{"session", session_id_}, {"reason", to_string(opened.error())}});
    turn.end = status_from_error(opened.error());
  }
}

Status SessionDriver::open_session(const v1::OpenSession& request, int64_t arrival_ns, WorkLimit& work,
                                   v1::SessionOpened& opened) {
  // Before the shapes are built, which takes the memory.
  const size_t named = static_cast<size_t>(request.instances_size());
  if (Status ok = instances_.resize(named, bytes_of_shapes(request.instances()), 0, "open.instances"); !ok) return ok;
  std::vector<std::string> warnings;
  auto options = session_options_from_proto(request, SceneSource{parts_.scenes, parts_.geometry, reader_, &work},
                                            warnings);
  if (!options) return tl::unexpected(std::move(options.error()));
  if (Status ok = check_cost(options->settings, options->targets, "open.settings"); !ok) return ok;
  const size_t count = options->instances.size();
  state_bytes_ = session_state_bytes(options->settings, options->targets.size());
  if (Status ok = instances_.resize(count, bytes_of_shapes(request.instances()), state_bytes_, "open.instances"); !ok)
    return ok;
  if (Status ok = build_target_tables(*options, parts_.extents, work); !ok) return ok;
  options->extents = &parts_.extents;
  auto session = Session::open(std::move(*options), parts_.sampler.make_sampler(), parts_.clock);
  if (!session) return tl::unexpected(std::move(session.error()));
  session_ = std::move(*session);
  shapes_.add(request.instances(), session_->mirror());
  (void)instances_.resize(count, shapes_.bytes(), state_bytes_, "");
  BudgetRules rules = parts_.budget;
  rules.degrade = rules.degrade && request.degradation_policy() != v1::DEGRADATION_POLICY_NEVER;
  quality_.emplace(rules, parts_.shares, reader_.client);
  counters_.opened();
  place_ = parts_.sessions.open(session_id_, request.label(), reader_.client, parts_.clock());
  opened_to_proto(*session_, opened);
  opened.set_session_id(session_id_);
  opened.set_sampler(parts_.sampler.kind());
  for (std::string& warning : warnings) opened.add_warnings(std::move(warning));
  recording_.open(request, *session_, arrival_ns, opened);
  parts_.log.info("session opened", {{"session", session_id_},
                                     {"label", request.label()},
                                     {"instances", std::to_string(opened.instance_count())},
                                     {"triangles", std::to_string(opened.triangle_count())},
                                     {"targets", std::to_string(session_->targets().size())}});
  return {};
}

void SessionDriver::describe(v1::SessionOpened& opened) const {
  opened_to_proto(*session_, opened);
  opened.set_session_id(session_id_);
  opened.set_sampler(parts_.sampler.kind());
  opened.set_recording_file(recording_.name());
  opened.set_newest_sequence(newest_sequence_);
}

// --- ticks
// ------------------------------------------------------------------------------------------------------

TakeJob SessionDriver::begin_step(Turn& turn) {
  const std::optional<uint64_t> newest = apply_ticks(turn);
  if (!newest) return {};
  TakeJob job = session_->begin_step(quality_->begin_step(chosen_level_));
  stepping_ = newest;
  merged_ = false;
  return job;
}

// Returns the sequence of the newest tick that was applied, when it wants a step.
std::optional<uint64_t> SessionDriver::apply_ticks(Turn& turn) {
  std::optional<uint64_t> newest;
  Messages& messages = turn.messages;
  for (size_t left_for_next = merges_at_end(messages); !messages.empty(); messages.pop_front()) {
    const Inbox::Message& message = messages.front();
    const v1::Tick& tick = message.request.tick();
    if (newest && step_wanted_ && messages.size() <= left_for_next) break;
    turn.needs_loader = !turn.may_take_long &&
                        (takes_long(tick, *session_, parts_.scenes) || recording_.lacks_scenes(tick));
    if (turn.needs_loader) break;
    if (message.request.has_tick()) newest_sequence_ = tick.sequence();
    std::optional<WorkLimit> work;
    if (turn.may_take_long) work.emplace(parts_.load, turn.unwanted);
    if (const Status applied = apply(message, work ? &*work : nullptr)) {
      newest = tick.sequence();
      newest_arrival_ns_ = message.arrival_ns;
      note_step_control(tick.step_control());
      recording_.attach_scenes(tick);
    } else {
      reject(turn, applied.error(), tick.sequence());
    }
  }
  return step_wanted_ ? newest : std::nullopt;
}

void SessionDriver::note_step_control(const v1::StepControl& step) {
  step_wanted_ = !step.merge_into_next();
  merges_asked_ += step.merge_into_next();
  chosen_level_.reset();
  if (step.has_quality_level()) chosen_level_ = static_cast<int>(step.quality_level());
}

// `work`: null in a turn that does not take long.
Status SessionDriver::apply(const Inbox::Message& message, WorkLimit* work) {
  if (message.request.has_open()) return tl::unexpected(kOpenedTwice);
  if (message.request.has_resume()) return tl::unexpected(kResumedLate);
  if (!message.request.has_tick()) return tl::unexpected(kEmptyMessage);
  counters_.tick();
  recording_.tick(message.request.tick(), message.arrival_ns);
  const v1::SceneDelta& delta = message.request.tick().delta();
  const bool adds = !delta.added_instances().empty();
  if (Status ok = adds ? check_memory(delta, state_bytes_, "tick.delta.added_instances") : Status(); !ok) return ok;
  auto tick = tick_from_proto(message.request.tick(), *session_,
                              SceneSource{parts_.scenes, parts_.geometry, reader_, work});
  Status applied = tick ? check_budgets(*tick, delta) : tl::unexpected(std::move(tick.error()));
  if (applied && work) applied = build_target_tables(*session_, *tick, parts_.extents, *work);
  if (!applied && work && work->ended() && applied.error().code == ErrorCode::kResourceExhausted)
    counters_.hit(Limit::kMaxLoad);
  if (applied) {
    tick->arrival_ns = message.arrival_ns;
    applied = session_->apply(*tick);
    if (applied) account_memory(delta);
  }
  // A tick may have been refused, or have removed more than it added.
  state_bytes_ = session_state_bytes(session_->settings(), session_->targets().size());
  (void)instances_.resize(session_->mirror().size(), shapes_.bytes(), state_bytes_, "");
  return applied;
}

// Before the shapes of the delta are built, which takes the memory.
Status SessionDriver::check_memory(const v1::SceneDelta& delta, size_t state_bytes, const char* field) {
  const size_t count = session_->mirror().size() + static_cast<size_t>(delta.added_instances_size());
  return instances_.resize(count, shapes_.bytes() + bytes_of_shapes(delta.added_instances()), state_bytes, field);
}

void SessionDriver::account_memory(const v1::SceneDelta& delta) {
  shapes_.remove(delta.removed_ids());
  shapes_.add(delta.added_instances(), session_->mirror());
}

Status SessionDriver::check_budgets(const TickInput& tick, const v1::SceneDelta& delta) {
  if (!tick.settings && !tick.targets) return {};
  const StepSettings& settings = tick.settings ? *tick.settings : session_->settings();
  const std::vector<Target>& targets = tick.targets ? *tick.targets : session_->targets();
  const char* const field = tick.settings ? "tick.settings" : "tick.targets";
  if (Status ok = check_cost(settings, targets, field); !ok) return ok;
  return check_memory(delta, session_state_bytes(settings, targets.size()), field);
}

Status SessionDriver::check_cost(const StepSettings& settings, std::span<const Target> targets, const char* field) {
  Status ok = check_step_cost(settings, targets, parts_.session_limits, field);
  if (!ok) counters_.hit(Limit::kMaxStepCost);
  return ok;
}

// --- replies
// ----------------------------------------------------------------------------------------------------

void SessionDriver::answer(Turn& turn, const Status& taken) {
  const uint64_t sequence = *stepping_;
  const auto answer = session_->finish_step(taken);
  if (!answer) {
    Error error = answer.error();
    if (error.code == ErrorCode::kInternal) return end_by_defect(turn, error);
    error.message.insert(0, "the tick was applied, but its step failed: ");
    recording_.fault(sequence, "sample", to_string(answer.error()));
    if (error.code == ErrorCode::kResourceExhausted) counters_.hit(Limit::kMaxMaps);
    return reject(turn, error, sequence);
  }
  merged_ = answer->merged_ticks > std::exchange(merges_asked_, 0);
  const int64_t reply_ns = parts_.clock();
  counters_.step({.degraded = answer->degraded.has_value(),
                  .quality_level = answer->quality_level,
                  .merged_ticks = answer->merged_ticks,
                  .arrival_ns = newest_arrival_ns_,
                  .reply_ns = reply_ns,
                  .queue_ns = answer->queue_ns,
                  .scene_ns = answer->scene_ns,
                  .stage_ns = answer->step.stage_ns});
  place_->add(*answer, session_->targets(), reply_ns);
  v1::CameraReply& reply = *turn.replies.emplace_back(std::move(turn.spare)).mutable_camera();
  camera_reply_to_proto(*answer, *session_, session_->diagnostics(), reply);
  recording_.reply(reply);
  recording_.memory(*session_);
}

// A step that made no finite numbers. The session's state may hold more of them, so the session ends, and no other
// does.
void SessionDriver::end_by_defect(Turn& turn, const Error& error) {
  parts_.log.error("session failed",
                   {{"session", session_id_}, {"sequence", std::to_string(*stepping_)}, {"reason", error.message}});
  recording_.fault(*stepping_, "session", error.message);
  turn.end = grpc::Status(grpc::StatusCode::INTERNAL,
                          "the step failed by a defect of the server, so the session ends: " + error.message);
}

void SessionDriver::reject(Turn& turn, const Error& error, uint64_t sequence) {
  counters_.rejection();
  parts_.log.debug("tick refused",
                   {{"session", session_id_}, {"sequence", std::to_string(sequence)}, {"reason", to_string(error)}});
  v1::TickError& rejection = *turn.replies.emplace_back().mutable_tick_error();
  tick_error_to_proto(error, sequence, &session_->mirror(), rejection);
  recording_.rejection(rejection);
}

void SessionDriver::log_level_change(int former_level) const {
  const int level = quality_->level();
  const std::string leaves_out = describe_degradation(session_->settings(), level);
  parts_.log.info("quality level changed", {{"session", session_id_},
                                            {"level", std::to_string(level)},
                                            {"former", std::to_string(former_level)},
                                            {"leaves_out", leaves_out.empty() ? "nothing" : leaves_out}});
}

}  // namespace sightline
