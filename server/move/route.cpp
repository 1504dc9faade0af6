#include "server/move/route.h"

#include <algorithm>
#include <functional>

namespace sightline {
namespace {

constexpr uint32_t kNone = UINT32_MAX;

// The body fits at both ends, and nothing crosses the leg: a surface that crosses it at a point is no farther from the ends
// than that point, so the clearances then sum up to no more than the leg's length.
bool is_free(const RouteNodes& nodes, uint32_t a, uint32_t b, double length_m, double body_m,
             bool from_start) {
  const double clear_a = nodes.clearance_m[a], clear_b = nodes.clearance_m[b];
  return (from_start || clear_a >= body_m) && clear_b >= body_m && clear_a + clear_b > length_m;
}

// Round both ends there is room for the body as far as they reach: where they meet it fits all the way.
bool first_leg_fits(const RouteNodes& nodes, uint32_t start, uint32_t to, double length_m, double body_m) {
  if (!nodes.first_leg_is_free) return true;
  return nodes.clearance_m[start] + nodes.clearance_m[to] >= length_m + 2 * body_m ||
         nodes.first_leg_is_free(to);
}

}  // namespace

void RouteFinder::index(std::span<const glm::ivec3> cell) {
  glm::ivec3 low = cell[0], high = cell[0];
  for (const glm::ivec3& c : cell) low = glm::min(low, c), high = glm::max(high, c);
  low_ = low - 1;
  size_ = high - low + 3;  // a rim of empty cells, so that neighbours need no test
  first_in_slot_.assign(
      static_cast<size_t>(size_.x) * static_cast<size_t>(size_.y) * static_cast<size_t>(size_.z), kNone);
  next_in_cell_.resize(cell.size());
  for (uint32_t i = 0; i < cell.size(); ++i) {
    uint32_t& first = first_in_slot_[slot_of(cell[i])];
    next_in_cell_[i] = first;
    first = i;
  }
}

size_t RouteFinder::slot_of(const glm::ivec3& cell) const {
  const glm::ivec3 at = cell - low_;
  return (static_cast<size_t>(at.z) * static_cast<size_t>(size_.y) + static_cast<size_t>(at.y)) *
             static_cast<size_t>(size_.x) +
         static_cast<size_t>(at.x);
}

void RouteFinder::relax(const RouteNodes& nodes, const RouteSettings& settings, uint32_t from) {
  const bool from_start = before_[from] == kNone;
  for (int z = -1; z <= 1; ++z)
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x)
        for (uint32_t to = first_in_slot_[slot_of(nodes.cell[from] + glm::ivec3(x, y, z))]; to != kNone;
             to = next_in_cell_[to]) {
          if (done_[to] || to == from) continue;
          const double length = glm::distance(nodes.position_m[from], nodes.position_m[to]);
          const double cost =
              cost_m_[from] + length * (1 + settings.exposure * (nodes.hidden[from] + nodes.hidden[to]) / 2);
          if (cost >= cost_m_[to] || !is_free(nodes, from, to, length, settings.body_radius_m, from_start))
            continue;
          if (from_start && !first_leg_fits(nodes, from, to, length, settings.body_radius_m)) continue;
          cost_m_[to] = cost;
          before_[to] = from;
          heap_.push_back({cost, to});
          std::push_heap(heap_.begin(), heap_.end(), std::greater<>());
        }
}

void RouteFinder::find(const RouteNodes& nodes, uint32_t start, const RouteSettings& settings) {
  const size_t count = nodes.position_m.size();
  index(nodes.cell);
  cost_m_.assign(count, kUnreachable);
  before_.assign(count, kNone);
  done_.assign(count, 0);
  cost_m_[start] = 0;
  heap_.assign(1, {0.0, start});
  while (!heap_.empty()) {
    std::pop_heap(heap_.begin(), heap_.end(), std::greater<>());
    const uint32_t node = heap_.back().node;
    heap_.pop_back();
    if (done_[node]) continue;
    done_[node] = 1;
    relax(nodes, settings, node);
  }
}

const std::vector<uint32_t>& RouteFinder::to(uint32_t goal) {
  route_.clear();
  for (uint32_t node = goal; before_[node] != kNone; node = before_[node]) route_.push_back(node);
  std::reverse(route_.begin(), route_.end());
  return route_;
}

}  // namespace sightline
