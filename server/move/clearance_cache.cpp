#include "server/move/clearance_cache.h"

#include <algorithm>
#include <optional>

namespace sightline {
namespace {

// Between two surfaces a place is moved to and fro. Openings that need more moves than this are hardly wider than the
// body.
constexpr int kMoves = 6;
// Each move goes this much farther than the body needs, so that rounding does not ask for another.
constexpr double kFartherM = 0.005;
// Where there is room, a place keeps this much more away. Maps of few texels see a little through surfaces that they
// meet at a slant.
constexpr double kMoreRoomM = 0.15;

// The straight free way from a point to a place near it at which a sphere fits.
std::optional<glm::vec3> way_to_fitting_place(const ClearanceField& field, const glm::dvec3& point_m, double radius_m,
                                              double farthest_m) {
  glm::dvec3 place_m = point_m, surface_m;
  for (int k = 0; k < kMoves && field.nearest(place_m, radius_m, surface_m); ++k) {
    const double clearance_m = glm::distance(place_m, surface_m);
    if (clearance_m < 1e-3) return std::nullopt;
    place_m += (place_m - surface_m) * ((radius_m - clearance_m + kFartherM) / clearance_m);
    if (glm::distance(place_m, point_m) > farthest_m) return std::nullopt;
  }
  if (field.nearest(place_m, radius_m, surface_m) || field.free_fraction(point_m, place_m, 1e-3) < 1)
    return std::nullopt;
  return glm::vec3(place_m - point_m);
}

}  // namespace

ClearanceCache::Cell ClearanceCache::measure_cell(const glm::dvec3& point_m, double spacing_m) {
  field_.allow(kTestsOfCell);
  Cell cell{.clearance_m = static_cast<float>(field_.clearance_m(point_m, reach_m_))};
  if (cell.clearance_m < body_radius_m_) {
    auto move_m = way_to_fitting_place(field_, point_m, body_radius_m_ + kMoreRoomM, kFartherSpacings * spacing_m);
    if (!move_m) move_m = way_to_fitting_place(field_, point_m, body_radius_m_, kFartherSpacings * spacing_m);
    if (move_m) {
      cell.move_m = *move_m;
      cell.moved_clearance_m = static_cast<float>(field_.clearance_m(point_m + glm::dvec3(*move_m), reach_m_));
    }
  }
  cell.tests = static_cast<uint32_t>(field_.tests());
  tests_ += cell.tests;
  return cell;
}

const ClearanceCache::Cell& ClearanceCache::cell_at(const Lattice& lattice, size_t i, const glm::dvec3& point_m) {
  const uint32_t address = lattice.addresses()[i];
  Cell& cell = cells_[address];
  if (cell.owner == lattice.owner(address)) return cell;
  cell = measure_cell(point_m, lattice.spacing_m());
  cell.owner = lattice.owner(address);
  return cell;
}

// False if all cells together take more than is allowed: then not all of them may have been measured.
bool ClearanceCache::measure_all(const Lattice& lattice, std::span<const glm::dvec3> point_m) {
  left_out_.assign(point_m.size(), 0);
  uint64_t left = kTestsOfLattice + kTestsOfCells * point_m.size();
  for (size_t i = 0; i < point_m.size(); ++i) {
    const uint64_t tests = cell_at(lattice, i, point_m[i]).tests;
    if (tests > left) return false;
    left -= tests;
  }
  return true;
}

void ClearanceCache::leave_out_far_ones(const Lattice& lattice, const glm::dvec3& middle_m,
                                        std::span<const glm::dvec3> point_m) {
  by_distance_.clear();
  for (size_t i = 0; i < point_m.size(); ++i)
    by_distance_.emplace_back(glm::distance(point_m[i], middle_m), static_cast<uint32_t>(i));
  std::sort(by_distance_.begin(), by_distance_.end());
  left_out_.assign(point_m.size(), 0);
  uint64_t left = kTestsOfLattice + kTestsOfCells * point_m.size();
  bool all = true;
  for (const auto& [distance_m, i] : by_distance_) {
    const uint64_t tests = all ? cell_at(lattice, i, point_m[i]).tests : 0;
    all = all && tests <= left;
    left_out_[i] = !all;
    left -= std::min(left, tests);
  }
  if (all) by_distance_.clear();
}

void ClearanceCache::measure_others(std::span<const glm::dvec3> position_m, std::span<float> clearance_m) {
  field_.allow(kTestsOfCell + kTestsOfCells * position_m.size());
  for (size_t i = 0; i < position_m.size(); ++i)
    clearance_m[i] = static_cast<float>(field_.clearance_m(position_m[i], reach_m_));
  tests_ += field_.tests();
}

std::span<const float> ClearanceCache::measure(const SceneMirror& mirror, const Lattice& lattice, const Bound& bound,
                                               std::span<glm::dvec3> position_m, double body_radius_m) {
  const double reach_m = std::max(kReachSpacings * lattice.spacing_m(), body_radius_m + kMoreRoomM);
  const size_t cell_count = lattice.addresses().size();
  double farthest_m = bound.radius_m + kFartherSpacings * lattice.spacing_m();
  for (const glm::dvec3& p : position_m.subspan(cell_count))
    farthest_m = std::max(farthest_m, glm::distance(p, bound.center_m));
  field_.gather(mirror, bound.center_m, farthest_m * (1 + 1e-9) + reach_m, mirror.moving_slots());
  if (cells_.size() != lattice.address_count() || static_version_ != mirror.static_version() || reach_m_ != reach_m ||
      body_radius_m_ != body_radius_m)
    cells_.assign(lattice.address_count(), Cell{});
  static_version_ = mirror.static_version();
  reach_m_ = reach_m, body_radius_m_ = body_radius_m;

  tests_ = 0;
  const std::span<glm::dvec3> points_m = position_m.first(cell_count);
  // Where the last call had to leave out some, this one probably has to.
  if (!by_distance_.empty() || !measure_all(lattice, points_m)) leave_out_far_ones(lattice, bound.center_m, points_m);
  clearance_m_.resize(position_m.size());
  moved_.clear();
  for (size_t i = 0; i < cell_count; ++i) {
    clearance_m_[i] = 0;
    if (left_out_[i] != 0) continue;
    const Cell& cell = cells_[lattice.addresses()[i]];
    const glm::dvec3 place_m = position_m[i] + glm::dvec3(cell.move_m);
    const bool moves = cell.moved_clearance_m > 0 && bound.contains(place_m);
    clearance_m_[i] = moves ? cell.moved_clearance_m : cell.clearance_m;
    if (!moves) continue;
    position_m[i] = place_m;
    moved_.push_back(static_cast<uint32_t>(i));
  }
  measure_others(position_m.subspan(cell_count), std::span(clearance_m_).subspan(cell_count));
  return clearance_m_;
}

}  // namespace sightline
