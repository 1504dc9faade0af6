#include "server/aggregate/occlusion_smoother.h"

#include <algorithm>
#include <cmath>

namespace sightline {

void OcclusionSmoother::update(const Lattice& lattice, double dt_s, double memory_s, std::span<double> hidden) {
  const double share = memory_s > 0 ? -std::expm1(-dt_s / memory_s) : 1.0;
  const size_t cells = lattice.addresses().size();
  if (cells_.size() != lattice.address_count()) cells_.assign(lattice.address_count(), Past{});
  if (travellers_.size() < hidden.size() - cells) travellers_.resize(hidden.size() - cells);
  ++step_;
  for (size_t i = 0; i < hidden.size(); ++i) {
    Past& past = i < cells ? cells_[lattice.addresses()[i]] : travellers_[i - cells];
    const uint64_t owner = i < cells ? lattice.owner(lattice.addresses()[i]) : 0;
    if (past.owner != owner || past.step + 1 != step_) past = {.owner = owner, .smoothed = hidden[i]};
    past.step = step_;
    past.smoothed += share * (hidden[i] - past.smoothed);
    hidden[i] = past.smoothed;
  }
}

}  // namespace sightline
