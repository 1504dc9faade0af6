// The candidate lattice (design 4.2): a cubic lattice anchored to the world, of which the bound selects the points
// inside its ball. Anchored to the world, a cell is the same place while the camera moves, so what was learnt about it
// stays true; cells are addressed toroidally (index modulo the side), so moving the bound copies nothing.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <vector>

#include "server/aggregate/places.h"
#include "server/bound/bound.h"

namespace sightline {

// Spacing for which a ball of `radius_m` holds about `candidates` lattice points, rounded down to a step of 2^(1/4), so
// that small changes of the radius keep the lattice. The ball then holds between 1 and 1.7 times as many, give or
// take the lattice points on its surface.
double lattice_spacing_m(double radius_m, int candidates);

class Lattice {
 public:
  // Lays the lattice over the bound: the runs of the points inside it, x fastest. A new spacing forgets every cell. What is stored by
  // cell needs `cover`; once it was called, `lay` does the same.
  void lay(const Bound& bound, int candidates);
  // The same, and gives every cell its address. A cell that came into the bound at another cell's address takes it over.
  void cover(const Bound& bound, int candidates);

  double spacing_m() const { return spacing_m_; }
  int side() const { return side_; }  // addresses along each axis
  size_t address_count() const { return static_cast<size_t>(side_) * side_ * side_; }

  const std::vector<PlaceRun>& runs() const { return runs_; }
  size_t size() const { return size_; }  // points in all runs

  // Of the points, in the order of the runs. Positions are listed when they are first asked for.
  const std::vector<glm::dvec3>& positions_m() const;
  const std::vector<uint32_t>& addresses() const { return addresses_; }  // after `cover`

  // A number that the cell got when the address became its own, never given twice: what was stored by address elsewhere
  // belongs to another cell when the number differs. 0: nobody's.
  uint64_t owner(uint32_t address) const { return cells_[address].owner; }
  // The address of the lattice point nearest to a place, while the address is still that point's.
  std::optional<uint32_t> address_near(const glm::dvec3& place_m) const;

 private:
  struct Cell {
    glm::ivec3 index{INT32_MIN};  // which lattice point owns this address
    uint64_t owner = 0;
  };
  uint32_t wrap(int index) const;
  uint32_t address_of(const glm::ivec3& index) const;
  void resize(double spacing_m, int side);
  void lay_row(const Bound& bound, int first, int last, int y, int z);
  void take_addresses();
  void take_row(const PlaceRun& run, uint32_t count);

  double spacing_m_ = 0.0;
  int side_ = 0;
  std::vector<PlaceRun> runs_;
  size_t size_ = 0;
  mutable std::vector<glm::dvec3> positions_m_;
  mutable bool listed_ = false;

  bool covers_ = false;  // has been asked to
  uint64_t owners_ = 0;  // numbers given so far
  std::vector<Cell> cells_;
  std::vector<uint32_t> addresses_;
};

}  // namespace sightline
