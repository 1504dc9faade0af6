// What the camera saw, on one page: evenly spaced frames of a run, drawn by Embree with plain shading.
#pragma once

#include <span>

#include "client/judge.h"
#include "client/picture.h"
#include "client/scenario_world.h"

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

}  // namespace sightline
