#include "scenes/catalog.h"

#include <array>

#include "scenes/arena.h"
#include "scenes/city.h"
#include "scenes/corridors.h"
#include "scenes/crowd.h"
#include "scenes/doors.h"
#include "scenes/fence.h"
#include "scenes/forest.h"
#include "scenes/hall.h"
#include "scenes/rooms.h"

namespace sightline::scenes {
namespace {

constexpr std::array<CatalogEntry, 10> kCatalog{{
    {"fence", "a sparse fence sways before two standing targets (Table 3)",
     [](const SceneRequest& r) { return make_fence({.seed = r.seed}); }},
    {"fence-board", "the same, and after 4 s a solid board before the targets that stays",
     [](const SceneRequest& r) { return make_fence({.seed = r.seed, .board_at_s = 4.0}); }},
    {"hall", "a colonnade, sharp turns, sudden occluders (Table 2)",
     [](const SceneRequest& r) { return make_hall({.seed = r.seed}); }},
    {"rooms", "nine rooms, two targets through the doors",
     [](const SceneRequest& r) { return make_rooms({.seed = r.seed}); }},
    {"city", "280 K triangles of streets and buildings (Table 1)",
     [](const SceneRequest& r) { return make_city({.seed = r.seed}); }},
    {"arena", "two to eight targets run around obstacles",
     [](const SceneRequest& r) { return make_arena({.seed = r.seed, .targets = r.arena_targets}); }},
    {"forest", "winding ways between some 400 trees",
     [](const SceneRequest& r) { return make_forest({.seed = r.seed}); }},
    {"crowd", "up to 35 others walk through the targets' way on a plaza",
     [](const SceneRequest& r) { return make_crowd({.seed = r.seed, .movers = r.crowd_movers}); }},
    {"doors", "rooms whose doors close behind the targets",
     [](const SceneRequest& r) { return make_doors({.seed = r.seed}); }},
    {"corridors", "narrow passages with right-angled corners",
     [](const SceneRequest& r) { return make_corridors({.seed = r.seed}); }},
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
