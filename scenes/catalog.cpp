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
#include "scenes/lift.h"
#include "scenes/maze.h"
#include "scenes/open_ground.h"
#include "scenes/pitch.h"
#include "scenes/real_motion.h"
#include "scenes/roofs.h"
#include "scenes/rooms.h"
#include "scenes/stairwell.h"
#include "scenes/streets.h"
#include "scenes/subjects.h"

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

// A fence for a camera that may be anywhere in the bound at the next step, as in the paper's Table 3. At a greatest
// acceleration of 10 m/s^2 a camera has hardly begun to move when a picket has passed.
FenceOptions agile_fence(uint64_t seed) {
  return {.seed = seed, .picket_m = 0.07, .limits = {1000, 1000}};
}

std::vector<CatalogEntry> paper_entries() {
  constexpr SceneGroup kGroup = SceneGroup::kPaper;
  return {
      {"hall-front", "the hall of the study, seen from before the targets (Table 2)", kGroup,
       [](const SceneRequest& r) { return make_hall({.seed = r.seed, .from_front = true}); }},
      {"fence-agile", "the fence with wider pickets, for a camera without inertia (Table 3)", kGroup,
       [](const SceneRequest& r) { return make_fence(agile_fence(r.seed)); }},
  };
}

CatalogEntry roof_entry(std::string name, std::string summary, const RoofsOptions& options) {
  return {std::move(name), std::move(summary), SceneGroup::kRoofs, [options](const SceneRequest& r) {
            RoofsOptions seeded = options;
            seeded.seed = r.seed;
            return make_roofs(seeded);
          }};
}

std::vector<CatalogEntry> roof_entries() {
  return {
      roof_entry("roof-two", "two people stand in a furnished room", {.people = 2}),
      roof_entry("roof-three", "three people stand in a furnished room", {.people = 3}),
      roof_entry("roof-four", "four people stand in a furnished room", {.people = 4}),
      roof_entry("roof-two-walk", "two people walk about in a furnished hall", {.people = 2, .walk = true}),
      roof_entry("roof-three-walk", "three people walk about in a furnished hall", {.people = 3, .walk = true}),
      roof_entry("roof-four-walk", "four people walk about in a furnished hall", {.people = 4, .walk = true}),
      roof_entry("roof-corridor", "two people stand in a corridor 3 m wide", {.corridor = true}),
      roof_entry("roof-corridor-walk", "two people walk along a corridor 3 m wide", {.walk = true, .corridor = true}),
  };
}

std::vector<CatalogEntry> subject_entries() {
  constexpr SceneGroup kGroup = SceneGroup::kSubjects;
  return {
      {"cycle", "six people 5 m apart, the subject is another one every 4 s", kGroup,
       [](const SceneRequest& r) { return make_cycle({.seed = r.seed}); }},
      {"cycle-far", "the same 25 m apart, every 6 s", kGroup,
       [](const SceneRequest& r) { return make_cycle({.seed = r.seed, .apart_m = 25, .each_s = 6}); }},
      {"runner", "a runner between columns who turns to a side or back every 8 m", kGroup,
       [](const SceneRequest& r) { return make_runner({.seed = r.seed}); }},
      {"conversation", "two people talk under a ceiling; the head of one is the target", kGroup,
       [](const SceneRequest& r) { return make_conversation({.seed = r.seed}); }},
      {"apart-two", "two people stand 20 m apart, the camera between them", kGroup,
       [](const SceneRequest& r) { return make_apart({.seed = r.seed}); }},
      {"apart-three", "three people stand 25 m apart, the camera between them", kGroup,
       [](const SceneRequest& r) { return make_apart({.seed = r.seed, .people = 3, .apart_m = 25}); }},
  };
}

std::vector<CatalogEntry> motion_entries() {
  constexpr SceneGroup kGroup = SceneGroup::kMotion;
  const auto options = [](const SceneRequest& r) { return RealMotionOptions{.seed = r.seed, .folder = r.motion}; };
  return {
      {"motion-corner", "recorded people walk round the corner of a corridor", kGroup,
       [options](const SceneRequest& r) { return make_real_corner(options(r), false); }},
      {"motion-corner-roofed", "the same under a ceiling at 2.8 m", kGroup,
       [options](const SceneRequest& r) { return make_real_corner(options(r), true); }},
      {"motion-attack", "a recorded football attack; the ball and who is nearest to it", kGroup,
       [options](const SceneRequest& r) { return make_real_attack(options(r)); }},
  };
}

