// What a drive knows, as a page.
#pragma once

#include <functional>
#include <optional>
#include <span>

#include "client/truth/metrics.h"
#include "client/drive/player.h"
#include "client/scenario/scenario_world.h"
#include "client/page/session_page.h"

namespace sightline {

struct DrivePageInput {
  const Scenario& scenario;
  std::span<const PlayedFrame> frames;  // at least one
  std::span<const FrameTruth> truths;   // as long as `frames`
  const RunMetrics& run;
  const std::optional<RunMetrics>& follow;
  const v1::OpenSession& open;      // what was asked for
  const v1::SessionOpened& opened;  // what it gave
  CameraLimits limits = {};
};

struct DrivePictures {
  size_t count = 40;  // evenly spaced over the frames; fewer when there are fewer frames
  int width = 480;    // pixels; the height follows from the lens
  int quality = 82;   // of the JPEG, [1, 100]
  // Called after each picture with the number done.
  std::function<void(size_t)> progress = {};
};

// `world` must be of the same scenario; it is left at the last time.
SessionPage drive_page(const DrivePageInput& input, ScenarioWorld& world, const DrivePictures& pictures = {});

}  // namespace sightline
