// The presets of settings.proto by the names used on the command line.
#pragma once

#include <string>
#include <vector>

#include "server/base/error.h"
#include "sightline/v1/settings.pb.h"

namespace sightline {

// In lower case: "sightline", "paper".
std::vector<std::string> preset_names();
// kInvalidArgument (field "--preset") for any other name.
Result<v1::Settings::Preset> preset_named(const std::string& name);

}  // namespace sightline
