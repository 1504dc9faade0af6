// Clearance of each candidate from static colliders, computed once for each lattice cell. The lattice is anchored to the world, so the
// clearance of a cell stays valid while the cell is in the bound.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/aggregate/lattice.h"
#include "server/scene/clearance.h"

namespace sightline {

class ClearanceCache {
 public:
  // Distance in metres from each candidate to the nearest static collider, capped at 2 lattice spacings + `body_radius_m` + 0.5 m. With
  // `on_lattice` the first candidates are the lattice's covered cells in its order, and are cached; all others are measured in each
  // call. The result is valid until the next call. Only cells that are new to the bound cost time.
  std::span<const float> measure(const SceneMirror& mirror, const Lattice& lattice, const Bound& bound,
                                 std::span<const glm::dvec3> position_m, bool on_lattice,
                                 double body_radius_m);

 private:
  struct Cell {
    uint64_t owner = 0;  // Lattice::owner of the address when it was measured
    float clearance_m = 0;
  };
  ClearanceField field_;
  std::vector<Cell> cells_;
  uint64_t static_version_ = 0;
  double reach_m_ = 0;
  std::vector<float> clearance_m_;
};

}  // namespace sightline
