// Makes a page from a recording. The recorded ticks are applied to a session in this process, and each recorded reply
// becomes a frame.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "client/page/session_page.h"
#include "client/recordings/local_session.h"
#include "client/recordings/recording.h"
#include "client/recordings/scene_files.h"

namespace sightline {

// The source of candidate cells.
enum class PageCells {
  kAuto,      // as recorded; without recorded ones, every step is taken again as long as replies are equal
  kRecorded,  // as recorded, or none
  kNone,
};

struct RecordingPageOptions {
  RecordedRange range;
  PageCells cells = PageCells::kAuto;
  SceneFileOptions scenes;
  size_t max_frames = 20'000;  // at least 2
  size_t pictures = 40;        // pictures of what the camera saw, evenly spaced; 0: none
  int picture_width = 480;     // pixels; the height follows from the lens
  // Called often with the present activity and its progress.
  std::function<void(const char* what, size_t done, size_t of)> progress = {};
};

// `sampler` takes steps again for candidate cells, if it is of the recording's kind. Fails when the range holds no
// reply, and when the session cannot be opened even without its scene. All other problems become notices of the page.
Result<SessionPage> recording_page(const Recording& recording, const RecordingPageOptions& options,
                                   SamplerDevice& sampler);

}  // namespace sightline
