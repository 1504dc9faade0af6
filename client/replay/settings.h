// Other settings on a recorded session, as a person types them: "max_distance_m=8", "preset=PAPER",
// "tuning.aggregate.filter.n=10", "limits.max_speed_mps=3", "lens.near_m=0.2", "seed=2".
#pragma once

#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "server/base/error.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// One of them, found and read.
struct ReplaySetting {
  enum class Part { kSettings, kTuning, kLimits, kLens, kSeed };
  std::string key;  // as typed
  Part part = Part::kSettings;
  std::vector<const google::protobuf::FieldDescriptor*> path;  // from the part's message down to the value
  std::string value;                                           // a value of that field's type
};

// Reads KEY=VALUE. Fails with kInvalidArgument and the key as field when there is no such setting; the message then lists the
// names that there are. Fails likewise when the value is not of the setting's type. Ranges are checked when the session opens.
Result<ReplaySetting> read_replay_setting(const std::string& text);

// Puts them over what the session was opened with.
void put_over(const std::vector<ReplaySetting>& settings, v1::OpenSession& open);

// A later tick that says something of settings, tuning, limits or lens: it still holds for all that `settings` do not name.
void put_over(const std::vector<ReplaySetting>& settings, v1::Tick& tick);

}  // namespace sightline
