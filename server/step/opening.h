// The preparation of a step, before its first stage. Internal to this folder.
#pragma once

#include <vector>

#include "server/step/stages.h"

namespace sightline {

// The parts of the carried state that the inputs of a step change. They are stored there when the step is finished.
struct Opening {
  double move_s = 0.0;
  bool decides = true;  // as in StepContext
  double decision_s = 0.0;
  uint64_t decision = 0;
  ZoomState zoom;
  WantedShot shot;
  TargetIds given_up;
  std::vector<TargetPast> pasts;  // in the order of the input
  bool target_jumped = false;     // a required target that is steered has, now or before (CutState)
};
void open_step(const StepInput& input, const CarriedState& carried, TargetsNow& targets, Opening& opening);

// Lists the targets of this step with their present poses, all those with a weight as steered.
void look_at_targets(const StepInput& input, TargetsNow& now);
// An instance as if it were a target.
TrackedTarget view_of_instance(const StepInput& input, uint64_t id);
// Sets the weights of seeing each target.
void set_sight_weights(TargetsNow& now);
// Copies the pasts of the targets and adds this step's poses; `before` does not change.
void observe_targets(const StepInput& input, const std::vector<TargetPast>& before, std::vector<TargetPast>& now);

}  // namespace sightline
