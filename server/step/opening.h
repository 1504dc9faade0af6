// What happens before the first stage of a step. Internal to this folder.
#pragma once

#include <vector>

#include "server/step/stages.h"

namespace sightline {

// What the inputs of a step make of the carried state. It becomes part of the carried state when the step is finished.
struct Opening {
  double move_s = 0.0;
  ZoomState zoom;
  WantedShot shot;
  std::vector<TargetPast> pasts;  // in the order of the input
};
void open_step(const StepInput& input, const CarriedState& carried, TargetsNow& targets, Opening& opening);

// Lists what the targets are in this step.
void look_at_targets(const StepInput& input, TargetsNow& now);
// Their pasts with this step's poses; `before` stays as it is.
void observe_targets(const StepInput& input, const std::vector<TargetPast>& before, std::vector<TargetPast>& now);

}  // namespace sightline
