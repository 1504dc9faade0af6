#include "client/check/walkable.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "client/check/level_facts.h"
#include "server/sample/embree_scene.h"

namespace sightline {
namespace {

constexpr double kCellM = 0.5, kMostM = 100.0;
constexpr double kMostStepM = 0.5;  // up or down between neighbours
constexpr double kHeadroomM = 2.0;
constexpr float kClearanceM = 0.36f;  // half of the way between diagonal neighbours, so that no wall fits between
constexpr float kFloorNormal = 0.7f;  // a slope of up to 45 degrees
constexpr int kMostStoreys = 16;
constexpr double kNearlyAsLarge = 0.4;  // of the largest set
constexpr float kFar = 1e4f;

// A place before its neighbours are known.
struct Cell {
  int x = 0, z = 0;
  double height_m = 0.0;
};

class Grid {
 public:
  explicit Grid(const Level& level) : level_(level), scene_(device_, EmbreeScene::Content::kColliders) {
    scene_.take_in(*level.mirror);
    for (uint32_t slot = 0; slot < level.actors.size(); ++slot) moving_.push_back(slot);
    filter_.ignored_slots = moving_;
    const LevelFacts facts = facts_of(level);
    const glm::dvec3 middle = 0.5 * (facts.min_m + facts.max_m), half = 0.5 * facts.size_m();
    columns_ = static_cast<int>(std::min(2.0 * half.x, kMostM) / kCellM);
    rows_ = static_cast<int>(std::min(2.0 * half.z, kMostM) / kCellM);
    first_m_ = middle - 0.5 * kCellM * glm::dvec3(columns_ - 1, 0, rows_ - 1);
    top_m_ = facts.max_m.y + 1.0;
    first_in_column_.assign(static_cast<size_t>(columns_ * rows_) + 1, 0);
  }

  std::vector<StandingPlace> places() {
    for (int z = 0; z < rows_; ++z)
      for (int x = 0; x < columns_; ++x) {
        add_column(x, z);
        first_in_column_[static_cast<size_t>(z * columns_ + x) + 1] = cells_.size();
      }
    std::vector<StandingPlace> places;
    for (const Cell& cell : cells_) places.push_back({foot_m(cell), neighbours_of(cell)});
    drop_one_way(places);
    return places;
  }

 private:
  // On a saddle, a diagonal step can be allowed from one end alone, and of two floors one above the other each place
  // knows the upper one. Such steps would join places that are not connected.
  static void drop_one_way(std::vector<StandingPlace>& places) {
    const std::vector<StandingPlace> all = places;
    for (uint32_t i = 0; i < places.size(); ++i)
      std::erase_if(places[i].neighbours, [&](uint32_t other) {
        return std::ranges::find(all[other].neighbours, i) == all[other].neighbours.end();
      });
  }

  glm::dvec3 foot_m(const Cell& cell) const {
    return {first_m_.x + kCellM * cell.x, cell.height_m, first_m_.z + kCellM * cell.z};
  }

  // Every floor below a point, from the top down.
  void add_column(int x, int z) {
    double from_m = top_m_;
    for (int storey = 0; storey < kMostStoreys; ++storey) {
      const glm::dvec3 origin = foot_m({x, z, from_m});
      const RayHit hit = scene_.trace(origin, {0, -1, 0}, 0.0f, kFar, filter_);
      if (hit.slot == UINT32_MAX) return;
      from_m -= static_cast<double>(hit.distance_m) + 1e-3;
      const Cell cell{x, z, from_m + 1e-3};
      if (std::abs(glm::normalize(hit.normal).y) > kFloorNormal && has_room(foot_m(cell))) cells_.push_back(cell);
    }
  }

  bool has_room(const glm::dvec3& foot) const {
    if (scene_.is_blocked(foot + glm::dvec3(0, 0.01, 0), {0, 1, 0}, 0.0f, static_cast<float>(kHeadroomM), filter_))
      return false;
    return std::ranges::all_of(std::array{0.45, 0.9, 1.45}, [&](double height_m) {
      return scene_.nearest_surface_m(foot + glm::dvec3(0, height_m, 0), kClearanceM, moving_) >= kClearanceM;
    });
  }

  std::optional<uint32_t> step(const Cell& from, int dx, int dz) const {
    const int x = from.x + dx, z = from.z + dz;
    if (x < 0 || z < 0 || x >= columns_ || z >= rows_) return std::nullopt;
    const auto column = static_cast<size_t>(z * columns_ + x);
    for (size_t i = first_in_column_[column]; i < first_in_column_[column + 1]; ++i)
      if (std::abs(cells_[i].height_m - from.height_m) <= kMostStepM) return static_cast<uint32_t>(i);
    return std::nullopt;
  }

  // A diagonal step needs both places beside it, so that it passes no corner.
  std::vector<uint32_t> neighbours_of(const Cell& cell) const {
    std::vector<uint32_t> found;
    for (const int dx : {-1, 0, 1})
      for (const int dz : {-1, 0, 1}) {
        if ((dx == 0 && dz == 0) || (dx != 0 && dz != 0 && !(step(cell, dx, 0) && step(cell, 0, dz)))) continue;
        if (const auto other = step(cell, dx, dz)) found.push_back(*other);
      }
    return found;
  }

  const Level& level_;
  EmbreeDevice device_;
  EmbreeScene scene_;
  std::vector<uint32_t> moving_;
  RayFilter filter_;
  int columns_ = 0, rows_ = 0;
  glm::dvec3 first_m_{0.0};
  double top_m_ = 0.0;
  std::vector<Cell> cells_;
  std::vector<size_t> first_in_column_;  // by column, and the end
};

struct Component {
  std::vector<uint32_t> places;
  double height_m = 0.0;  // mean
};

std::vector<Component> components_of(const std::vector<StandingPlace>& places) {
  std::vector<Component> components;
  std::vector<bool> seen(places.size(), false);
  for (uint32_t start = 0; start < places.size(); ++start) {
    if (seen[start]) continue;
    Component& component = components.emplace_back();
    component.places.push_back(start), seen[start] = true;
    for (size_t next = 0; next < component.places.size(); ++next) {
      const StandingPlace& place = places[component.places[next]];
      component.height_m += place.foot_m.y;
      for (const uint32_t other : place.neighbours)
        if (!seen[other]) component.places.push_back(other), seen[other] = true;
    }
    component.height_m /= static_cast<double>(component.places.size());
  }
  return components;
}

}  // namespace

std::vector<StandingPlace> standing_places(const Level& level) {
  const std::vector<StandingPlace> all = Grid(level).places();
  const std::vector<Component> components = components_of(all);
  size_t largest = 0;
  for (const Component& component : components) largest = std::max(largest, component.places.size());
  const Component* chosen = nullptr;
  for (const Component& component : components)
    if (static_cast<double>(component.places.size()) >= kNearlyAsLarge * static_cast<double>(largest) &&
        (!chosen || component.height_m < chosen->height_m))
      chosen = &component;
  if (!chosen) return {};
  std::vector<uint32_t> renumbered(all.size(), 0);
  for (uint32_t i = 0; i < chosen->places.size(); ++i) renumbered[chosen->places[i]] = i;
  std::vector<StandingPlace> kept;
  for (const uint32_t index : chosen->places) {
    kept.push_back(all[index]);
    for (uint32_t& neighbour : kept.back().neighbours) neighbour = renumbered[neighbour];
  }
  return kept;
}

}  // namespace sightline
