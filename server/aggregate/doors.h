// Doors: a way that is open now may soon be shut. A camera that sees its targets through a doorway must be in their
// room, or near it, before the door shuts.
//
// Nothing says which instance is a door. One that collides and occludes, is a thin plate, has rested, and has moved
// aside by no more than its own size is taken for one: leaves that slide, swing or are drawn up. Walkers, vehicles and
// cabins are not thin, and whoever walks away has left.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/base/inline_vector.h"
#include "server/scene/mirror.h"

namespace sightline {

// A rectangle in the world, metres: its middle, and the two vectors from there to the middles of two neighbouring
// edges. They are at right angles unless the instance is sheared.
struct Plate {
  glm::dvec3 middle_m{0.0}, half_u_m{0.0}, half_v_m{0.0};
};

// The plate that an instance is: the largest side of its box, through its middle. Returns false if the box is not thin,
// or the instance has no geometry.
bool plate_of(const Instance& instance, Plate& plate);

// Where a door shuts.
struct OpenDoor {
  Plate shut;
  float weight = 0.0f;  // how much it counts as shut, (0, 1]: less and less, the longer it has been open
};

inline constexpr size_t kMostOpenDoors = 8;  // that one decision looks at
using OpenDoors = InlineVector<OpenDoor, kMostOpenDoors>;

// Allocates only when instances are added. Not thread-safe. Deterministic.
class Doors {
 public:
  // A step: `dt_s` >= 0 since the last one, `clock_s` since the session opened. The targets are no doors. Costs
  // O(n log n) for n thin instances that move.
  void pass(const SceneMirror& scene, std::span<const uint64_t> target_ids, double dt_s, double clock_s);

  // The open doors that can lie between a point of the sphere round `center_m` and `to_m`; of more than kMostOpenDoors,
  // those that are nearest to the sphere's centre.
  OpenDoors open(const glm::dvec3& center_m, double radius_m, const glm::dvec3& to_m) const;

 private:
  friend struct StateFields;  // writes and reads it as bytes (server/session/session_memory.cpp)
  struct Leaf {
    uint64_t id = 0;
    Plate rest;
    double rested_s = 0.0, away_s = 0.0;  // it has been there, or away from there, for this time
  };
  static void follow(Leaf& leaf, const Plate& now, double dt_s);
  std::vector<Leaf> leaves_;  // by id, ascending
};

// Raises hidden[i] to the door's weight where it would hide `to_m` from place i. Places are relative to `origin_m`,
// `to_m` is in the world. All arrays are as long as `hidden`.
struct Places {
  const float *x_m, *y_m, *z_m;
  glm::dvec3 origin_m;
};
void hide_behind(const OpenDoor& door, const Places& places, const glm::dvec3& to_m, std::span<float> hidden);

}  // namespace sightline
