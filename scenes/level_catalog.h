// The levels by name. Each comes with parts of plain boxes ("level-...") and with parts of a tile set ("tile-...").
#pragma once

#include <vector>

#include "scenes/catalog.h"

namespace sightline::scenes {

std::vector<CatalogEntry> level_entries();
std::vector<CatalogEntry> tile_entries();

}  // namespace sightline::scenes
