// Lasting: what hides a place only for a moment does not count, what stays does (design 5: minimum occlusion).
//
// What stands still hides until somebody moves; what moves may be gone at once, as a fence post that passes. So the share that
// movers hide of the targets at a place is taken as a low pass.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/aggregate/lattice.h"

namespace sightline {

// One belongs to one lattice; a cell that leaves the bound and comes back starts anew. Not thread-safe. Deterministic.
class LastingShares {
 public:
  // hidden[i] becomes what has lasted of it. The first entries are the lattice's covered cells, in its order (`on_lattice`; else
  // none is); those after them are places that travel, each with a past of its own by its index. dt_s >= 0; memory_s >= 0: the
  // time constant; 0: all counts at once.
  void update(const Lattice& lattice, bool on_lattice, double dt_s, double memory_s,
              std::span<double> hidden);

 private:
  struct Past {
    uint64_t owner = 0;          // of the address
    uint64_t step = UINT64_MAX;  // when it was last updated; never, at first
    double lasted = 0;
  };
  uint64_t step_ = 0;
  std::vector<Past> cells_, travellers_;
};

}  // namespace sightline
