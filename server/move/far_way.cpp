#include "server/move/far_way.h"

#include <algorithm>
#include <cmath>

namespace sightline {
namespace {

constexpr uint32_t kNone = UINT32_MAX;
constexpr size_t kTableSize = 1 << 14;  // over kMostCells, so that probes are short
// Clearances count up to so many cells, which is more than the longest leg.
constexpr double kClearCells = 2.0;
// The radius of the way from the end to the point that must be free.
constexpr double kSight_m = 0.02;
// How much the distance that is left counts. More than 1 finds a way sooner that is at most so much longer.
constexpr double kGreed = 1.3;

static_assert(kTableSize > FarWayFinder::kMostCells * 3 / 2 && kClearCells > 1.74);

size_t hash_of(const glm::ivec3& cell) {
  uint64_t hash = static_cast<uint32_t>(cell.x) * 0x9E3779B97F4A7C15ull;
  hash = (hash ^ (hash >> 29) ^ static_cast<uint32_t>(cell.y)) * 0xBF58476D1CE4E5B9ull;
  hash = (hash ^ (hash >> 31) ^ static_cast<uint32_t>(cell.z)) * 0x94D049BB133111EBull;
  return static_cast<size_t>(hash >> 32);
}

template <typename Visit>
void for_each_beside(const glm::ivec3& cell, Visit visit) {
  for (int z = -1; z <= 1; ++z)
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x)
        if (x != 0 || y != 0 || z != 0)
          visit(cell + glm::ivec3(x, y, z), std::sqrt(static_cast<double>(x * x + y * y + z * z)));
}

}  // namespace

uint32_t FarWayFinder::node_of(const ClearanceField& field, const glm::ivec3& cell) {
  size_t at = hash_of(cell) % kTableSize;
  for (; table_[at] != kNone; at = (at + 1) % kTableSize)
    if (nodes_[table_[at]].cell == cell) return table_[at];
  if (nodes_.size() == kMostCells) return kNone;
  table_[at] = static_cast<uint32_t>(nodes_.size());
  nodes_.push_back({.cell = cell,
                    .before = kNone,
                    .clear_m = static_cast<float>(field.clearance_m(point_m(cell), kClearCells * cell_m_)),
                    .length_m = INFINITY});
  return table_[at];
}

void FarWayFinder::offer(uint32_t node, uint32_t before, double length_m, const FarWayInput& input) {
  Node& offered = nodes_[node];
  if (offered.is_settled || length_m >= offered.length_m ||
      glm::distance(point_m(offered.cell), input.to_m) < input.keep_off_m)
    return;
  offered.length_m = length_m, offered.before = before;
  heap_.push_back({length_m + kGreed * glm::distance(point_m(offered.cell), input.to_m), node});
  std::push_heap(heap_.begin(), heap_.end());
}

// The camera is on no grid point. It begins at those around it that the body can reach straight.
void FarWayFinder::begin(const ClearanceField& field, const FarWayInput& input) {
  cell_m_ = input.cell_m;
  nodes_.clear(), heap_.clear();
  // At once, so that no later step allocates. A node is hardly ever offered more than a few times.
  nodes_.reserve(kMostCells), heap_.reserve(4 * kMostCells), back_.reserve(kMostCells);
  table_.assign(kTableSize, kNone);
  const glm::ivec3 own(glm::round(input.from_m / cell_m_));
  size_t blocker = ClearanceField::kNoBlocker;
  const auto enter = [&](const glm::ivec3& cell) {
    const uint32_t node = node_of(field, cell);
    const glm::dvec3 at_m = point_m(cell);
    if (nodes_[node].clear_m < input.body_radius_m || !field.is_free(input.from_m, at_m, input.body_radius_m, blocker))
      return;
    offer(node, kNone, glm::distance(input.from_m, at_m), input);
  };
  enter(own);
  for_each_beside(own, [&](const glm::ivec3& cell, double) { enter(cell); });
}

// The balls around both ends that touch no surface hold the body on the whole leg if they overlap by its width. Only
// other legs are swept.
bool FarWayFinder::is_free(const ClearanceField& field, const FarWayInput& input, const Node& from, const Node& to,
                           double leg_m) const {
  if (to.clear_m < input.body_radius_m) return false;
  if (from.clear_m + to.clear_m >= leg_m + 2 * input.body_radius_m) return true;
  size_t blocker = ClearanceField::kNoBlocker;
  return field.is_free(point_m(from.cell), point_m(to.cell), input.body_radius_m, blocker);
}

void FarWayFinder::spread(const ClearanceField& field, const FarWayInput& input, uint32_t from) {
  const Node here = nodes_[from];
  for_each_beside(here.cell, [&](const glm::ivec3& cell, double leg_cells) {
    const double leg_m = leg_cells * cell_m_;
    if (glm::distance(point_m(cell), input.from_m) > (kReachCells - kClearCells) * cell_m_) return;
    const uint32_t node = node_of(field, cell);
    if (node == kNone || nodes_[node].is_settled || nodes_[node].length_m <= here.length_m + leg_m) return;
    if (is_free(field, input, here, nodes_[node], leg_m)) offer(node, from, here.length_m + leg_m, input);
  });
}

bool FarWayFinder::arrives(const ClearanceField& field, const FarWayInput& input, const glm::dvec3& at_m) {
  size_t blocker = ClearanceField::kNoBlocker;
  return glm::distance(at_m, input.to_m) <= input.near_m && field.is_free(at_m, input.to_m, kSight_m, blocker);
}

// Only the corners, since the camera flies straight between them.
void FarWayFinder::write(uint32_t node, WayPoints& points_m) {
  back_.clear();
  for (; node != kNone; node = nodes_[node].before) back_.push_back(node);
  for (size_t k = back_.size(); k-- > 0 && points_m.size() < WayPoints::kMost;) {
    const glm::ivec3& cell = nodes_[back_[k]].cell;
    const bool is_corner = k == 0 || k + 1 == back_.size() ||
                           nodes_[back_[k - 1]].cell - cell != cell - nodes_[back_[k + 1]].cell;
    if (is_corner) points_m.push_back(point_m(cell));
  }
}

bool FarWayFinder::find(const ClearanceField& field, const FarWayInput& input, WayPoints& points_m) {
  points_m.clear();
  if (arrives(field, input, input.from_m)) return false;
  begin(field, input);
  while (!heap_.empty()) {
    std::pop_heap(heap_.begin(), heap_.end());
    const uint32_t node = heap_.back().node;
    heap_.pop_back();
    if (nodes_[node].is_settled) continue;
    nodes_[node].is_settled = true;
    if (arrives(field, input, point_m(nodes_[node].cell))) return write(node, points_m), true;
    spread(field, input, node);
  }
  return false;
}

}  // namespace sightline
