// A recording as a page: the session is played through in this process, and what it was told and what it answered then
// become frames.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "client/recordings/local_session.h"
#include "client/recordings/recording.h"
#include "client/recordings/scene_files.h"
#include "client/page/session_page.h"

namespace sightline {

// Where candidate cells come from when replies were recorded without them.
enum class PageCells {
  kAuto,      // recorded ones; else every step is taken again, as long as replies are equal
  kRecorded,  // recorded ones or none
  kNone,
};

struct RecordingPageOptions {
  RecordedRange range;
  PageCells cells = PageCells::kAuto;
  SceneFileOptions scenes;
  size_t max_frames = 20'000;  // at least 2
  size_t pictures = 40;        // of what the camera saw, evenly spaced; 0: none
  int picture_width = 480;     // pixels; the height follows from the lens
  // Called often: what is being done, and how far it is.
  std::function<void(const char* what, size_t done, size_t of)> progress = {};
};

// `sampler` takes steps again: cells come of it only where it is of the recording's kind. Fails when the range holds no
// reply, and when even without its scene the session cannot be opened; everything else that is missing or strange becomes a
// notice of the page.
Result<SessionPage> recording_page(const Recording& recording, const RecordingPageOptions& options,
                                   SamplerDevice& sampler);

}  // namespace sightline
