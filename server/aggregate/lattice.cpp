#include "server/aggregate/lattice.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline {

double lattice_spacing_m(double radius_m, int candidates) {
  const double volume = 4.0 / 3.0 * std::numbers::pi * radius_m * radius_m * radius_m;
  const double wanted = std::cbrt(volume / candidates);
  return std::exp2(std::floor(std::log2(wanted) * 4.0 + 1e-9) / 4.0);
}

void Lattice::resize(double spacing_m, int side) {
  if (spacing_m == spacing_m_ && side <= side_) return;
  // A larger side at the same spacing happens only when rounding adds a layer: forgetting then is harmless and rare.
  spacing_m_ = spacing_m;
  side_ = side;
  cells_.assign(static_cast<size_t>(side) * side * side, Cell{});
}

uint32_t Lattice::wrap(int index) const {
  const int rest = index % side_;
  return static_cast<uint32_t>(rest < 0 ? rest + side_ : rest);
}

uint32_t Lattice::address_of(const glm::ivec3& index) const {
  return (wrap(index.z) * side_ + wrap(index.y)) * side_ + wrap(index.x);
}

void Lattice::cover(const Bound& bound, int candidates) {
  const double spacing = lattice_spacing_m(bound.radius_m, candidates);
  resize(spacing, static_cast<int>(std::ceil(2.0 * bound.radius_m / spacing)) + 1);
  positions_m_.clear();
  addresses_.clear();
  const glm::dvec3 low = glm::ceil((bound.center_m - bound.radius_m) / spacing);
  const glm::dvec3 high = glm::floor((bound.center_m + bound.radius_m) / spacing);
  for (int z = static_cast<int>(low.z); z <= static_cast<int>(high.z); ++z)
    for (int y = static_cast<int>(low.y); y <= static_cast<int>(high.y); ++y)
      cover_row(bound, static_cast<int>(low.x), static_cast<int>(high.x), y, z);
}

// A row meets the ball in one run. Only its ends have to be looked for: the root tells where, to within a cell.
void Lattice::cover_row(const Bound& bound, int first, int last, int y, int z) {
  const auto contains = [&](int x) { return bound.contains(glm::dvec3(x, y, z) * spacing_m_); };
  const glm::dvec2 off = glm::dvec2(y, z) * spacing_m_ - glm::dvec2(bound.center_m.y, bound.center_m.z);
  const double half_squared = bound.radius_m * bound.radius_m - glm::dot(off, off);
  if (half_squared < -1e-6 * bound.radius_m * bound.radius_m) return;
  const double half_m = std::sqrt(std::max(0.0, half_squared));
  first = std::max(first, static_cast<int>(std::floor((bound.center_m.x - half_m) / spacing_m_)) - 1);
  last = std::min(last, static_cast<int>(std::ceil((bound.center_m.x + half_m) / spacing_m_)) + 1);
  while (first <= last && !contains(first)) ++first;
  while (first <= last && !contains(last)) --last;
  if (first > last) return;
  const uint32_t row = (wrap(z) * side_ + wrap(y)) * side_;
  uint32_t column = wrap(first);
  for (int x = first; x <= last; ++x) {
    const uint32_t address = row + column;
    column = column + 1 == static_cast<uint32_t>(side_) ? 0 : column + 1;
    if (cells_[address].index != glm::ivec3(x, y, z)) cells_[address] = Cell{{x, y, z}, 0, 0, ++owners_};
    positions_m_.push_back(glm::dvec3(x, y, z) * spacing_m_);
    addresses_.push_back(address);
  }
}

std::optional<uint32_t> Lattice::address_near(const glm::dvec3& place_m) const {
  if (cells_.empty()) return std::nullopt;
  const glm::ivec3 index(glm::round(place_m / spacing_m_));
  const uint32_t address = address_of(index);
  if (cells_[address].index != index) return std::nullopt;
  return address;
}

void Lattice::remember(const std::vector<uint32_t>& visible_targets) {
  for (size_t i = 0; i < addresses_.size(); ++i) {
    Cell& cell = cells_[addresses_[i]];
    cell.visible_targets = visible_targets[i];
    ++cell.steps_known;
  }
}

}  // namespace sightline
