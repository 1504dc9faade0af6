// The result of a step: the decision, and the visibility from the returned pose. Internal to this folder.
#pragma once

#include "server/aggregate/share_window.h"
#include "server/step/stages.h"

namespace sightline {

// `dump` must be complete. Adds the visible shares in the picture of the returned pose to `shares`.
StepResult report_step(const StepInput& input, const StepDump& dump, const TakenMaps& taken, ShareWindow& shares);

}  // namespace sightline
