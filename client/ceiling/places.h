// The places at which a camera's body can be: a grid of free cells that are connected to the camera's start.
#pragma once

#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "server/sample/embree_scene.h"

namespace sightline {

// An undirected graph of places. The neighbours of place i are to[first[i]] to to[first[i + 1] - 1], in ascending
// order.
struct PlaceGraph {
  std::vector<uint32_t> first{0};
  std::vector<uint32_t> to;
  std::vector<float> length_m;  // of the way to each neighbour, parallel to `to`
  size_t size() const { return first.size() - 1; }
};

struct PlaceGridOptions {
  double spacing_m = 0.5;  // > 0; edge of a cell
  double body_m = 0.31;    // > 0; radius of the sphere that must be free
  size_t most_places = 200'000;
  // Only cells whose centre passes are searched. It must pass for a finite number of cells.
  std::function<bool(const glm::dvec3& center_m)> wanted;
};

inline constexpr uint32_t kNoPlace = UINT32_MAX;

// Each cell has one place. It is the centre of the cell where the body fits there. Otherwise it is the free point with
// the most room of a 3 x 3 x 3 lattice in the cell. Neighbours are up to 26 adjacent cells to which the body can go
// straight. Moving colliders are ignored. Immutable; any number of threads may read it.
class PlaceGrid {
 public:
  // `colliders` must have taken in the scene. `ignored_slots` are the slots of the moving instances, ascending. Without
  // a free place at the start the grid has no places. A grid that would have more than `most_places` stops growing
  // there.
  PlaceGrid(const EmbreeScene& colliders, std::span<const uint32_t> ignored_slots, const glm::dvec3& start_m,
            const PlaceGridOptions& options);

  size_t size() const { return place_m_.size(); }
  bool complete() const { return complete_; }  // false: it stopped at most_places
  double spacing_m() const { return spacing_m_; }
  const glm::dvec3& place_m(uint32_t place) const { return place_m_[place]; }
  const glm::ivec3& cell(uint32_t place) const { return cell_[place]; }
  const PlaceGraph& graph() const { return graph_; }

  glm::ivec3 cell_of(const glm::dvec3& point_m) const;
  // The place of a cell; kNoPlace when it has none.
  uint32_t at(const glm::ivec3& cell) const;

 private:
  class Search;

  double spacing_m_;
  glm::dvec3 origin_m_;  // the centre of cell (0, 0, 0): the camera's start
  bool complete_ = true;
  std::vector<glm::dvec3> place_m_;
  std::vector<glm::ivec3> cell_;
  PlaceGraph graph_;
  glm::ivec3 low_{0}, count_{0};  // the box of cells in index_
  std::vector<uint32_t> index_;   // place by cell, x fastest
};

// Returns whether a sphere can go straight from one point to the other without coming nearer than its radius to a
// collider. Accurate to 1 cm.
bool sphere_passes(const EmbreeScene& colliders, std::span<const uint32_t> ignored_slots, const glm::dvec3& from_m,
                   const glm::dvec3& to_m, double radius_m);

}  // namespace sightline
