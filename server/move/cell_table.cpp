#include "server/move/cell_table.h"

#include <algorithm>
#include <bit>
#include <cassert>

namespace sightline {
namespace {

uint32_t hash_cell(const glm::ivec3& c) {
  uint64_t h = static_cast<uint32_t>(c.x) * 0x9E3779B97F4A7C15ull;
  h = (h ^ (h >> 29) ^ static_cast<uint32_t>(c.y)) * 0xBF58476D1CE4E5B9ull;
  h = (h ^ (h >> 31) ^ static_cast<uint32_t>(c.z)) * 0x94D049BB133111EBull;
  return static_cast<uint32_t>(h >> 32);
}

// The box around the cells and one cell more on every side, where a table over it is of the order of their number.
std::optional<CellBox> compact_box(std::span<const glm::ivec3> cell) {
  if (cell.empty()) return std::nullopt;
  glm::ivec3 low = cell[0], high = cell[0];
  for (const glm::ivec3& c : cell) low = glm::min(low, c), high = glm::max(high, c);
  const glm::dvec3 size = glm::dvec3(high) - glm::dvec3(low) + 3.0;
  if (size.x * size.y * size.z > 16.0 * static_cast<double>(cell.size()) + 4096) return std::nullopt;
  return CellBox{low - 1, high - low + 3};
}

}  // namespace

void lattice_cells(const PlaceView& places, double spacing_m, std::vector<glm::ivec3>& cells) {
  assert(spacing_m > 0 && (places.in_runs() == 0 || places.spacing_m() == spacing_m));
  cells.resize(places.size());
  for (size_t run = 0; run < places.runs().size(); ++run) {
    glm::ivec3 cell = places.runs()[run].cell;
    for (size_t i = places.runs()[run].first; i < places.end_of_run(run); ++i, ++cell.x) cells[i] = cell;
  }
  for (size_t k = 0; k < places.singles_m().size(); ++k)
    cells[places.in_runs() + k] = glm::ivec3(glm::round(places.singles_m()[k] / spacing_m));
}

void CellTable::clear(std::span<const glm::ivec3> cell) {
  cell_ = cell;
  box_ = compact_box(cell);
  slots_.assign(box_ ? box_->count() : std::bit_ceil(std::max<size_t>(2 * cell.size(), 8)), -1);
}

size_t CellTable::hashed(const glm::ivec3& cell) const {
  const size_t mask = slots_.size() - 1;
  size_t k = hash_cell(cell) & mask;
  while (slots_[k] >= 0 && cell_[static_cast<size_t>(slots_[k])] != cell) k = (k + 1) & mask;
  return k;
}

}  // namespace sightline
