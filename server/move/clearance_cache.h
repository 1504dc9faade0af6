// The place of each candidate where the body fits, and its clearance from static colliders, found once for each lattice
// cell. The lattice is anchored to the world, so both stay valid while the cell is in the bound.
//
// The points of a lattice may all miss an opening that the body fits through: a doorway is often only a few decimetres
// wider or higher than a camera needs. So where the body does not fit at a cell's point, the place is moved off the
// nearest surfaces, until it fits.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <utility>
#include <vector>

#include "server/aggregate/lattice.h"
#include "server/scene/clearance.h"

namespace sightline {

class ClearanceCache {
 public:
  // A place is moved by at most this many lattice spacings, so that it stays in its cell.
  static constexpr double kFartherSpacings = 0.5;
  // Clearances count up to this many lattice spacings, a little more than the longest leg between the lattice's points.
  // So where one end of a leg is near a surface, the clearance of the other still shows whether the surface may cross
  // the leg (kNoCrossingM in flight_plan.cpp). A first step measures all cells, so a longer reach makes that step
  // longer.
  static constexpr double kReachSpacings = 1.75;

  // Distance in metres from each candidate to the nearest static collider, capped at kReachSpacings lattice spacings,
  // or at `body_radius_m` + 0.15 m if that is more. The first candidates are the lattice's covered cells in its order,
  // and are cached. All others are measured in each call. A body of another radius empties the cache. `position_m`: of
  // the candidates. The cells' positions are changed where the body does not fit there but near it; a straight free way
  // leads there, and the clearance is that of the new position. A position never leaves the bound. The result is valid
  // until the next call. Only cells that are new to the bound cost time.
  //
  // The work is bounded, in tests that are counted (ClearanceField::tests). A cell that takes more than kTestsOfCell
  // has no room. Where all cells together take more than kTestsOfLattice and kTestsOfCells for each, those farthest
  // from the bound's middle have none. What other steps measured counts as if it were measured again, so the result
  // depends on the mirror and the bound alone. In eight of our scenes no cell took more than 1,213.
  static constexpr uint64_t kTestsOfCell = 10'000, kTestsOfCells = 1'000, kTestsOfLattice = 100'000;
  std::span<const float> measure(const SceneMirror& mirror, const Lattice& lattice, const Bound& bound,
                                 std::span<glm::dvec3> position_m, double body_radius_m);
  // The tests that the last call took.
  uint64_t tests() const { return tests_; }
  // The candidates whose positions the last call changed, ascending.
  std::span<const uint32_t> moved() const { return moved_; }

 private:
  struct Cell {
    uint64_t owner = 0;           // Lattice::owner of the address when it was measured
    float clearance_m = 0;        // of the lattice's point
    float moved_clearance_m = 0;  // of the place where the body fits; 0: there is none, or it is the lattice's point
    glm::vec3 move_m{0.0f};       // from the lattice's point to that place
    uint32_t tests = 0;           // that it took
  };
  Cell measure_cell(const glm::dvec3& point_m, double spacing_m);
  const Cell& cell_at(const Lattice& lattice, size_t i, const glm::dvec3& point_m);
  bool measure_all(const Lattice& lattice, std::span<const glm::dvec3> point_m);
  void leave_out_far_ones(const Lattice& lattice, const glm::dvec3& middle_m, std::span<const glm::dvec3> point_m);
  void measure_others(std::span<const glm::dvec3> position_m, std::span<float> clearance_m);

  ClearanceField field_;
  std::vector<Cell> cells_;
  uint64_t static_version_ = 0;
  double reach_m_ = 0, body_radius_m_ = 0;  // with which the cells were measured
  std::vector<float> clearance_m_;
  std::vector<uint32_t> moved_;
  std::vector<uint8_t> left_out_;  // by cell: 1 if it counts as one without room, because it would take too many tests
  std::vector<std::pair<double, uint32_t>> by_distance_;  // of the cells, if the last call had to leave out some
  uint64_t tests_ = 0;
};

}  // namespace sightline
