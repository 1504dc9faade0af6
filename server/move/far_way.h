// The way through free space to a point far beyond the bound, for a camera that does not see its targets: A* (Hart,
// Nilsson and Raphael 1968) over a cubic grid fixed in the world.
//
// The lattice of candidates is as coarse as the bound is large. The cells of this grid can be as small as the body.
// Then a way through a door is found wherever there is one, as far as the search may look. Larger cells lead farther,
// and may miss what is narrower than they are.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "server/base/inline_vector.h"
#include "server/scene/clearance.h"

namespace sightline {

// Points of a way, the next one first, without the position where it begins.
using WayPoints = InlineVector<glm::dvec3, 32>;

// How long the camera has not seen its targets, or could see more of them, and where it goes then.
struct BlindState {
  double blind_s = 0.0;       // since it saw any of them
  double shot_gains_s = 0.0;  // for which the wanted shot has been known to show more of them
  double searched_s = 1e3;    // since the last search for a way; at first that was long ago
  WayPoints way_m;            // that it is on; empty: on none
};

struct FarWayInput {
  glm::dvec3 from_m{0.0}, to_m{0.0};
  double body_radius_m = 0.0;
  double cell_m = 0.5;      // > 0: between grid points
  double near_m = 2.0;      // the way ends this near to `to_m`, where nothing is between
  double keep_off_m = 0.5;  // and keeps this distance from it, less than near_m
};

// Memory is kept from call to call. Not thread-safe. Deterministic.
class FarWayFinder {
 public:
  static constexpr size_t kMostCells = 8000;  // examined in one search, so that it takes a few milliseconds
  // How far from where it begins a search may lead, in cells. The field must have been gathered around there with this
  // reach.
  static constexpr double kReachCells = 120.0;

  // Writes the way, or its first points where it has more corners than fit. False, and no points, if none was found or
  // needed, since `from_m` is near already.
  bool find(const ClearanceField& field, const FarWayInput& input, WayPoints& points_m);

 private:
  struct Node {
    glm::ivec3 cell{0};
    uint32_t before = 0;
    float clear_m = 0;    // to the nearest collider, at most kClearCells cells
    double length_m = 0;  // of the way to it
    bool is_settled = false;
  };
  struct Entry {
    double cost_m;
    uint32_t node;
    bool operator<(const Entry& other) const {
      return cost_m != other.cost_m ? cost_m > other.cost_m : node > other.node;
    }
  };
  void begin(const ClearanceField& field, const FarWayInput& input);
  void spread(const ClearanceField& field, const FarWayInput& input, uint32_t from);
  bool is_free(const ClearanceField& field, const FarWayInput& input, const Node& from, const Node& to,
               double leg_m) const;
  void offer(uint32_t node, uint32_t before, double length_m, const FarWayInput& input);
  static bool arrives(const ClearanceField& field, const FarWayInput& input, const glm::dvec3& at_m);
  void write(uint32_t node, WayPoints& points_m);
  // The node of a cell, made if it is new; kNone when there are kMostCells already.
  uint32_t node_of(const ClearanceField& field, const glm::ivec3& cell);

  glm::dvec3 point_m(const glm::ivec3& cell) const { return glm::dvec3(cell) * cell_m_; }

  double cell_m_ = 0.5;
  std::vector<Node> nodes_;
  std::vector<uint32_t> table_;  // hash table of nodes by cell
  std::vector<Entry> heap_;
  std::vector<uint32_t> back_;
};

}  // namespace sightline
