// The page of a drive. The drive becomes a recording in memory, and the code of `sightline report` makes the page from
// it. Then the truth, the baseline's figures and the tick rate are added.
#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>

#include "client/drive/player.h"
#include "client/page/session_page.h"
#include "client/truth/metrics.h"

namespace sightline {

struct DrivenSession {
  const Scenario& scenario;
  std::span<const std::byte> scene_file;  // as uploaded
  const v1::OpenSession& open;
  const v1::SessionOpened& opened;
  const PlayOptions& play;
  std::span<const PlayedFrame> frames;  // at least one
  std::span<const FrameTruth> truths;   // as long as `frames`
  const RunMetrics& run;
  const std::optional<RunMetrics>& follow;
};

// `title` heads the page. `progress` is called with what is being done and how far it is.
Result<SessionPage> drive_page(const DrivenSession& driven, const std::string& title,
                               const std::function<void(const char* what, size_t done, size_t of)>& progress);

}  // namespace sightline
