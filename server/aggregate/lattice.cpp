#include "server/aggregate/lattice.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sightline {
namespace {

// Rounding makes the end of a row uncertain when it is this near to a lattice point, in spacings.
constexpr double kDoubtful = 1e-5;
// The same holds for rows whose half length is below this share of the radius, and this far from the world's origin, in
// spacings.
constexpr double kShortRow = 0.05, kFarOut = 1e7;

// Spacings are powers of 2^(1/4). A ball may become this much too small or too large for its spacing, in such steps,
// before the spacing changes.
constexpr double kStepsPerOctave = 4.0, kHeldSteps = 0.25;
// Rounding never takes a spacing that is a power itself to the next smaller one.
constexpr double kOnTheStep = 1e-9;

// The radius of a ball that has the volume of so many cells, in spacings.
double radius_in_spacings(int candidates) {
  return std::cbrt(candidates * 3.0 / (4.0 * std::numbers::pi));
}

}  // namespace

double lattice_spacing_m(double radius_m, int candidates, double last_m) {
  const double steps = kStepsPerOctave * std::log2(radius_m / radius_in_spacings(candidates)) + kOnTheStep;
  if (last_m > 0) {
    const double above = steps - kStepsPerOctave * std::log2(last_m);
    if (above >= -kHeldSteps && above < 1 + kHeldSteps) return last_m;
  }
  return std::exp2(std::floor(steps) / kStepsPerOctave);
}

// The side fits the largest ball for which the spacing is kept, so a growing ball keeps its cells.
void Lattice::resize(const Bound& bound, int candidates) {
  const double spacing_m = lattice_spacing_m(bound.radius_m, candidates, spacing_m_);
  const double largest = radius_in_spacings(candidates) * std::exp2((1 + kHeldSteps) / kStepsPerOctave);
  const int side = static_cast<int>(std::ceil(2.0 * largest)) + 1;
  if (spacing_m == spacing_m_ && side == side_) return;
  spacing_m_ = spacing_m;
  side_ = side;
  cells_.clear();
}

uint32_t Lattice::wrap(int index) const {
  const int rest = index % side_;
  return static_cast<uint32_t>(rest < 0 ? rest + side_ : rest);
}

uint32_t Lattice::address_of(const glm::ivec3& index) const {
  return (wrap(index.z) * side_ + wrap(index.y)) * side_ + wrap(index.x);
}

void Lattice::cover(const Bound& bound, int candidates) {
  covers_ = true;
  lay(bound, candidates);
}

void Lattice::lay(const Bound& bound, int candidates) {
  resize(bound, candidates);
  runs_.clear();
  size_ = 0;
  listed_ = false;
  const glm::dvec3 low = glm::ceil((bound.center_m - bound.radius_m) / spacing_m_);
  const glm::dvec3 high = glm::floor((bound.center_m + bound.radius_m) / spacing_m_);
  for (int z = static_cast<int>(low.z); z <= static_cast<int>(high.z); ++z)
    for (int y = static_cast<int>(low.y); y <= static_cast<int>(high.y); ++y)
      lay_row(bound, static_cast<int>(low.x), static_cast<int>(high.x), y, z);
  if (covers_) take_addresses();
}

// A row meets the ball in one run. The square root gives its ends; where rounding makes them uncertain, the points are
// tested.
void Lattice::lay_row(const Bound& bound, int first, int last, int y, int z) {
  const auto contains = [&](int x) { return bound.contains(glm::dvec3(x, y, z) * spacing_m_); };
  const glm::dvec2 off = glm::dvec2(y, z) * spacing_m_ - glm::dvec2(bound.center_m.y, bound.center_m.z);
  const double squared = bound.radius_m * bound.radius_m, half_squared = squared - glm::dot(off, off);
  if (half_squared < -1e-6 * squared) return;
  const double half_m = std::sqrt(std::max(0.0, half_squared));
  const double from = (bound.center_m.x - half_m) / spacing_m_, to = (bound.center_m.x + half_m) / spacing_m_;
  const double low = std::ceil(from - kDoubtful), high = std::floor(to + kDoubtful);
  const bool clear = half_squared > kShortRow * kShortRow * squared &&
                     std::max(std::abs(from), std::abs(to)) < kFarOut && low - from > kDoubtful &&
                     to - high > kDoubtful;
  if (clear) {
    first = static_cast<int>(low), last = static_cast<int>(high);
  } else {
    first = std::max(first, static_cast<int>(std::floor(from)) - 1);
    last = std::min(last, static_cast<int>(std::ceil(to)) + 1);
    while (first <= last && !contains(first)) ++first;
    while (first <= last && !contains(last)) --last;
  }
  if (first > last) return;
  runs_.push_back({{first, y, z}, static_cast<uint32_t>(size_)});
  size_ += static_cast<size_t>(last - first + 1);
}

void Lattice::take_addresses() {
  cells_.resize(address_count());
  addresses_.clear();
  for (size_t k = 0; k < runs_.size(); ++k)
    take_row(runs_[k], static_cast<uint32_t>((k + 1 < runs_.size() ? runs_[k + 1].first : size_) - runs_[k].first));
}

void Lattice::take_row(const PlaceRun& run, uint32_t count) {
  const uint32_t row = (wrap(run.cell.z) * side_ + wrap(run.cell.y)) * side_;
  uint32_t column = wrap(run.cell.x);
  glm::ivec3 index = run.cell;
  for (uint32_t k = 0; k < count; ++k, ++index.x) {
    const uint32_t address = row + column;
    column = column + 1 == static_cast<uint32_t>(side_) ? 0 : column + 1;
    if (cells_[address].index != index) cells_[address] = Cell{index, ++owners_};
    addresses_.push_back(address);
  }
}

const std::vector<glm::dvec3>& Lattice::positions_m() const {
  if (!listed_) list_places({spacing_m_, runs_, size_, {}}, positions_m_);
  listed_ = true;
  return positions_m_;
}

std::optional<uint32_t> Lattice::address_near(const glm::dvec3& place_m) const {
  if (cells_.empty()) return std::nullopt;
  const glm::ivec3 index(glm::round(place_m / spacing_m_));
  const uint32_t address = address_of(index);
  if (cells_[address].index != index) return std::nullopt;
  return address;
}

}  // namespace sightline
