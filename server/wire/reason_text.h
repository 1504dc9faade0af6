// CameraReply.reason_text: why the camera moves, as one sentence for a person.
#pragma once

#include <string>

#include "server/step/step.h"

namespace sightline {

// The reason, and then what keeps the camera from its shot: the instance that hides a target from there or is expected to, and what the shot would lose; or else the
// limit that the shot breaks. Instances are named by their ids.
std::string reason_text(const StepResult& step);

}  // namespace sightline
