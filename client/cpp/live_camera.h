// A camera for a game loop: no call waits for long, with or without a daemon.
//
//   auto camera = sightline::LiveCamera::open({"127.0.0.1:50151"}, open);   // returns at once; a thread reaches the
//   daemon auto view = camera.tick(tick);                                          // each frame; draw (*view).shown
//
// A tick returns the daemon's reply if it comes in time, else an earlier one brought up to date. When no daemon
// answers, the camera keeps its place relative to the targets, without sight tests, and blends back when one does. The
// thread tries to reach a daemon for ever.
//
// A camera must be used by one thread at a time. Nothing throws.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "client/cpp/camera.h"
#include "client/cpp/pose_sampler.h"

namespace sightline {

struct LiveOptions {
  // give_up_after and reply_timeout do not count. on_resync is called on the camera's own thread.
  CameraOptions camera;
  // tick() waits at most so long for its answer; 0: not at all.
  std::chrono::milliseconds wait{100};
  // Without an answer for so long, the camera follows the targets by itself. It must be longer than the way to the
  // daemon and back.
  std::chrono::milliseconds fallback_after{300};
  // So long the way back takes, in game time.
  std::chrono::milliseconds blend{500};
  // Without an answer for so long, the stream is given up for a new one.
  std::chrono::milliseconds reply_timeout{2'000};
  // So long the last ticks may take.
  std::chrono::milliseconds close_after{1'000};
};

// The origin of a shown pose.
enum class LiveSource {
  kReply,      // the daemon's answer to this tick
  kPredicted,  // an earlier answer, brought up to date
  kFallback,   // no daemon answers: the camera keeps its place relative to the targets
  kBlend,      // the way from the fallback to the daemon's camera
};

// The camera to draw now.
struct LiveView {
  CameraSample shown;
  double age_s = 0;  // game time since the tick that the newest reply covers; 0: this one
  LiveSource source = LiveSource::kPredicted;
  uint64_t sequence = 0;                 // number of the newest tick; the first is 1
  std::optional<v1::CameraReply> reply;  // the newest one
  std::vector<v1::TickError> refusals;   // of ticks, since the former view; `sequence` says which
  std::optional<Error> trouble;          // why no daemon answers
};

class LiveCamera {
 public:
  // Positions by id that are newer than the newest tick.
  using Drawn = std::map<uint64_t, std::array<double, 3>>;

  // Starts a session with the first of the addresses ("host:port" or "unix:/path") that answers; at least one.
  static LiveCamera open(std::vector<std::string> addresses, v1::OpenSession opening, LiveOptions options = {});

  ~LiveCamera();  // as close()
  LiveCamera(LiveCamera&&) noexcept;
  LiveCamera& operator=(LiveCamera&&) noexcept;

  // Tells the daemon what has changed, and returns the camera to draw. Waits for the answer at most LiveOptions::wait,
  // and not at all while an earlier tick is unanswered. The camera numbers ticks. Errors: kInvalidArgument for a tick
  // that has a sequence, merges into the next one, or whose time is not finite; kResourceExhausted (field "tick") when
  // 4,096 ticks wait, and the error of an opening that no daemon accepts.
  Result<LiveView> tick(v1::Tick tick);

  // The camera to draw between ticks, at a game time near the newest tick's. Never waits.
  Result<LiveView> sample(double time_s, const Drawn& drawn = {});

  // The answer of the daemon that opened the session last; nothing before the first.
  std::optional<v1::SessionOpened> opened() const;
  // As those of Camera.
  size_t resyncs() const;
  size_t resumes() const;

  // Ends the session. Ticks that wait are sent before, if a daemon takes them within LiveOptions::close_after.
  void close();

 private:
  class Worker;
  explicit LiveCamera(std::shared_ptr<Worker> worker);
  std::shared_ptr<Worker> worker_;
};

}  // namespace sightline
