#include "client/ceiling/places.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace sightline {
namespace {

constexpr double kLeastAdvanceM = 0.01;

uint64_t key_of(const glm::ivec3& cell) {
  constexpr int kBias = 1 << 20;
  return (static_cast<uint64_t>(cell.x + kBias) << 42) | (static_cast<uint64_t>(cell.y + kBias) << 21) |
         static_cast<uint64_t>(cell.z + kBias);
}

}  // namespace

bool sphere_passes(const EmbreeScene& colliders, std::span<const uint32_t> ignored_slots, const glm::dvec3& from_m,
                   const glm::dvec3& to_m, double radius_m) {
  const double length_m = glm::distance(from_m, to_m);
  for (double gone_m = 0;;) {
    const glm::dvec3 at_m = length_m > 0 ? glm::mix(from_m, to_m, gone_m / length_m) : from_m;
    const double reach_m = radius_m + (length_m - gone_m) + kLeastAdvanceM;
    const double room_m = colliders.nearest_surface_m(at_m, static_cast<float>(reach_m), ignored_slots) - radius_m;
    if (room_m < 0) return false;
    if (gone_m >= length_m) return true;
    gone_m = std::min(length_m, gone_m + std::max(room_m, kLeastAdvanceM));
  }
}

// A breadth-first search from the camera's start.
class PlaceGrid::Search {
 public:
  Search(PlaceGrid& grid, const EmbreeScene& colliders, std::span<const uint32_t> ignored_slots,
         const PlaceGridOptions& options)
      : grid_(grid), colliders_(colliders), ignored_slots_(ignored_slots), options_(options) {}

  void run(const glm::dvec3& start_m) {
    const uint32_t start = visit(glm::ivec3(0));
    if (start == kNoPlace || !passes(start_m, grid_.place_m_[start])) return forget();
    for (uint32_t place = 0; place < grid_.size(); ++place) link(place);
  }

 private:
  void forget() {
    grid_.place_m_.clear();
    grid_.cell_.clear();
  }

  double room_m(const glm::dvec3& point_m) const {
    const double reach_m = options_.body_m + 2 * options_.spacing_m;
    return colliders_.nearest_surface_m(point_m, static_cast<float>(reach_m), ignored_slots_) - options_.body_m;
  }

  bool passes(const glm::dvec3& from_m, const glm::dvec3& to_m) const {
    return sphere_passes(colliders_, ignored_slots_, from_m, to_m, options_.body_m);
  }

  // The place of a cell, or kNoPlace; made at the first call.
  uint32_t visit(const glm::ivec3& cell) {
    const auto [known, added] = known_.try_emplace(key_of(cell), kNoPlace);
    if (!added) return known->second;
    glm::dvec3 place_m = grid_.origin_m_ + glm::dvec3(cell) * options_.spacing_m;
    if (!options_.wanted(place_m)) return kNoPlace;
    const double most_m = find_room(place_m);
    if (most_m <= 0) return kNoPlace;
    if (grid_.size() >= options_.most_places) {
      grid_.complete_ = false;
      return kNoPlace;
    }
    known->second = static_cast<uint32_t>(grid_.size());
    grid_.place_m_.push_back(place_m);
    grid_.cell_.push_back(cell);
    room_m_.push_back(most_m);
    return known->second;
  }

  // Moves `place_m` to the roomiest point of the cell if its centre is not free. Returns the room there.
  double find_room(glm::dvec3& place_m) const {
    double most_m = room_m(place_m);
    if (most_m > 0) return most_m;
    // A cell whose surroundings are all nearer to the surface than its corners has no free point.
    if (most_m < -std::sqrt(3.0) / 3 * options_.spacing_m) return most_m;
    const glm::dvec3 center_m = place_m;
    for (int k = 0; k < 27; ++k) {
      const glm::dvec3 step(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
      const glm::dvec3 point_m = center_m + step * (options_.spacing_m / 3);
      const double room = room_m(point_m);
      if (room > most_m) most_m = room, place_m = point_m;
    }
    return most_m;
  }

  // Appends the neighbours of a place. Places are linked in their order, so the lists of the graph are complete.
  void link(uint32_t place) {
    PlaceGraph& graph = grid_.graph_;
    std::vector<std::pair<uint32_t, float>> found;
    for (int k = 0; k < 27; ++k) {
      if (k == 13) continue;
      const glm::ivec3 cell = grid_.cell_[place] + glm::ivec3(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
      const uint32_t other = visit(cell);
      if (other == kNoPlace) continue;
      const float length_m = static_cast<float>(glm::distance(grid_.place_m_[place], grid_.place_m_[other]));
      if (is_way(place, other, length_m)) found.emplace_back(other, length_m);
    }
    std::sort(found.begin(), found.end());
    for (const auto& [to, length_m] : found) {
      graph.to.push_back(to);
      graph.length_m.push_back(length_m);
    }
    graph.first.push_back(static_cast<uint32_t>(graph.to.size()));
  }

  // Returns whether the way between two places is free. Both directions are swept alike, so that the graph is
  // undirected.
  bool is_way(uint32_t a, uint32_t b, float length_m) const {
    if (room_m_[a] + room_m_[b] >= length_m) return true;
    return passes(grid_.place_m_[std::min(a, b)], grid_.place_m_[std::max(a, b)]);
  }

  PlaceGrid& grid_;
  const EmbreeScene& colliders_;
  const std::span<const uint32_t> ignored_slots_;
  const PlaceGridOptions& options_;
  std::unordered_map<uint64_t, uint32_t> known_;
  std::vector<double> room_m_;  // by place: from the body to the nearest collider
};

PlaceGrid::PlaceGrid(const EmbreeScene& colliders, std::span<const uint32_t> ignored_slots, const glm::dvec3& start_m,
                     const PlaceGridOptions& options)
    : spacing_m_(options.spacing_m), origin_m_(start_m) {
  Search(*this, colliders, ignored_slots, options).run(start_m);
  if (cell_.empty()) return;
  low_ = cell_.front();
  glm::ivec3 high = low_;
  for (const glm::ivec3& cell : cell_) low_ = glm::min(low_, cell), high = glm::max(high, cell);
  count_ = high - low_ + 1;
  index_.assign(static_cast<size_t>(count_.x) * count_.y * count_.z, kNoPlace);
  for (uint32_t place = 0; place < size(); ++place) {
    const glm::ivec3 at = cell_[place] - low_;
    index_[(static_cast<size_t>(at.z) * count_.y + at.y) * count_.x + at.x] = place;
  }
}

glm::ivec3 PlaceGrid::cell_of(const glm::dvec3& point_m) const {
  return {glm::floor((point_m - origin_m_) / spacing_m_ + 0.5)};
}

uint32_t PlaceGrid::at(const glm::ivec3& cell) const {
  const glm::ivec3 at = cell - low_;
  if (glm::any(glm::lessThan(at, glm::ivec3(0))) || glm::any(glm::greaterThanEqual(at, count_))) return kNoPlace;
  return index_[(static_cast<size_t>(at.z) * count_.y + at.y) * count_.x + at.x];
}

}  // namespace sightline
