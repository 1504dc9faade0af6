// A plan of a level: everything as seen from above, and beside it a person of 1.8 m at the same scale. A wrong unit
// shows at a glance.
#pragma once

#include "client/check/level_facts.h"
#include "client/page/picture.h"

namespace sightline {

// +X is to the right and +Z is down. Floors and roofs are light, the higher the lighter; walls that hide are dark, what
// is see-through is blue, and targets and other moving parts are orange. The picture is about 1,000 pixels wide.
Picture draw_plan(const Level& level, const LevelFacts& facts);

}  // namespace sightline
