// Routes from the camera's position to the candidates, round obstacles (design 6: never inside or through geometry).
// The wall or pillar that hides the targets often blocks the straight line to the goal too; the way round it leads
// through other candidates.
//
// The nodes of the graph are the candidates. A node is joined with its 26 neighbours where the camera body fits. The
// search is Dijkstra's from the camera's position. It is exact on the graph and runs only as far as the caller asks. A
// camera whose flight plan (flight_plan.h) sees no target uses it.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "server/move/cell_table.h"

namespace sightline {

// Nothing crosses a leg if the clearances of its ends add up to its length and this much more, metres. Across a wall
// that stands upright on the leg they add up to the length itself, and they are rounded to single precision.
inline constexpr double kNoCrossingM = 1e-4;

inline constexpr double kUnreachable = std::numeric_limits<double>::infinity();

// The nodes of the graph. All spans have one length.
struct RouteNodes {
  std::span<const glm::dvec3> position_m;
  std::span<const glm::ivec3> cell;  // candidates off the lattice may share a cell with others
  // to the nearest collider; may be capped at ClearanceCache::kReachSpacings spacings
  std::span<const float> clearance_m;
  // Returns whether the body can go straight from the start to a node. It is called where the clearances of both do not
  // prove that, so that the camera never heads for a leg that it cannot take. Empty: the clearances decide, as on every
  // other leg.
  std::function<bool(uint32_t node)> first_leg_is_free = {};
  // Spacing of the lattice, whose cell c is at c * spacing_m; 0: the nodes are on no lattice. It makes the search
  // faster and changes no result: the least length of a leg between lattice points is known in advance.
  double spacing_m = 0.0;
};

// Memory is kept from call to call. Not thread-safe. Deterministic.
class RouteFinder {
 public:
  // Begins a search from node `start`, which need not have room for the body. `nodes` must outlive the last call of
  // settle_next. O(n), and O(log n) for each settled node.
  void begin(const RouteNodes& nodes, uint32_t start, double body_radius_m);
  // Settles the nearest node that is left, `start` first: its route is final from now on. Empty: no other node can be
  // reached.
  std::optional<uint32_t> settle_next();

  // Length of the route to a settled node, metres. Nodes are settled in the order of their lengths.
  double length_m(uint32_t node) const { return length_m_[node]; }
  bool is_settled(uint32_t node) const { return state_[node] == kSettled; }
  // The node is neither settled nor known to be unreachable.
  bool is_open(uint32_t node) const { return state_[node] == kOpen; }
  // The nodes of the route from `start`, which is left out, to `goal`, which must be settled. Valid until the next
  // call.
  const std::vector<uint32_t>& to(uint32_t goal);

 private:
  struct Entry {
    double length_m = kUnreachable;
    uint32_t node = UINT32_MAX;
    // Branch-free, because the branch would be unpredictable.
    bool operator<(const Entry& other) const {
      return static_cast<bool>((length_m < other.length_m) | ((length_m == other.length_m) & (node < other.node)));
    }
  };
  void index(const RouteNodes& nodes, uint32_t start, double body_radius_m);
  void relax(const RouteNodes& nodes, uint32_t from);
  void try_leg(const RouteNodes& nodes, uint32_t from, uint32_t to);
  void clear_heap();
  void push(const Entry& entry);
  Entry pop();

  const RouteNodes* nodes_ = nullptr;  // of the search
  double body_radius_m_ = 0.0;
  CellBox box_;
  std::vector<uint32_t> first_in_cell_, next_in_cell_;  // of the nodes that have room for the body
  // For each cell, the length that a route to the cell must undercut. It is the length of the route to the cell's node;
  // infinity where each node of the cell has to be tried; negative where no node is open.
  std::vector<double> open_below_m_;
  std::vector<uint8_t> on_lattice_;  // by node: it is alone in its cell, and exactly on the lattice point
  std::vector<double> length_m_;
  std::vector<uint32_t> before_;
  enum : uint8_t { kOpen, kSettled, kNoRoom };
  std::vector<uint8_t> state_;
  std::vector<Entry> heap_;  // padded with four entries
  size_t heap_size_ = 0;
  std::vector<uint32_t> route_;
};

}  // namespace sightline
