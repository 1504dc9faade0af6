#include "scenes/level_catalog.h"

#include <array>

#include "scenes/levels.h"
#include "scenes/tile_set.h"

namespace sightline::scenes {
namespace {

using Maker = std::vector<std::byte> (*)(const LevelOptions&, const PartMeshes&);

struct Variant {
  const char* name;
  const char* summary;
  Maker make;
  LevelOptions options;
};

constexpr std::array<Variant, 14> kVariants{{
    {"rooms-one", "4 x 3 rooms of 8 m, no ceiling, one target", make_level_rooms, {.walk = LevelWalk::kOne}},
    {"rooms-row", "the rooms, two targets one behind the other", make_level_rooms, {.walk = LevelWalk::kRow}},
    {"rooms-beside", "the rooms, two targets side by side", make_level_rooms, {.walk = LevelWalk::kBeside}},
    {"rooms-crossing", "the rooms, two targets that change sides", make_level_rooms, {.walk = LevelWalk::kCrossing}},
    {"rooms-parted", "the rooms, two targets parted by a wall for 12 to 16 s", make_level_parted, {}},
    {"rooms-four", "the rooms, two pairs", make_level_rooms, {.walk = LevelWalk::kFour}},
    {"roofed-one",
     "the rooms under a ceiling, one target",
     make_level_rooms,
     {.walk = LevelWalk::kOne, .roofed = true}},
    {"roofed-row",
     "the rooms under a ceiling, two targets one behind the other",
     make_level_rooms,
     {.walk = LevelWalk::kRow, .roofed = true}},
    {"halls-one",
     "2 x 2 halls of 20 m with pillars, one target",
     make_level_halls,
     {.walk = LevelWalk::kOne, .furniture_per_room = 10}},
    {"halls-beside",
     "the halls, two targets side by side",
     make_level_halls,
     {.walk = LevelWalk::kBeside, .furniture_per_room = 10}},
    {"halls-crossing",
     "the halls under a ceiling, two targets that change sides",
     make_level_halls,
     {.walk = LevelWalk::kCrossing, .roofed = true, .furniture_per_room = 10}},
    {"halls-four", "the halls, two pairs", make_level_halls, {.walk = LevelWalk::kFour, .furniture_per_room = 10}},
    {"storeys-one",
     "two storeys and two flights of stairs, one target",
     make_level_storeys,
     {.duration_s = 50.0, .walk = LevelWalk::kOne}},
    {"storeys-row",
     "two storeys under a ceiling, two targets one behind the other",
     make_level_storeys,
     {.duration_s = 50.0, .walk = LevelWalk::kRow, .roofed = true}},
}};

LevelOptions seeded(LevelOptions options, uint64_t seed) {
  options.seed = seed;
  return options;
}

Result<std::vector<std::byte>> make_of_tiles(const Variant& variant, const SceneRequest& request) {
  const auto parts = read_tiles(tiles_folder(request.tiles));
  if (!parts) return tl::unexpected(parts.error());
  return variant.make(seeded(variant.options, request.seed), *parts);
}

}  // namespace

std::vector<CatalogEntry> level_entries() {
  std::vector<CatalogEntry> entries;
  for (const Variant& v : kVariants)
    entries.push_back({std::string("level-") + v.name, v.summary, SceneGroup::kLevels,
                       [&v](const SceneRequest& r) { return v.make(seeded(v.options, r.seed), block_parts()); }});
  return entries;
}

std::vector<CatalogEntry> tile_entries() {
  std::vector<CatalogEntry> entries;
  for (const Variant& v : kVariants)
    entries.push_back({std::string("tile-") + v.name, v.summary, SceneGroup::kTiles,
                       [&v](const SceneRequest& r) { return make_of_tiles(v, r); }});
  return entries;
}

}  // namespace sightline::scenes
