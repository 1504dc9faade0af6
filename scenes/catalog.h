// The scenes by name.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace sightline::scenes {

// The options that callers by name can set; the others keep the defaults of the scene's own options.
struct SceneRequest {
  uint64_t seed = 1;
  int arena_targets = 4;  // [2, 8]
  int crowd_movers = 20;  // [0, 35]
};

struct CatalogEntry {
  std::string_view name;  // also the file's name, before ".glb"
  std::string_view summary;
  std::vector<std::byte> (*make)(const SceneRequest& request);
};

std::span<const CatalogEntry> catalog();
// Null when no scene has this name.
const CatalogEntry* find_scene(std::string_view name);

}  // namespace sightline::scenes
