// The scenes by name.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "server/base/error.h"

namespace sightline::scenes {

// The options that callers by name can set; the others keep the defaults of the scene's own options.
struct SceneRequest {
  uint64_t seed = 1;
  int arena_targets = 4;  // [2, 8]
  int crowd_movers = 20;  // [0, 35]
  // folders of the tile set and of recorded motion; empty: environment variables name them (tile_set.h,
  // motion_tracks.h)
  std::string tiles = {}, motion = {};
};

enum class SceneGroup {
  kStudy,       // one difficulty each: what the results page shows
  kLevels,      // rooms, halls and storeys of plain boxes
  kTiles,       // the same levels of the tiles of a folder
  kRoofs,       // two to four people under a low ceiling
  kSubjects,    // the subject changes or turns, talks or stands too far away
  kMotion,      // real people's motion of the recordings in a folder
  kSituations,  // one unusual use each: a lift, a maze, a car in streets, targets that part
  kPaper,       // scenes of the study as the paper's own experiments have them
};
std::string_view name_of(SceneGroup group);  // "study", "levels", "tiles", "roofs", "subjects", ...
std::optional<SceneGroup> find_group(std::string_view name);
inline constexpr SceneGroup kAllGroups[] = {SceneGroup::kStudy,      SceneGroup::kLevels,   SceneGroup::kTiles,
                                            SceneGroup::kRoofs,      SceneGroup::kSubjects, SceneGroup::kMotion,
                                            SceneGroup::kSituations, SceneGroup::kPaper};

struct CatalogEntry {
  std::string name;  // also the file's name, before ".glb"
  std::string summary;
  SceneGroup group = SceneGroup::kStudy;
  // A .glb file. Fails only in the groups kTiles and kMotion: kNotFound when the folder is missing or incomplete,
  // kInvalidArgument when a file in it is broken.
  std::function<Result<std::vector<std::byte>>(const SceneRequest& request)> make;
};

std::span<const CatalogEntry> catalog();
std::vector<const CatalogEntry*> scenes_of(SceneGroup group);
// Null when no scene has this name.
const CatalogEntry* find_scene(std::string_view name);

}  // namespace sightline::scenes
