// What the camera saw, on one page: evenly spaced frames of a run, drawn by Embree with plain shading.
#pragma once

#include <span>

#include "client/truth/judge.h"
#include "client/page/picture.h"
#include "client/scenario/scenario_world.h"

namespace sightline {

struct ContactSheetOptions {
  int columns = 4, rows = 4;
  int panel_width = 320;  // pixels; the height follows from the lens
};

// Every target has a colour of its own and an outline in it, drawn through whatever hides the target, so that
// a hidden one is found too; its hidden part is hatched. Each panel says the time and each target's visible
// share. `frames` must not be empty; `world` is left at the last time.
Picture contact_sheet(ScenarioWorld& world, std::span<const CameraFrame> frames,
                      const ContactSheetOptions& options = {});

// One panel of it.
Picture draw_frame(ScenarioWorld& world, const CameraFrame& frame, int width);

// A scene as it is now, whoever keeps it.
struct DrawnScene {
  const SceneMirror& mirror;
  const EmbreeScene& occluders;           // of Content::kOccluders; has taken in the mirror
  std::span<const Target> targets;        // each an instance of the mirror
  std::span<const size_t> colours = {};   // by target: which colour it has; empty: their order
};
// The same of it; the frame's time is only written.
Picture draw_frame(const DrawnScene& scene, const CameraFrame& frame, int width);

}  // namespace sightline
