// Reads the parts of levels from a folder of tiles: KayKit's "Dungeon Remastered" (CC0, kaylousberg.com), one .glb a
// tile. The tiles are not part of this project; without them levels are made of plain boxes.
#pragma once

#include <string>

#include "scenes/level_parts.h"
#include "server/base/error.h"

namespace sightline::scenes {

// Name of the environment variable that holds the folder when no option does.
inline constexpr const char* kTilesVariable = "SIGHTLINE_TILES";

// `folder` if it is not empty, else the value of kTilesVariable, else empty.
std::string tiles_folder(const std::string& folder);

// kNotFound: `folder` is empty or lacks a tile. Otherwise the errors of read_gltf. The doors of doorways are left out.
Result<PartMeshes> read_tiles(const std::string& folder);

}  // namespace sightline::scenes
