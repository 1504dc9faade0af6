// Settings, limits and lenses as the wire has them, every field sent: what a session really uses, presets resolved. The
// readers in server/wire/from_proto_values.h give back what was put in.
#pragma once

#include "server/session/session.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// The preset stays unnamed: it is in the values. A lens that does not zoom sends no zoom range.
v1::Settings settings_to_proto(const StepSettings& settings);
v1::CameraLimits limits_to_proto(const CameraLimits& limits);
// The field of view in the client's axis and unit.
v1::Lens lens_to_proto(const Lens& lens, const Convention& convention);

}  // namespace sightline
