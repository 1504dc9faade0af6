// Reader for the messages of shot.proto.
#pragma once

#include <string>
#include <vector>

#include "server/move/asked_shot.h"
#include "server/session/session.h"
#include "sightline/v1/shot.pb.h"

namespace sightline {

// Fails with `field` or a path below it: numbers that are not finite or out of range, unknown enums, too many entries,
// a vertical front, a line without an end, half a lens range. Ids need not exist. AskedShot::number is left as it is.
// `aspect`: of the lens, for conventions whose fields of view are horizontal.
Status read_shot(const v1::Shot& wire, const Convention& convention, double aspect, const std::string& field,
                 AskedShot& out);

// What cannot be: the shot's distance or height, or the first pose's distance, is beyond the settings' limits, or no
// subject is an instance. One sentence each, beginning with `field` or "open.camera".
std::vector<std::string> shot_warnings(const SessionOptions& options, const std::string& field);

}  // namespace sightline
