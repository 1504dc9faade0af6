// Changed settings for a recorded session, as typed: "max_distance_m=8", "preset=PAPER",
// "tuning.aggregate.filter.n=10", "limits.max_speed_mps=3", "lens.near_m=0.2", "seed=2".
#pragma once

#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "server/base/error.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// One setting, looked up and checked.
struct ReplaySetting {
  enum class Part { kSettings, kTuning, kLimits, kLens, kSeed };
  std::string key;  // as typed
  Part part = Part::kSettings;
  std::vector<const google::protobuf::FieldDescriptor*> path;  // fields from the part's message down to the value
  std::string value;                                           // a value of that field's type
};

// Reads KEY=VALUE. Fails with kInvalidArgument and the key as field. Either there is no such setting, and the message
// lists the known ones. Or the value has the wrong type, and the message says which one is allowed. Ranges are checked
// when the session opens.
Result<ReplaySetting> read_replay_setting(const std::string& text);

// Changes the opening of a session.
void put_over(const std::vector<ReplaySetting>& settings, v1::OpenSession& open);

// Changes a later tick that carries settings, tuning, limits or a lens. Fields that `settings` do not name keep the
// tick's values.
void put_over(const std::vector<ReplaySetting>& settings, v1::Tick& tick);

}  // namespace sightline
