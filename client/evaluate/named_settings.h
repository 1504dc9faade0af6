// Settings by name, as a user gives them: `NAME=JSON`, the JSON being a `Settings` message of the wire (settings.proto), e.g.
//   calm={"move":{"response_s":0.4},"aggregate":{"filter":{"mode":"JOINT","alpha":0.6,"n":10}}}
// Fields that are not sent keep the preset's value, exactly as in a session.
#pragma once

#include <string>

#include "server/base/error.h"
#include "server/step/step.h"

namespace sightline {

struct NamedSettings {
  std::string name;  // letters, digits, '-' and '_'; 1 to 32 of them
  StepSettings settings;
};

// Errors name the field: "settings" for what is no NAME=JSON, "settings.calm" for JSON that is no Settings message, and
// "settings.calm.move.response_s" for a value out of its range.
Result<NamedSettings> read_named_settings(const std::string& text);

}  // namespace sightline
