// Standoff: how far each place is from what stands still, measured once a place: lattice cells are places in the world, so what was
// measured holds while they are in the bound.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/aggregate/lattice.h"
#include "server/scene/clearance.h"

namespace sightline {

class Standoff {
 public:
  // Metres from each place to the nearest collider that does not move, or 2 spacings of the lattice and `body_radius_m` and half
  // a metre, whichever is less. Either the first places are the lattice's covered cells, in its order (`on_lattice`), and those
  // after them are measured each time, or all are. Valid until the next call. The cost is that of the cells that are new to
  // the bound.
  std::span<const float> measure(const SceneMirror& mirror, const Lattice& lattice, const Bound& bound,
                                 std::span<const glm::dvec3> position_m, bool on_lattice,
                                 double body_radius_m);

 private:
  struct Cell {
    uint64_t owner = 0;  // of the address when it was measured
    float clearance_m = 0;
  };
  ClearanceField field_;
  std::vector<Cell> cells_;
  uint64_t static_version_ = 0;
  double reach_m_ = 0;
  std::vector<float> clearance_m_;
};

}  // namespace sightline
