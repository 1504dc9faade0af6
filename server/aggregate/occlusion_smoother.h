// Smooths the share of the targets that moving occluders hide from each candidate (design 5: minimum occlusion). A
// static occluder hides until the camera or the target moves. A moving one may be gone in a moment, so its share goes
// through a low-pass filter.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/aggregate/lattice.h"

namespace sightline {

// Belongs to one lattice. A cell that leaves the bound loses its past. Not thread-safe. Deterministic.
class OcclusionSmoother {
 public:
  // Replaces each hidden[i] by its low-passed value. The first entries are the lattice's covered cells in its order.
  // All other entries are candidates that move; their past goes by their index. dt_s >= 0. The time constant memory_s
  // is >= 0; 0 turns the filter off.
  void update(const Lattice& lattice, double dt_s, double memory_s, std::span<double> hidden);

 private:
  friend struct StateFields;  // lists its fields, to write and read them as bytes (server/session/state_fields.h)
  struct Past {
    uint64_t owner = 0;          // Lattice::owner of the address
    uint64_t step = UINT64_MAX;  // of the last update; UINT64_MAX: never
    double smoothed = 0;
  };
  uint64_t step_ = 0;
  std::vector<Past> cells_, travellers_;
};

}  // namespace sightline