std::vector<CatalogEntry> situation_entries() {
  constexpr SceneGroup kGroup = SceneGroup::kSituations;
  return {
      {"corridor-one", "the corridors of the group study, one target", kGroup,
       [](const SceneRequest& r) { return make_corridors({.seed = r.seed, .targets = 1}); }},
      {"corridor-narrow", "the same, 1 m wide", kGroup,
       [](const SceneRequest& r) { return make_corridors({.seed = r.seed, .width_m = 1.0, .targets = 1}); }},
      {"doors-roofed", "nine roofed rooms whose doors shut from 0.8 s behind the targets on", kGroup,
       [](const SceneRequest& r) {
         return make_doors({.seed = r.seed, .hold_s = 0.8, .wait_s = 2.0, .roofed = true});
       }},
      {"maze", "a maze of 11 x 11 cells, two targets", kGroup,
       [](const SceneRequest& r) { return make_maze({.seed = r.seed}); }},
      {"maze-roofed", "the maze under a ceiling, one target", kGroup,
       [](const SceneRequest& r) { return make_maze({.seed = r.seed, .targets = 1, .roofed = true}); }},
      {"stairwell", "four storeys of stairs in a closed shaft, one target", kGroup,
       [](const SceneRequest& r) { return make_stairwell({.seed = r.seed}); }},
      {"lift", "a cabin with a target in a tower of four storeys", kGroup,
       [](const SceneRequest& r) { return make_lift({.seed = r.seed}); }},
      {"street", "a car at 15 to 30 m/s in a grid of streets with traffic", kGroup,
       [](const SceneRequest& r) { return make_street({.seed = r.seed}); }},
      {"block", "a car rounds a block of 120 m at 20 m/s and waits", kGroup,
       [](const SceneRequest& r) { return make_block({.seed = r.seed}); }},
      {"pitch", "22 players and a ball; two of them and the ball are the targets", kGroup,
       [](const SceneRequest& r) { return make_pitch({.seed = r.seed}); }},
      {"sprint-10", "open ground, a car faster than the camera, then slower; camera 10 m/s, 10 m/s^2", kGroup,
       [](const SceneRequest& r) {
         return make_sprint({.seed = r.seed, .limits = {10, 10}});
       }},
      {"sprint-12", "the same; camera 12 m/s, 4 m/s^2", kGroup,
       [](const SceneRequest& r) {
         return make_sprint({.seed = r.seed, .limits = {12, 4}});
       }},
      {"sprint-40", "the same; camera 40 m/s, 20 m/s^2", kGroup,
       [](const SceneRequest& r) {
         return make_sprint({.seed = r.seed, .limits = {40, 20}});
       }},
      {"parting", "open ground, two targets part for 60 m and come back", kGroup,
       [](const SceneRequest& r) { return make_parting({.seed = r.seed}); }},
      {"leaving", "open ground, one of two targets leaves for good", kGroup,
       [](const SceneRequest& r) { return make_parting({.seed = r.seed, .duration_s = 50, .for_good = true}); }},
      {"teleport", "a target among columns that jumps by 20 m every 8 s", kGroup,
       [](const SceneRequest& r) { return make_teleport({.seed = r.seed}); }},
      {"walled-in", "the camera starts inside a wall", kGroup,
       [](const SceneRequest& r) { return make_walled_in({.seed = r.seed}); }},
  };
}

std::vector<CatalogEntry> all_entries() {
  std::vector<CatalogEntry> all = study_entries();
  for (std::vector<CatalogEntry> more : {level_entries(), tile_entries(), roof_entries(), subject_entries(),
                                         motion_entries(), situation_entries(), paper_entries()})
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
      return "tiles";
    case SceneGroup::kRoofs:
      return "roofs";
    case SceneGroup::kSubjects:
      return "subjects";
    case SceneGroup::kMotion:
      return "motion";
    case SceneGroup::kSituations:
      return "situations";
    case SceneGroup::kPaper:
      break;
  }
  return "paper";
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
