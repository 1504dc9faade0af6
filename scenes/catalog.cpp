#include "scenes/catalog.h"

#include <iterator>

#include "scenes/arena.h"
#include "scenes/city.h"
#include "scenes/corridors.h"
#include "scenes/crowd.h"
#include "scenes/doors.h"
#include "scenes/fence.h"
#include "scenes/forest.h"
#include "scenes/hall.h"
#include "scenes/level_catalog.h"
#include "scenes/rooms.h"

namespace sightline::scenes {
namespace {

std::vector<CatalogEntry> study_entries() {
  return {
      {"fence", "a sparse fence sways before two standing targets (Table 3)", SceneGroup::kStudy,
       [](const SceneRequest& r) { return make_fence({.seed = r.seed}); }},
      {"fence-board", "the same, and after 4 s a solid board before the targets that stays", SceneGroup::kStudy,
       [](const SceneRequest& r) { return make_fence({.seed = r.seed, .board_at_s = 4.0}); }},
      {"hall", "a colonnade, sharp turns, sudden occluders (Table 2)", SceneGroup::kStudy,
       [](const SceneRequest& r) { return make_hall({.seed = r.seed}); }},
      {"rooms", "nine rooms, two targets through the doors", SceneGroup::kStudy,
       [](const SceneRequest& r) { return make_rooms({.seed = r.seed}); }},
      {"city", "280 K triangles of streets and buildings (Table 1)", SceneGroup::kStudy,
       [](const SceneRequest& r) { return make_city({.seed = r.seed}); }},
      {"arena", "two to eight targets run around obstacles", SceneGroup::kStudy,
       [](const SceneRequest& r) { return make_arena({.seed = r.seed, .targets = r.arena_targets}); }},
      {"forest", "winding ways between some 400 trees", SceneGroup::kStudy,
       [](const SceneRequest& r) { return make_forest({.seed = r.seed}); }},
      {"crowd", "up to 35 others walk through the targets' way on a plaza", SceneGroup::kStudy,
       [](const SceneRequest& r) { return make_crowd({.seed = r.seed, .movers = r.crowd_movers}); }},
      {"doors", "rooms whose doors close behind the targets", SceneGroup::kStudy,
       [](const SceneRequest& r) { return make_doors({.seed = r.seed}); }},
      {"corridors", "narrow passages with right-angled corners", SceneGroup::kStudy,
       [](const SceneRequest& r) { return make_corridors({.seed = r.seed}); }},
  };
}

std::vector<CatalogEntry> all_entries() {
  std::vector<CatalogEntry> all = study_entries();
  for (std::vector<CatalogEntry> more : {level_entries(), tile_entries()})
    all.insert(all.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
  return all;
}

}  // namespace

std::string_view name_of(SceneGroup group) {
  switch (group) {
    case SceneGroup::kStudy:
      return "study";
    case SceneGroup::kLevels:
      return "levels";
    case SceneGroup::kTiles:
      break;
  }
  return "tiles";
}

std::optional<SceneGroup> find_group(std::string_view name) {
  for (const SceneGroup group : kAllGroups)
    if (name_of(group) == name) return group;
  return {};
}

std::span<const CatalogEntry> catalog() {
  static const std::vector<CatalogEntry> entries = all_entries();
  return entries;
}

std::vector<const CatalogEntry*> scenes_of(SceneGroup group) {
  std::vector<const CatalogEntry*> found;
  for (const CatalogEntry& entry : catalog())
    if (entry.group == group) found.push_back(&entry);
  return found;
}

const CatalogEntry* find_scene(std::string_view name) {
  for (const CatalogEntry& entry : catalog())
    if (entry.name == name) return &entry;
  return nullptr;
}

}  // namespace sightline::scenes
