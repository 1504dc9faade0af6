// Converts settings, tuning, limits and lenses to messages with every field set, as a session uses them after
// resolving presets. The readers in server/wire/from_proto_values.h give back what was put in. All but the lens is
// generated (server/settings/generate.py).
#pragma once

#include "server/session/session.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// The preset stays unset: its values are set. A session without a zoom range sends none.
v1::Settings settings_to_proto(const StepSettings& settings);
tuning::v1alpha1::Tuning tuning_to_proto(const StepSettings& settings);
v1::CameraLimits limits_to_proto(const CameraLimits& limits);
// The field of view in the client's axis and unit.
v1::Lens lens_to_proto(const Lens& lens, const Convention& convention);

}  // namespace sightline
