#include "server/move/clearance_cache.h"

#include <algorithm>

namespace sightline {

std::span<const float> ClearanceCache::measure(const SceneMirror& mirror, const Lattice& lattice,
                                         const Bound& bound, std::span<const glm::dvec3> position_m,
                                         bool on_lattice, double body_radius_m) {
  const double reach_m = 2 * lattice.spacing_m() + body_radius_m + 0.5;
  const size_t cell_count = on_lattice ? lattice.addresses().size() : 0;
  double farthest_m = bound.radius_m;
  for (const glm::dvec3& p : position_m.subspan(cell_count))
    farthest_m = std::max(farthest_m, glm::distance(p, bound.center_m));
  field_.gather(mirror, bound.center_m, farthest_m * (1 + 1e-9) + reach_m, mirror.moving_slots());
  if (cells_.size() != lattice.address_count() || static_version_ != mirror.static_version() ||
      reach_m_ != reach_m)
    cells_.assign(lattice.address_count(), Cell{});
  static_version_ = mirror.static_version();
  reach_m_ = reach_m;

  clearance_m_.resize(position_m.size());
  for (size_t i = 0; i < position_m.size(); ++i) {
    if (i >= cell_count) {
      clearance_m_[i] = static_cast<float>(field_.clearance_m(position_m[i], reach_m));
      continue;
    }
    const uint32_t address = lattice.addresses()[i];
    Cell& cell = cells_[address];
    if (cell.owner != lattice.owner(address))
      cell = {lattice.owner(address), static_cast<float>(field_.clearance_m(position_m[i], reach_m))};
    clearance_m_[i] = cell.clearance_m;
  }
  return clearance_m_;
}

}  // namespace sightline
