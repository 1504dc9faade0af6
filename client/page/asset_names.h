// What the drawables of a scene file are called.
#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>

#include "server/scene/asset.h"

namespace sightline {

// Names of the drawables that no binding names, by the id that `instantiate` gives them; each of a node's gpu instances
// has its number behind the name.
std::unordered_map<uint64_t, std::string> asset_names(const SceneAsset& asset);

}  // namespace sightline
