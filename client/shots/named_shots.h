// The named shots (shots.json): parts of a Tick message that ask for a shot which film makers have a name for.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/error.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

std::string_view shots_json();  // the file, built into the program

struct NamedShot {
  std::string name, shows;
  std::string tick_json;  // with "$subject" and "$other" for ids of instances
  bool needs_subject() const { return tick_json.find("$subject") != std::string::npos; }
  bool needs_other() const { return tick_json.find("$other") != std::string::npos; }
};
// In the order of the file.
const std::vector<NamedShot>& named_shots();

// `shot` and `settings` of a tick. kNotFound for an unknown name; kInvalidArgument if the shot needs an id that is 0.
// Fields "shot", "subject", "other".
Result<v1::Tick> named_shot(const std::string& name, uint64_t subject, uint64_t other);

// The same, or for text that begins with '{', that message as JSON; it may hold `shot` and `settings` only. Field
// "shot".
Result<v1::Tick> read_shot_text(const std::string& text, uint64_t subject, uint64_t other);

}  // namespace sightline
