// Takes a recorded session again, step by step: the same ticks, merged as they were, each step at its recorded level of
// degradation.
//
//   Replay replay(recording, *backend, scenes, {});
//   replay.open();
//   ReplayedStep step;
//   while (auto more = replay.next(step)) { if (!*more) break; ... }
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/recordings/recording.h"
#include "client/recordings/scene_files.h"
#include "client/replay/backend.h"
#include "client/replay/settings.h"
#include "client/replay/source.h"
#include "server/base/transform.h"
#include "server/session/convention.h"

namespace sightline {

// States whether the reply of a recorded step is known.
enum class StepAnswer {
  kRecorded,  // the reply is in the recording
  kLost,      // the step was taken, but its reply is missing
  kNone,      // the recording ends before the reply
};

// A step of the recording as it is taken again. Ticks that were refused stand before the others. Each missing reply has
// a step of its own.
struct FedStep {
  RecordedStep step;
  StepAnswer answer = StepAnswer::kRecorded;
};

// Makes the steps, and makes all changes of the input. Single-threaded.
class ReplayFeed {
 public:
  ReplayFeed(const Recording& recording, const Convention& convention, const std::vector<ReplaySetting>& settings);

  bool next(FedStep& step);

  // Observed cameras that only followed the recorded replies. Under other settings they would pull the camera onto the
  // old path, so they are left out. Without other settings all are kept.
  uint64_t observed_left_out() const { return observed_left_out_; }
  uint64_t observed_kept() const { return observed_kept_; }
  // The limits of the recorded session up to the step that `next` returned, without the changed settings. The widest,
  // when ticks changed them.
  const CameraLimits& recorded_limits() const { return widest_limits_; }
  const RecordedReport& report() const { return source_.report(); }

  static constexpr double kFollowsM = 1e-3, kFollowsDeg = 0.1;
  static constexpr size_t kFollowedReplies = 16;  // a client shows a reply a few ticks late

 private:
  void split(RecordedStep& step);
  void take_limits(const v1::CameraLimits& changed);
  void change(v1::Tick& tick);
  bool follows(const v1::ObservedCamera& observed) const;

  StepSource source_;
  Convention convention_;  // its origin goes along with the recorded world
  const std::vector<ReplaySetting>& settings_;
  std::deque<FedStep> ready_;
  RecordedStep held_;                // refused ticks after the last reply; they belong to the next step
  std::deque<Pose> recorded_poses_;  // of the newest replies, oldest first
  uint64_t observed_left_out_ = 0, observed_kept_ = 0;
  CameraLimits limits_, widest_limits_;  // of the recorded session
};

// True when nothing of the tick was applied. A failed step is reported as a TickError too, but without a field.
bool refuses(const v1::TickError& rejection);

// For each tick of the step, whether the recording says that it was refused. A tick whose step failed was not refused.
std::vector<bool> refused_ticks(const RecordedStep& step);

struct ReplayedStep {
  FedStep recorded;  // with its ticks as they were sent
  ReplayAnswer answer;
  uint64_t log_ns() const;  // log time of its newest tick in the recording
};

// Single-threaded. Everything handed over must outlive it.
class Replay {
 public:
  Replay(const Recording& recording, ReplayBackend& backend, SceneFiles& scenes, std::vector<ReplaySetting> settings)
      : recording_(recording), backend_(backend), scenes_(scenes), settings_(std::move(settings)) {}

  // Adds a backend that receives the same messages and only mirrors the scene. Call it before open().
  void mirror_on(ReplayBackend& mirror, SceneFiles& scenes) { mirror_ = &mirror, mirror_scenes_ = &scenes; }

  Status open();
  // The opening, with the changed settings; scenes are named as in the recording.
  const v1::OpenSession& asked() const { return asked_; }
  const v1::SessionOpened& opened() const { return opened_; }
  const Convention& convention() const { return convention_; }

  // The log time of the next tick; empty at the end.
  std::optional<uint64_t> next_log_ns();
  // Takes the next step. Returns false when there is none. A backend that goes away is waited for, and all steps so far
  // are then taken again.
  Result<bool> next(ReplayedStep& step);

  const ReplayFeed& feed() const { return *feed_; }
  // How often the backend went away, and whether the repeated steps gave the same replies as before.
  uint64_t restarts() const { return restarts_; }
  // Why replies need not be equal, since the recording begins with a snapshot and no memory was taken over; empty: the
  // state is exact. Known once the first step was taken.
  const std::string& inexact() const { return inexact_; }
  bool restarts_equal() const { return restarts_equal_; }

 private:
  Status open_backend(ReplayBackend& backend, SceneFiles& scenes);
  bool peek();
  Status take(ReplayBackend& backend, SceneFiles& scenes, const FedStep& step, ReplayAnswer& answer);
  std::span<const v1::Tick> resume(ReplayBackend& backend, std::span<const v1::Tick> ticks, const RecordedStep& step);
  Status catch_up();
  void remember(const ReplayAnswer& answer, uint64_t& hash);

  const Recording& recording_;
  ReplayBackend& backend_;
  SceneFiles& scenes_;
  const std::vector<ReplaySetting> settings_;
  ReplayBackend* mirror_ = nullptr;
  SceneFiles* mirror_scenes_ = nullptr;
  Convention convention_;
  v1::OpenSession asked_;
  v1::SessionOpened opened_;
  std::unique_ptr<ReplayFeed> feed_;
  std::optional<FedStep> peeked_;
  std::vector<v1::Tick> renamed_;  // scratch
  uint64_t taken_ = 0;             // steps
  uint64_t hash_ = 0;              // chained hash of their replies; only for backends that can come back
  PlainReply plain_;
  uint64_t restarts_ = 0;
  bool restarts_equal_ = true;
  bool knows_state_ = true;  // false: the recording begins with a snapshot, and no memory was taken over so far
  std::string inexact_;
};

}  // namespace sightline
