// The candidate lattice (design 4.2): a cubic lattice anchored to the world. Its points inside the bound are the
// candidates. A cell stays at the same position while the camera moves, so what was learnt about it stays true. Cells
// are addressed toroidally (index modulo the side), so nothing is copied when the bound moves.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <vector>

#include "server/aggregate/places.h"
#include "server/bound/bound.h"

namespace sightline {

// The spacing for which a ball of `radius_m` holds about `candidates` lattice points. It is rounded down to a power of
// 2^(1/4), so that small changes of the radius keep the lattice. The ball therefore holds up to 1.7 times as many
// points, and a few more or less at its surface. `last_m` is the spacing of the step before in metres, or 0 without
// one. It is kept until the radius is 4 % beyond the radii that it is for, so a radius that goes to and fro keeps its
// lattice.
double lattice_spacing_m(double radius_m, int candidates, double last_m = 0.0);

class Lattice {
 public:
  // Finds the runs of lattice points inside the bound, x fastest. A new spacing resets every cell. Data that is stored
  // by cell needs addresses, which only `cover` assigns; after the first call of `cover`, `lay` assigns them too.
  void lay(const Bound& bound, int candidates);
  // The same, and assigns an address to every cell. A cell that comes into the bound takes over the address of a cell
  // that left.
  void cover(const Bound& bound, int candidates);
  // Forgets the spacing, so that the next bound alone decides it. Called when the camera is placed anew.
  void start_again() { spacing_m_ = 0.0; }

  double spacing_m() const { return spacing_m_; }
  int side() const { return side_; }  // addresses along each axis
  size_t address_count() const { return static_cast<size_t>(side_) * side_ * side_; }

  const std::vector<PlaceRun>& runs() const { return runs_; }
  size_t size() const { return size_; }  // points in all runs

  // Positions and addresses of the points, in the order of the runs. Positions are computed at the first call.
  const std::vector<glm::dvec3>& positions_m() const;
  const std::vector<uint32_t>& addresses() const { return addresses_; }  // after `cover`

  // A number that identifies the cell that has the address; no number is used twice. Data stored under the address
  // belongs to another cell when its number differs. 0: no cell.
  uint64_t owner(uint32_t address) const { return cells_[address].owner; }
  // The address of the lattice point nearest to a position, or nothing when that point has no address.
  std::optional<uint32_t> address_near(const glm::dvec3& place_m) const;

 private:
  friend struct StateFields;  // lists its fields, to write and read them as bytes (server/session/state_fields.h)
  struct Cell {
    glm::ivec3 index{INT32_MIN};  // which lattice point owns this address
    uint64_t owner = 0;
  };
  uint32_t wrap(int index) const;
  uint32_t address_of(const glm::ivec3& index) const;
  void resize(const Bound& bound, int candidates);
  void lay_row(const Bound& bound, int first, int last, int y, int z);
  void take_addresses();
  void take_row(const PlaceRun& run, uint32_t count);

  double spacing_m_ = 0.0;
  int side_ = 0;
  std::vector<PlaceRun> runs_;
  size_t size_ = 0;
  mutable std::vector<glm::dvec3> positions_m_;
  mutable bool listed_ = false;

  bool covers_ = false;  // `cover` was called
  uint64_t owners_ = 0;  // owner numbers used so far
  std::vector<Cell> cells_;
  std::vector<uint32_t> addresses_;
};

}  // namespace sightline
