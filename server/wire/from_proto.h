// Conversion of wire messages to the inputs of a session. Every value is checked against the ranges in
// proto/sightline/v1, then converted to canonical units. Errors name the fields of the client's messages. The session
// itself checks values that depend on its state: ids that must exist, time that must not go back, and ranges of
// settings.
#pragma once

#include <string>
#include <vector>

#include "server/base/error.h"
#include "server/scene/scene_folder.h"
#include "server/session/session.h"
#include "sightline/v1/camera_control.pb.h"

namespace sightline {

// The sources of geometry. Both are shared by all sessions and thread-safe.
struct SceneSource {
  SceneLibrary& library;
  GeometryStore& store;
  SceneReader reader = {};    // the client whose message is read
  WorkLimit* work = nullptr;  // ends the reading of files; null: nothing does
};

// Fields "open....". Reads the scene file, so it may take seconds. `warnings` receives the warnings of the file's
// reader and those of suspect_sizes.h. Absent messages and values have the defaults of SessionOptions.
Result<SessionOptions> session_options_from_proto(const v1::OpenSession& open, const SceneSource& source,
                                                  std::vector<std::string>& warnings);

// True if applying the tick would read a scene file or build the sample table of a target's shape, which may take
// seconds. Targets with shapes that the tick itself adds are not examined, since their tables take 10 ms; those with
// meshes are.
bool takes_long(const v1::Tick& tick, const Session& session, SceneLibrary& library);

// Fields "tick....". Cheap unless the tick adds meshes from a file. The tick is read in the convention of `session`,
// and its settings and limits override those of `session`. All earlier ticks must therefore have been applied. The
// caller sets arrival_ns and acts on `tick.step_control`, whose values are checked here.
Result<TickInput> tick_from_proto(const v1::Tick& tick, const Session& session, const SceneSource& source);

}  // namespace sightline
