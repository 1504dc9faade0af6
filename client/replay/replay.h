// A recorded session taken again, step by step: the same ticks, merged as they were, each step at its recorded level of
// economy.
//
//   Replay replay(recording, *place, scenes, {});
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
#include "client/replay/backend.h"
#include "client/recordings/scene_files.h"
#include "client/replay/settings.h"
#include "client/replay/source.h"
#include "server/base/transform.h"
#include "server/session/convention.h"

namespace sightline {

// How a recorded step stands to its reply.
enum class StepAnswer {
  kRecorded,  // it is in the recording
  kLost,      // the step was taken, and its reply is in a gap
  kNone,      // the recording ends before it
};

// A step of the recording as it is taken again: the ticks that the recording says were refused stand before those that were
// not, and each reply that is missing has its own step.
struct FedStep {
  RecordedStep step;
  StepAnswer answer = StepAnswer::kRecorded;
};

// Makes the steps; all that is changed about the input is changed here. Single-threaded.
class ReplayFeed {
 public:
  ReplayFeed(const Recording& recording, const Convention& convention,
             const std::vector<ReplaySetting>& settings)
      : source_(recording), convention_(convention), settings_(settings) {}

  bool next(FedStep& step);

  // Observed cameras that only followed the recorded replies: under other settings they would drag the camera along the old
  // way, so they are left out. Without other settings all are kept.
  uint64_t observed_left_out() const { return observed_left_out_; }
  uint64_t observed_kept() const { return observed_kept_; }
  const RecordedReport& report() const { return source_.report(); }

  static constexpr double kFollowsM = 1e-3, kFollowsDeg = 0.1;
  static constexpr size_t kFollowedReplies = 16;  // a client shows a reply some ticks after it was made

 private:
  void split(RecordedStep& step);
  void change(v1::Tick& tick);
  bool follows(const v1::ObservedCamera& observed) const;

  StepSource source_;
  const Convention convention_;
  const std::vector<ReplaySetting>& settings_;
  std::deque<FedStep> ready_;
  RecordedStep held_;                // refused ticks behind the last reply: they belong before the next
  std::deque<Pose> recorded_poses_;  // of the newest replies
  uint64_t observed_left_out_ = 0, observed_kept_ = 0;
};

// Whether nothing of the tick was applied: a step that failed is told as a Rejection too, without a field.
bool refuses(const v1::Rejection& rejection);

// Which of a step's ticks the recording says were refused; a tick whose step failed was not.
std::vector<bool> refused_ticks(const RecordedStep& step);

struct ReplayedStep {
  FedStep recorded;  // with its ticks as they were sent
  ReplayAnswer answer;
  uint64_t log_ns() const;  // of its newest tick, in the recording
};

// Single-threaded. Everything handed over must outlive it.
class Replay {
 public:
  Replay(const Recording& recording, ReplayBackend& place, SceneFiles& scenes,
         std::vector<ReplaySetting> settings)
      : recording_(recording), place_(place), scenes_(scenes), settings_(std::move(settings)) {}

  // Beside, a place that is told the same and only mirrors it; before open().
  void mirror_on(ReplayBackend& mirror, SceneFiles& scenes) { mirror_ = &mirror, mirror_scenes_ = &scenes; }

  Status open();
  // As opened, with the other settings; scenes as the recording names them.
  const v1::OpenSession& asked() const { return asked_; }
  const v1::SessionOpened& opened() const { return opened_; }
  const Convention& convention() const { return convention_; }

  // The tick that comes next, by log time; none at the end.
  std::optional<uint64_t> next_log_ns();
  // Takes the next step. False: there is none. A place that goes away is waited for, and all steps so far are taken
  // again there.
  Result<bool> next(ReplayedStep& step);

  const ReplayFeed& feed() const { return *feed_; }
  // How often the place had to be come back to, and whether the steps that were then taken again answered as before.
  uint64_t restarts() const { return restarts_; }
  bool restarts_equal() const { return restarts_equal_; }

 private:
  Status open_place(ReplayBackend& place, SceneFiles& scenes);
  bool peek();
  Status take(ReplayBackend& place, SceneFiles& scenes, const FedStep& step, ReplayAnswer& answer);
  Status catch_up();
  void remember(const ReplayAnswer& answer, uint64_t& hash);

  const Recording& recording_;
  ReplayBackend& place_;
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
  uint64_t hash_ = 0;              // of their replies, chained; places that can come back only
  PlainReply plain_;
  uint64_t restarts_ = 0;
  bool restarts_equal_ = true;
};

}  // namespace sightline
