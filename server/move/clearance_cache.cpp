#include "server/move/clearance_cache.h"

#include <algorithm>
#include <optional>

namespace sightline {
namespace {

// Between two surfaces a place is moved to and fro. Openings that need more moves than this are hardly wider than the body.
constexpr int kMoves = 6;
// Each move goes this much farther than the body needs, so that rounding does not ask for another.
constexpr double kFartherM = 0.005;
// Where there is room, a place keeps this much more away. Maps of few texels see a little through surfaces that they meet at a slant.
constexpr double kMoreRoomM = 0.15;

// The straight free way from a point to a place near it at which a sphere fits.
std::optional<glm::vec3> way_to_fitting_place(const ClearanceField& field, const glm::dvec3& point_m, double radius_m, double farthest_m) {
  glm::dvec3 place_m = point_m, surface_m;
  for (int k = 0; k < kMoves && field.nearest(place_m, radius_m, surface_m); ++k) {
    const double clearance_m = glm::distance(place_m, surface_m);
    if (clearance_m < 1e-3) return std::nullopt;
    place_m += (place_m - surface_m) * ((radius_m - clearance_m + kFartherM) / clearance_m);
    if (glm::distance(place_m, point_m) > farthest_m) return std::nullopt;
  }
  if (field.nearest(place_m, radius_m, surface_m) || field.free_fraction(point_m, place_m, 1e-3) < 1) return std::nullopt;
  return glm::vec3(place_m - point_m);
}

}  // namespace

ClearanceCache::Cell ClearanceCache::measure_cell(const glm::dvec3& point_m, double reach_m, double spacing_m, double body_radius_m) const {
  Cell cell{.clearance_m = static_cast<float>(field_.clearance_m(point_m, reach_m))};
  if (cell.clearance_m >= body_radius_m) return cell;
  auto move_m = way_to_fitting_place(field_, point_m, body_radius_m + kMoreRoomM, kFartherSpacings * spacing_m);
  if (!move_m) move_m = way_to_fitting_place(field_, point_m, body_radius_m, kFartherSpacings * spacing_m);
  if (move_m) {
    cell.move_m = *move_m;
    cell.moved_clearance_m = static_cast<float>(field_.clearance_m(point_m + glm::dvec3(*move_m), reach_m));
  }
  return cell;
}

std::span<const float> ClearanceCache::measure(const SceneMirror& mirror, const Lattice& lattice, const Bound& bound,
                                               std::span<glm::dvec3> position_m, bool on_lattice, double body_radius_m) {
  const double reach_m = std::max(kReachSpacings * lattice.spacing_m(), body_radius_m + kMoreRoomM);
  const size_t cell_count = on_lattice ? lattice.addresses().size() : 0;
  double farthest_m = bound.radius_m + kFartherSpacings * lattice.spacing_m();
  for (const glm::dvec3& p : position_m.subspan(cell_count))
    farthest_m = std::max(farthest_m, glm::distance(p, bound.center_m));
  field_.gather(mirror, bound.center_m, farthest_m * (1 + 1e-9) + reach_m, mirror.moving_slots());
  if (cells_.size() != lattice.address_count() || static_version_ != mirror.static_version() || reach_m_ != reach_m ||
      body_radius_m_ != body_radius_m)
    cells_.assign(lattice.address_count(), Cell{});
  static_version_ = mirror.static_version();
  reach_m_ = reach_m, body_radius_m_ = body_radius_m;

  clearance_m_.resize(position_m.size());
  moved_.clear();
  for (size_t i = 0; i < position_m.size(); ++i) {
    if (i >= cell_count) {
      clearance_m_[i] = static_cast<float>(field_.clearance_m(position_m[i], reach_m));
      continue;
    }
    const uint32_t address = lattice.addresses()[i];
    Cell& cell = cells_[address];
    if (cell.owner != lattice.owner(address)) {
      cell = measure_cell(position_m[i], reach_m, lattice.spacing_m(), body_radius_m);
      cell.owner = lattice.owner(address);
    }
    const glm::dvec3 place_m = position_m[i] + glm::dvec3(cell.move_m);
    const bool moves = cell.moved_clearance_m > 0 && bound.contains(place_m);
    clearance_m_[i] = moves ? cell.moved_clearance_m : cell.clearance_m;
    if (!moves) continue;
    position_m[i] = place_m;
    moved_.push_back(static_cast<uint32_t>(i));
  }
  return clearance_m_;
}

}  // namespace sightline
