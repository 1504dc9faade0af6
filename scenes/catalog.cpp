#include "scenes/catalog.h"

#include <array>

#include "scenes/hall.h"
#include "scenes/rooms.h"

namespace sightline::scenes {
namespace {

constexpr std::array<CatalogEntry, 2> kCatalog{{
    {"hall", "a colonnade, sharp turns, sudden occluders (Table 2)",
     [](const SceneRequest& r) { return make_hall({.seed = r.seed}); }},
    {"rooms", "nine rooms, two targets through the doors",
     [](const SceneRequest& r) { return make_rooms({.seed = r.seed}); }},
}};

}  // namespace

std::span<const CatalogEntry> catalog() {
  return kCatalog;
}

const CatalogEntry* find_scene(std::string_view name) {
  for (const CatalogEntry& entry : kCatalog)
    if (entry.name == name) return &entry;
  return nullptr;
}

}  // namespace sightline::scenes
