// Targets that stand too far apart for one picture from the side of the shot. The camera goes to a place in line with
// them (move/line_up.h), or gives up the least important ones (move/keep_together.h).
#pragma once

#include "server/step/stages.h"

namespace sightline {

// Gives up the least important targets if the picture cannot hold all of them even from the greatest distance allowed.
// Otherwise the camera would aim between targets that are far apart, and show none. `has_shot`: the carried shot
// belongs to these targets.
void give_up_targets(const StepInput& input, const CarriedState& carried, bool has_shot, TargetsNow& targets,
                     TargetIds& given_up);

// Sets shot.in_line_m if the shot must turn to show all targets, and as long as they nearly fill the picture. It does
// not turn where the viewpoint search knows that they are hidden from both ends of the line. Without that search it
// never turns, since the client then wants its own side. Nor does it turn for some of the targets while others are
// given up.
void line_up_shot(const StepContext& step, const ViewpointMap& viewpoints, WantedShot& shot);

}  // namespace sightline
