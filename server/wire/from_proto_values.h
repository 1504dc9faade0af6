// Readers for the small messages of camera.proto and settings.proto. Every reader fails with `field` or a path below
// it, and then leaves `out` unspecified. An absent value leaves `out` unchanged.
#pragma once

#include <string>

#include "server/base/error.h"
#include "server/base/transform.h"
#include "server/session/session.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

Status read_vector(const v1::Vec3& wire, const std::string& field, glm::dvec3& out);  // finite
// A rotation in the client's frame, not converted. It must have unit length within 1e-3 and is normalised.
Status read_rotation(const v1::Quat& wire, const std::string& field, glm::dquat& out);
// A pose in the client's frame, not converted; finite, unit rotation (normalised).
Status read_pose(const v1::Pose3& wire, const std::string& field, Pose& out);
// Preset or custom; fields below "<prefix>convention".
Status read_convention(const v1::Convention& wire, const std::string& prefix, Convention& out);
Status read_lens(const v1::Lens& wire, const Convention& convention, const std::string& field, Lens& out);
// Starts from the preset that `settings` names, if any, and applies the fields that are sent. Fields are
// "<prefix>settings.follow", "<prefix>tuning.bound.mode". Checks enums and the zoom range; the session checks all
// ranges.
Status read_settings(const v1::Settings& settings, const tuning::v1alpha1::Tuning& tuning, const std::string& prefix,
                     StepSettings& out);

// Generated (server/settings/generate.py): one message each, `path` being its own.
Status read_settings(const v1::Settings& wire, const std::string& path, StepSettings& out);
Status read_tuning(const tuning::v1alpha1::Tuning& wire, const std::string& path, StepSettings& out);
void read_limits(const v1::CameraLimits& wire, CameraLimits& out);

// Both are shared by the readers. proto3 lets unknown enum numbers through.
tl::unexpected<Error> unknown_enum(const std::string& field, int value);
int saturate(uint32_t value);

}  // namespace sightline
