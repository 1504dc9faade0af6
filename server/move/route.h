// Route: how the camera body gets from where it is to every candidate, round what stands in the way (design 6: never inside or
// through geometry). A straight line to the goal is often blocked by the very wall or pillar that hides the targets; the way
// round it leads through other candidates.
//
// The candidates of the lattice are the nodes; neighbours (26 of them) are joined where the body fits. What a leg costs is its
// length, more where the targets are hidden on the way, so that a detour in sight of them is preferred to a short cut behind a
// wall (Oskam et al., "Visibility Transition Planning for Dynamic Camera Control", 2009, weigh their road map alike).
// Dijkstra from the camera's own place: exact on the graph, and as far as it is asked for (move/goal.h asks for little).
#pragma once

#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "server/move/cell_box.h"

namespace sightline {

inline constexpr double kUnreachable = std::numeric_limits<double>::infinity();

// The nodes; all spans have one length.
struct RouteNodes {
  std::span<const glm::dvec3> position_m;
  std::span<const glm::ivec3> cell;    // several may share one (places off the grid)
  std::span<const float> clearance_m;  // to the nearest collider; may be cut off at twice the spacing
  std::span<const double> hidden;      // [0, 1]: what is hidden there; costs the more to pass
  // Whether the body can really go straight from the start to a node: asked where the clearances of both do not prove it, so
  // that a camera never heads for a leg that it cannot take. Empty: the clearances decide as on every other leg.
  std::function<bool(uint32_t node)> first_leg_is_free = {};
  // Of the lattice, whose cell c stands at c * spacing_m; 0: of none. It changes no answer: between nodes that stand there the
  // least length of a leg is known beforehand, and most legs need no closer look.
  double spacing_m = 0.0;
};

struct RouteSettings {
  double body_radius_m = 0.3;
  double exposure = 3.0;  // [0, 100]: a metre with all hidden costs 1 + exposure metres
};

// Memory is kept from call to call. Not thread-safe. Deterministic.
class RouteFinder {
 public:
  // Ways from node `start`, which is a node whatever its clearance. `nodes` must outlive the search, that is the last settle_next.
  // O(n), and O(log n) for each node that is settled.
  void begin(const RouteNodes& nodes, uint32_t start, const RouteSettings& settings);
  // Settles the node that is the cheapest to go to of those that are left, `start` first: what it costs, and the way, are known from
  // now on. None: no other can be reached.
  std::optional<uint32_t> settle_next();

  // What it costs to go to a settled node: metres, with what exposure adds. No less than to any that was settled before.
  double cost_m(uint32_t node) const { return cost_m_[node]; }
  bool is_settled(uint32_t node) const { return state_[node] == kSettled; }
  // Neither settled nor known to be out of reach.
  bool is_open(uint32_t node) const { return state_[node] == kOpen; }
  // The nodes from the one after `start` to `goal`, which is settled; empty for `start` itself. Valid until the next call.
  const std::vector<uint32_t>& to(uint32_t goal);

 private:
  struct Entry {
    double cost = kUnreachable;
    uint32_t node = UINT32_MAX;
    // Without a branch, which nobody could foretell.
    bool operator<(const Entry& other) const {
      return static_cast<bool>((cost < other.cost) | ((cost == other.cost) & (node < other.node)));
    }
  };
  void index(const RouteNodes& nodes, uint32_t start, double body_radius_m);
  void relax(const RouteNodes& nodes, uint32_t from);
  void try_leg(const RouteNodes& nodes, uint32_t from, uint32_t to);
  void clear_heap();
  void push(const Entry& entry);
  Entry pop();

  const RouteNodes* nodes_ = nullptr;  // of the search
  RouteSettings settings_;
  CellBox box_;
  std::vector<uint32_t> first_in_cell_, next_in_cell_;  // of the nodes that can be gone to
  // By cell: what a leg to the cell has to be cheaper than. That is its node's cost; without bound where that takes a closer look,
  // below every cost where no node is open.
  std::vector<double> open_below_m_;
  std::vector<uint8_t> on_lattice_;  // by node: alone in its cell, and where the lattice has it
  std::vector<double> cost_m_;
  std::vector<uint32_t> before_;
  enum : uint8_t { kOpen, kSettled, kNoRoom };
  std::vector<uint8_t> state_;
  std::vector<Entry> heap_;  // and four more at its end
  size_t heap_size_ = 0;
  std::vector<uint32_t> route_;
};

}  // namespace sightline
