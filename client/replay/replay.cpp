#include "client/replay/replay.h"

#include <algorithm>
#include <numbers>
#include <utility>

#include "client/replay/compare_replies.h"
#include "client/replay/truth.h"
#include "client/scenario/scenario_session.h"
#include "server/base/hash.h"
#include "server/settings/step_settings.h"
#include "server/wire/from_proto_values.h"

namespace sightline {
namespace {

constexpr int kMostRestartsAtOneStep = 3;

void move_tick(RecordedStep& from, size_t i, RecordedStep& to) {
  to.ticks.push_back(std::move(from.ticks[i]));
  to.tick_log_ns.push_back(from.tick_log_ns[i]);
}

// A tick that took too long to load on the machine of the recording need not do so here. It was not applied there, so a
// replay does not see it.
void leave_out_what_took_too_long(RecordedStep& step) {
  std::erase_if(step.rejections, [&](const v1::TickError& rejection) {
    if (!refuses(rejection) || rejection.message().find("(--max-load-s)") == std::string::npos) return false;
    for (size_t i = step.ticks.size(); i-- > 0;) {
      if (step.ticks[i].sequence() != rejection.sequence()) continue;
      step.ticks.erase(step.ticks.begin() + static_cast<ptrdiff_t>(i));
      step.tick_log_ns.erase(step.tick_log_ns.begin() + static_cast<ptrdiff_t>(i));
      step.ticks_before_memory -= i < step.ticks_before_memory;
      break;
    }
    return true;
  });
}

// The ticks of `to` so far stand before it.
void move_memory(RecordedStep& from, RecordedStep& to) {
  if (!from.memory) return;
  to.memory = std::exchange(from.memory, std::nullopt);
  to.ticks_before_memory = to.ticks.size();
}

}  // namespace

bool refuses(const v1::TickError& rejection) {
  return rejection.field_violations_size() > 0;
}

std::vector<bool> refused_ticks(const RecordedStep& step) {
  std::vector<bool> refused(step.ticks.size(), false);
  for (const v1::TickError& rejection : step.rejections) {
    if (!refuses(rejection)) continue;
    // The newest tick with that number: a tick that repeats the number of a good one stands after it.
    for (size_t i = step.ticks.size(); i-- > 0;)
      if (!refused[i] && step.ticks[i].sequence() == rejection.sequence()) {
        refused[i] = true;
        break;
      }
  }
  return refused;
}

ReplayFeed::ReplayFeed(const Recording& recording, const Convention& convention,
                       const std::vector<ReplaySetting>& settings)
    : source_(recording), convention_(convention), settings_(settings) {
  const v1::OpenSession& open = recording.open_session();
  if (open.settings().preset() == v1::Settings::PRESET_PAPER) limits_ = preset_limits(Preset::kPaper);
  read_limits(open.limits(), limits_);
  widest_limits_ = limits_;
}

void ReplayFeed::take_limits(const v1::CameraLimits& changed) {
  read_limits(changed, limits_);
  widest_limits_ = wider(widest_limits_, limits_);
}

bool ReplayFeed::next(FedStep& step) {
  while (ready_.empty()) {
    RecordedStep recorded;
    if (!source_.next(recorded)) break;
    split(recorded);
  }
  if (ready_.empty()) {
    if (held_.ticks.empty()) return false;
    held_.has_reply = false;
    ready_.push_back({std::exchange(held_, {}), StepAnswer::kNone});
  }
  step = std::move(ready_.front());
  ready_.pop_front();
  return true;
}

// The last `merged_ticks` + 1 accepted ticks belong to the reply. The ticks before them were answered by missing
// replies. How they were merged is not known, so each has a step of its own.
void ReplayFeed::split(RecordedStep& recorded) {
  leave_out_what_took_too_long(recorded);
  const std::vector<bool> refused = refused_ticks(recorded);
  const auto accepted = static_cast<size_t>(std::count(refused.begin(), refused.end(), false));
  const size_t answered = recorded.has_reply ? size_t{1} + recorded.reply.merged_ticks() : accepted;
  size_t lost = accepted - std::min(accepted, answered);
  size_t left = accepted;
  for (size_t i = 0; i < recorded.ticks.size(); ++i)
    if (!refused[i] && recorded.ticks[i].has_limits()) take_limits(recorded.ticks[i].limits());
  for (v1::Tick& tick : recorded.ticks) change(tick);
  RecordedStep now = std::exchange(held_, {});
  now.missing = recorded.missing;
  for (size_t i = 0; i < recorded.ticks.size(); ++i) {
    if (i == recorded.ticks_before_memory) move_memory(recorded, now);
    if (refused[i] && left == 0) {
      move_tick(recorded, i, held_);
      continue;
    }
    move_tick(recorded, i, now);
    if (refused[i]) continue;
    --left;
    if (lost == 0) continue;
    --lost;
    if (now.ticks.back().step_control().merge_into_next()) continue;  // a snapshot tick never had a reply
    now.has_reply = false;
    ready_.push_back({std::exchange(now, {}), StepAnswer::kLost});
  }
  move_memory(recorded, now);
  now.rejections = std::move(recorded.rejections);
  now.faults = std::move(recorded.faults);
  now.reply = std::move(recorded.reply);
  now.log_ns = recorded.log_ns;
  now.has_reply = recorded.has_reply;
  if (now.has_reply) {
    recorded_poses_.push_back(camera_from_client(convention_, pose_from(now.reply.pose())));
    if (recorded_poses_.size() > kFollowedReplies) recorded_poses_.pop_front();
  }
  ready_.push_back({std::move(now), recorded.has_reply ? StepAnswer::kRecorded : StepAnswer::kNone});
}

void ReplayFeed::change(v1::Tick& tick) {
  if (!settings_.empty()) put_over(settings_, tick);
  const v1::Vec3& shift = tick.world_shift();
  convention_.origin_m += vector_from_client(convention_, {shift.x(), shift.y(), shift.z()});
  if (!tick.has_observed_camera()) return;
  if (!settings_.empty() && follows(tick.observed_camera())) {
    tick.clear_observed_camera();
    ++observed_left_out_;
  } else {
    ++observed_kept_;
  }
}

bool ReplayFeed::follows(const v1::ObservedCamera& observed) const {
  if (observed.cut()) return false;
  const Pose pose = camera_from_client(convention_, pose_from(observed.pose()));
  return std::any_of(recorded_poses_.begin(), recorded_poses_.end(), [&](const Pose& recorded) {
    return glm::distance(recorded.position_m, pose.position_m) <= kFollowsM &&
           angle_between(recorded.rotation, pose.rotation) <= kFollowsDeg * std::numbers::pi / 180;
  });
}

uint64_t ReplayedStep::log_ns() const {
  return recorded.step.tick_log_ns.empty() ? recorded.step.log_ns : recorded.step.tick_log_ns.back();
}

Status Replay::open() {
  auto convention = convention_of(recording_.open_session());
  if (!convention) return tl::unexpected(std::move(convention.error()));
  convention_ = *convention;
  asked_ = recording_.open_session();
  put_over(settings_, asked_);
  if (mirror_)
    if (Status done = open_backend(*mirror_, *mirror_scenes_); !done) return done;
  if (Status done = open_backend(backend_, scenes_); !done) return done;
  feed_ = std::make_unique<ReplayFeed>(recording_, convention_, settings_);
  knows_state_ = recording_.info().snapshot_ticks() == 0;
  return {};
}

Status Replay::open_backend(ReplayBackend& backend, SceneFiles& scenes) {
  scenes.bring_to([&](std::span<const std::byte> file) { return backend.bring(file); });
  v1::OpenSession open = asked_;
  open.clear_recording();                                     // the backend decides whether it records
  open.set_degradation_policy(v1::DEGRADATION_POLICY_NEVER);  // the recording alone decides the level of each step
  if (Status named = scenes.name_by_hash(open); !named) return named;
  auto opened = backend.open(open);
  if (!opened) return tl::unexpected(std::move(opened.error()));
  if (&backend == &backend_) opened_ = std::move(*opened);
  return {};
}

bool Replay::peek() {
  if (peeked_) return true;
  FedStep step;
  if (!feed_->next(step)) return false;
  peeked_ = std::move(step);
  return true;
}

std::optional<uint64_t> Replay::next_log_ns() {
  if (!peek()) return std::nullopt;
  const RecordedStep& step = peeked_->step;
  return step.tick_log_ns.empty() ? step.log_ns : step.tick_log_ns.back();
}

Result<bool> Replay::next(ReplayedStep& step) {
  if (!peek()) return false;
  bool gone = false;
  for (int attempt = 0;; ++attempt) {
    Status taken = gone ? catch_up() : Status();
    if (taken) taken = take(backend_, scenes_, *peeked_, step.answer);
    if (taken) break;
    gone = true;
    if (taken.error().code != ErrorCode::kUnavailable || attempt == kMostRestartsAtOneStep ||
        !backend_.wait_until_back())
      return tl::unexpected(taken.error());
    ++restarts_;
  }
  if (mirror_) {
    ReplayAnswer none;
    if (Status told = take(*mirror_, *mirror_scenes_, *peeked_, none); !told) return tl::unexpected(told.error());
  }
  step.recorded = std::move(*peeked_);
  peeked_.reset();
  ++taken_;
  remember(step.answer, hash_);
  return true;
}

// Repeats all steps that were taken before the backend went away, as fast as it answers.
Status Replay::catch_up() {
  if (Status opened = open_backend(backend_, scenes_); !opened) return opened;
  feed_ = std::make_unique<ReplayFeed>(recording_, convention_, settings_);
  knows_state_ = recording_.info().snapshot_ticks() == 0;
  uint64_t hash = 0;
  FedStep step;
  ReplayAnswer answer;
  for (uint64_t i = 0; i < taken_ && feed_->next(step); ++i) {
    if (Status taken = take(backend_, scenes_, step, answer); !taken) return taken;
    remember(answer, hash);
  }
  restarts_equal_ &= hash == hash_;
  peeked_.reset();
  if (!peek()) return fail(ErrorCode::kInternal, "recording", "ended earlier when it was read again");
  return {};
}

// Only for backends that can go away.
void Replay::remember(const ReplayAnswer& answer, uint64_t& hash) {
  if (backend_.session() || !answer.has_reply) return;
  hash = hash64_bytes(std::as_bytes(std::span(plain_.bytes_of(answer.reply))), hash);
}

Status Replay::take(ReplayBackend& backend, SceneFiles& scenes, const FedStep& step, ReplayAnswer& answer) {
  const std::vector<v1::Tick>& ticks = step.step.ticks;
  answer.rejections.clear();
  answer.has_reply = false;
  if (ticks.empty() || (step.answer == StepAnswer::kNone && !backend.session())) return {};
  const int level = step.step.quality_level();
  if (std::none_of(ticks.begin(), ticks.end(), SceneFiles::named_in))
    return backend.take(resume(backend, ticks, step.step), level, answer);
  renamed_ = ticks;
  for (v1::Tick& tick : renamed_)
    if (Status named = scenes.name_by_hash(tick); !named) return named;
  return backend.take(resume(backend, renamed_, step.step), level, answer);
}

// Takes over the recorded memory when the state is not known. Returns the ticks that are left for the step: all of them
// when there is no memory, or when it cannot be taken over.
std::span<const v1::Tick> Replay::resume(ReplayBackend& backend, std::span<const v1::Tick> ticks,
                                         const RecordedStep& step) {
  if (knows_state_ || &backend != &backend_) return ticks;
  const std::string begins = "the file begins with a snapshot of " +
                             std::to_string(recording_.info().snapshot_ticks()) + " ticks";
  if (!step.memory) {
    if (inexact_.empty()) inexact_ = begins + " and no memory of the camera";
    return ticks;
  }
  const size_t before = std::min(step.ticks_before_memory, ticks.size());
  const Status resumed = backend.resume(ticks.first(before), *step.memory);
  knows_state_ = true;
  if (resumed) return ticks.subspan(before);
  inexact_ = begins + ", and " + to_string(resumed.error());
  return resumed.error().code == ErrorCode::kUnsupported ? ticks : ticks.subspan(before);
}

}  // namespace sightline
