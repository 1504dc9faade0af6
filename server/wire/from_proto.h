// From wire messages to what a session takes: every value checked against the ranges in proto/sightline/v1,
// in the client's vocabulary of fields, then converted to canonical units. What needs the mirror or the
// session's past (ids that must exist, time that must not go back, ranges of settings) is checked by the
// session itself.
#pragma once

#include <string>
#include <vector>

#include "server/base/error.h"
#include "server/scene/scene_folder.h"
#include "server/session/session.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// Where geometry comes from; both shared by all sessions and thread-safe.
struct SceneSource {
  SceneLibrary& library;
  GeometryStore& store;
};

// Fields "open....". Reads the scene file, so it may take seconds. `warnings` gets what the file's reader
// could not honour. Absent messages and values have the defaults of SessionOptions.
Result<SessionOptions> session_options_from_proto(const v1::OpenSession& open, const SceneSource& source,
                                                  std::vector<std::string>& warnings);

// Whether a scene file would have to be read, or a sample table of a target's shape built, before the tick can be applied:
// that may take seconds. Targets that the tick itself adds are not looked at.
bool takes_long(const v1::Tick& tick, const Session& session, SceneLibrary& library);

// Fields "tick....". Cheap unless the tick adds meshes from a file. Read in the convention of `session`, for `session` as it is:
// its settings and limits stay where the tick says nothing else, so every tick before must have been applied. arrival_ns is
// left to the caller, and so is what `tick.step` asks for; its values are checked here.
Result<TickInput> tick_from_proto(const v1::Tick& tick, const Session& session, const SceneSource& source);

}  // namespace sightline
