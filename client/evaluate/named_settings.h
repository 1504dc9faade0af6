// Settings by name, as a user gives them: `NAME=JSON`, the JSON holding `settings` and `tuning` as OpenSession does, e.g.
//   calm={"settings":{"move_response_s":0.4},"tuning":{"aggregate":{"filter":{"mode":"FILTER_MODE_JOINT","n":10}}}}
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

// Errors name the field: "settings" for what is no NAME=JSON, "settings.calm" for JSON that is something else, and
// "settings.calm.settings.move_response_s" for a value out of its range.
Result<NamedSettings> read_named_settings(const std::string& text);

}  // namespace sightline
