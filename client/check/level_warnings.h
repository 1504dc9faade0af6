// What is likely to be wrong with a level, each with its remedy.
#pragma once

#include <string>
#include <vector>

#include "client/check/level_facts.h"
#include "client/check/level_surfaces.h"

namespace sightline {

struct LevelWarning {
  // "file" (of the reader), "roles", "scale", "up_axis", "nothing_hides", "thin_walls", "one_sided", "one_mesh",
  // "no_colliders" or "all_collide"
  std::string kind;
  std::string text;
};

// In the order above. Those of the kinds "file" and "scale" are told by the daemon too.
std::vector<LevelWarning> level_warnings(const Level& level, const LevelFacts& facts, const SurfaceFindings& surfaces);

}  // namespace sightline
