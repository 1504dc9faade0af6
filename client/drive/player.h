// Plays a scenario on an open session: ticks out, replies in.
#pragma once

#include <functional>
#include <vector>

#include "client/cpp/sightline_client.h"
#include "client/scenario/scenario.h"
#include "client/truth/judge.h"

namespace sightline {

struct PlayedFrame {
  v1::CameraReply reply;
  double latency_ms = 0.0;  // from handing the newest tick of this reply to the client library to having the reply
  double received_s = 0.0;  // since the play began
  CameraFrame frame;        // the pose at the time that it is meant for
};

struct PlayOptions {
  double rate_hz = 60.0;    // ticks a second of scenario time, (0, 1000]
  double duration_s = 0.0;  // of scenario time; the first tick is at 0
  // When true, each tick waits for the reply to the tick before, so the outcome does not depend on the machine's speed.
  // When false, ticks are sent by the clock, whether or not replies keep up.
  bool lockstep = false;
  // Called after each reply with all frames so far.
  std::function<void(const std::vector<PlayedFrame>&)> on_frame;
};

// How many ticks a play sends, and the k-th of them, counted from 0.
size_t tick_count(const PlayOptions& options);
v1::Tick played_tick(const Scenario& scenario, const PlayOptions& options, size_t k);

// All replies in order: as many as ticks in lockstep, fewer where the server merged. Fails when a tick is
// refused, when the server drains, when no reply comes for 10 s, and when the stream ends.
Result<std::vector<PlayedFrame>> play(const Scenario& scenario, ClientSession& session, const PlayOptions& options);

}  // namespace sightline
