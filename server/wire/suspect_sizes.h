// Sizes that cannot be right: most often a scene file in another unit than metres.
#pragma once

#include <string>
#include <vector>

#include "server/session/session.h"

namespace sightline {

// A scene file that is longer than this, or shorter than the other, is suspect. So are targets that are all longer than
// kLongestTargetM. Levels that are walked through are 10 m to 2 km long. In centimetres they measure 1 km to 200 km, in
// kilometres less than 2 m.
inline constexpr double kLongestSceneM = 2000.0, kShortestSceneM = 1.0, kLongestTargetM = 50.0;

// One sentence for each suspect size; empty when there is none. Measures the boxes along the world's axes, of the scene
// file's instances and of the targets. Instances are as in SessionOptions before the session opens. Ids of unknown
// targets are skipped.
std::vector<std::string> suspect_sizes(const SessionOptions& options);

}  // namespace sightline
