// Driving a scenario against a daemon and judging the outcome, as tests need it.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "client/drive/player.h"
#include "client/truth/metrics.h"

namespace sightline::test {

struct Driven {
  std::vector<PlayedFrame> frames;
  std::vector<CameraFrame> path;
  std::vector<FrameTruth> truths;
  RunMetrics run, follow;
};

struct DriveTestOptions {
  double rate_hz = 60.0;
  double duration_s = 0.0;  // 0: the animation's
  int picture_every = 6;    // bodies and motion are judged at every tick
  v1::Settings settings = {};
};

// Uploads, opens and plays in lockstep. A failure on the way fails the test, and the result is empty.
std::vector<PlayedFrame> play_only(const std::string& address, std::span<const std::byte> glb,
                                   const DriveTestOptions& options = {});

// Like play_only, then judges the run and the follow baseline. After a failure `frames` is empty.
Driven drive(const std::string& address, std::span<const std::byte> glb, const DriveTestOptions& options = {});

// Writes the contact sheet of a drive where SIGHTLINE_TEST_PICTURES names a folder; otherwise does nothing.
void keep_picture(const std::string& name, std::span<const std::byte> glb, const Driven& driven);

}  // namespace sightline::test
