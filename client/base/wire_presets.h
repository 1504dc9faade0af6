// Settings as a person types them: presets by name, and messages as JSON.
#pragma once

#include <string>
#include <vector>

#include "server/base/error.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// In lower case: "sightline", "paper".
std::vector<std::string> preset_names();
// kInvalidArgument (field "--preset") for any other name.
Result<v1::Settings::Preset> preset_named(const std::string& name);

// `settings`, `tuning` and `shot` of an OpenSession as JSON, e.g.
// {"settings":{"max_distance_m":8},"tuning":{"sample":{"points":4}}}. kInvalidArgument (no field) for anything else;
// ranges are not checked.
Result<v1::OpenSession> settings_from_json(const std::string& json);

}  // namespace sightline
