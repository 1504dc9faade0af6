// Pictures of what the camera saw, drawn by Embree with plain shading, singly or as a sheet of evenly spaced frames.
#pragma once

#include <span>

#include "client/page/picture.h"
#include "client/scenario/scenario_world.h"
#include "client/truth/judge.h"

namespace sightline {

struct ContactSheetOptions {
  int columns = 4, rows = 4;
  int panel_width = 320;  // pixels; the height follows from the lens
};

// Every target has a colour and an outline in that colour. The outline shows through occluders, and the hidden part is
// hatched. Each panel has a caption with the time and the share of each target's whole body that the picture shows.
// `frames` must not be empty; `world` is left at the last time.
Picture contact_sheet(ScenarioWorld& world, std::span<const CameraFrame> frames,
                      const ContactSheetOptions& options = {});

// Draws one panel of the sheet.
Picture draw_frame(ScenarioWorld& world, const CameraFrame& frame, int width);

// A scene in its present state.
struct DrawnScene {
  const SceneMirror& mirror;
  const EmbreeScene& occluders;          // made with Content::kOccluders, and up to date with the mirror
  std::span<const Target> targets;       // each an instance of the mirror
  std::span<const size_t> colours = {};  // index of each target's colour; empty: in order
};
// The same for a scene; the frame's time is only printed.
Picture draw_frame(const DrawnScene& scene, const CameraFrame& frame, int width);

}  // namespace sightline
