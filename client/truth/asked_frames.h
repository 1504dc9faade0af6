// The shot that a client asked for (contract: Shot), at each frame of a run in a scenario: what its properties should
// be there, and what the picture has.
//
// It is found from the scene alone, without the service's smoothing and blends: a frame that turns is where it is at
// that moment, and the way to a shot counts as a departure from it.
#pragma once

#include <span>
#include <vector>

#include "client/scenario/scenario_world.h"
#include "client/truth/coherence.h"
#include "server/move/asked_shot.h"

namespace sightline {

// One result a frame. `shot` begins at the first frame; what it leaves open is taken from the camera there. Subjects
// that the scene lacks do not count; without any, the targets are the subjects. Side, height and size are measured from
// the subjects' middle, the place from the targets' centre; a shot with several places asks for their mean. Frame
// kTravel: an instance slower than 0.3 m/s keeps its last direction, and at first it has the direction of its front.
// Moves the time of `world`.
std::vector<FrameShot> shots_as_asked(const AskedShot& shot, ScenarioWorld& world, std::span<const CameraFrame> frames);

}  // namespace sightline
