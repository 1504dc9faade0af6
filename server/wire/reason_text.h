// CameraReply.reason_text: why the camera moves, as one sentence for a person.
#pragma once

#include <string>

#include "server/step/step.h"

namespace sightline {

// The reason, and then what keeps the camera from its shot. That is the instance that hides a target from there or is
// expected to; or else the limit that the shot breaks. Where following is expected to lose more than the plan, the
// sentence says how much. Instances are named by their ids. Thread-safe.
std::string reason_text(const StepResult& step);

}  // namespace sightline
