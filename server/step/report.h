// What a step answers: the decision, and what the returned pose sees. Internal to this folder.
#pragma once

#include "server/aggregate/share_window.h"
#include "server/step/stages.h"

namespace sightline {

// `dump` is whole. `shares` learns what the picture of the returned pose shows.
StepResult report_step(const StepInput& input, const StepDump& dump, const TakenMaps& taken, ShareWindow& shares);

}  // namespace sightline
