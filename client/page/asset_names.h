// Names of the drawables of a scene file.
#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>

#include "server/scene/asset.h"

namespace sightline {

// Names of drawables without a binding, by the id that `instantiate` gives them. A node's GPU instances are numbered:
// "crate #2".
std::unordered_map<uint64_t, std::string> asset_names(const SceneAsset& asset);

}  // namespace sightline
