#include "server/move/route.h"

#include <algorithm>
#include <array>

namespace sightline {
namespace {

constexpr uint32_t kNone = UINT32_MAX;

// Returns whether the body fits at both ends and nothing crosses the leg. A surface that crosses the leg at a point is
// no farther from each end than that point is. The clearances of both ends then add up to no more than the leg's
// length.
bool is_free(const RouteNodes& nodes, uint32_t a, uint32_t b, double length_m, double body_m, bool from_start) {
  const double clear_a = nodes.clearance_m[a], clear_b = nodes.clearance_m[b];
  return (from_start || clear_a >= body_m) && clear_b >= body_m && clear_a + clear_b > length_m + kNoCrossingM;
}

// Returns whether the body fits along the whole first leg. Each clearance proves it for a part of the leg; only where
// the parts do not meet is the callback asked.
bool first_leg_fits(const RouteNodes& nodes, uint32_t start, uint32_t to, double length_m, double body_m) {
  if (!nodes.first_leg_is_free) return true;
  return nodes.clearance_m[start] + nodes.clearance_m[to] >= length_m + 2 * body_m || nodes.first_leg_is_free(to);
}

// A node counts as on its lattice point when it is within this share of the spacing along each axis.
constexpr double kOnLattice = 1e-6;
// The least length of a leg between two such nodes, in spacings, by how many axes it runs along.
constexpr std::array<double, 4> kLeastSteps = {0.0, 1 - 1e-5, 1.4142135623730951 - 1e-5, 1.7320508075688772 - 1e-5};

bool stands_on_lattice(const RouteNodes& nodes, uint32_t node) {
  const glm::dvec3 off = glm::abs(nodes.position_m[node] - glm::dvec3(nodes.cell[node]) * nodes.spacing_m);
  return nodes.spacing_m > 0 && std::max({off.x, off.y, off.z}) <= kOnLattice * nodes.spacing_m;
}

}  // namespace

// The start, and nodes without room for the body, are never the end of a leg, so they are entered in no cell.
void RouteFinder::index(const RouteNodes& nodes, uint32_t start, double body_radius_m) {
  box_ = box_around(nodes.cell, 1);
  const size_t count = nodes.cell.size();
  first_in_cell_.assign(box_.count(), kNone);
  open_below_m_.assign(box_.count(), -kUnreachable);
  next_in_cell_.assign(count, kNone);
  on_lattice_.assign(count, 0);
  for (uint32_t i = 0; i < count; ++i) {
    on_lattice_[i] = stands_on_lattice(nodes, i);
    if (i == start) continue;
    if (nodes.clearance_m[i] < body_radius_m) {
      state_[i] = kNoRoom;
      continue;
    }
    const size_t cell = box_.address(nodes.cell[i]);
    if (first_in_cell_[cell] != kNone) on_lattice_[i] = on_lattice_[first_in_cell_[cell]] = 0;
    next_in_cell_[i] = first_in_cell_[cell];
    first_in_cell_[cell] = i;
    open_below_m_[cell] = kUnreachable;
  }
}

void RouteFinder::try_leg(const RouteNodes& nodes, uint32_t from, uint32_t to) {
  if (state_[to] != kOpen) return;
  const bool from_start = before_[from] == kNone;
  const double length = glm::distance(nodes.position_m[from], nodes.position_m[to]);
  const double route_m = length_m_[from] + length;
  if (route_m >= length_m_[to] || !is_free(nodes, from, to, length, body_radius_m_, from_start)) return;
  if (from_start && !first_leg_fits(nodes, from, to, length, body_radius_m_)) return;
  length_m_[to] = route_m;
  before_[to] = from;
  if (on_lattice_[to]) open_below_m_[box_.address(nodes.cell[to])] = route_m;
  push({route_m, to});
}

// Skips the cells that no leg from here can improve. Floating-point operations are monotonic, so rounding never makes
// it skip a shorter leg.
void RouteFinder::relax(const RouteNodes& nodes, uint32_t from) {
  const double spacing_m = on_lattice_[from] ? nodes.spacing_m : 0.0;
  std::array<double, 4> least_m;  // by how many axes the leg runs along
  for (size_t axes = 0; axes < least_m.size(); ++axes) least_m[axes] = length_m_[from] + spacing_m * kLeastSteps[axes];
  const size_t cell = box_.address(nodes.cell[from]);
  if (on_lattice_[from] && first_in_cell_[cell] == from) open_below_m_[cell] = -kUnreachable;
  for (int z = -1; z <= 1; ++z)
    for (int y = -1; y <= 1; ++y) {
      const size_t row = cell + static_cast<size_t>(z) * box_.slice() + static_cast<size_t>(y) * box_.row();
      const size_t axes = static_cast<size_t>(z * z + y * y);
      for (int x = -1; x <= 1; ++x) {
        const size_t there = row + static_cast<size_t>(x);
        if (least_m[axes + (x != 0)] >= open_below_m_[there]) continue;
        for (uint32_t to = first_in_cell_[there]; to != kNone; to = next_in_cell_[to])
          if (to != from) try_leg(nodes, from, to);
      }
    }
}

// A heap with four children a node is half as deep as a binary one, and the children lie in one or two cache lines.
// Four entries that are greater than all others follow the last one. So every node has four children, and the least is
// found without a branch.
void RouteFinder::clear_heap() {
  heap_.assign(4, Entry{});
  heap_size_ = 0;
}

void RouteFinder::push(const Entry& entry) {
  size_t at = heap_size_++;
  heap_.push_back(Entry{});
  for (; at > 0 && entry < heap_[(at - 1) / 4]; at = (at - 1) / 4) heap_[at] = heap_[(at - 1) / 4];
  heap_[at] = entry;
}

RouteFinder::Entry RouteFinder::pop() {
  Entry* const heap = heap_.data();
  const Entry least = heap[0], last = heap[--heap_size_];
  heap[heap_size_] = Entry{};
  heap_.pop_back();
  size_t at = 0;
  for (size_t child = 1; child < heap_size_; child = 4 * at + 1) {
    const size_t left = child + (heap[child + 1] < heap[child]),
                 right = child + 2 + (heap[child + 3] < heap[child + 2]);
    const size_t smallest = left + (right - left) * (heap[right] < heap[left]);
    if (!(heap[smallest] < last)) break;
    heap[at] = heap[smallest];
    at = smallest;
  }
  if (heap_size_ > 0) heap[at] = last;
  return least;
}

void RouteFinder::begin(const RouteNodes& nodes, uint32_t start, double body_radius_m) {
  nodes_ = &nodes, body_radius_m_ = body_radius_m;
  const size_t count = nodes.position_m.size();
  length_m_.assign(count, kUnreachable);
  before_.assign(count, kNone);
  state_.assign(count, kOpen);
  index(nodes, start, body_radius_m);
  length_m_[start] = 0;
  clear_heap();
  push({0.0, start});
}

std::optional<uint32_t> RouteFinder::settle_next() {
  while (heap_size_ > 0) {
    const uint32_t node = pop().node;
    if (state_[node] != kOpen) continue;
    state_[node] = kSettled;
    relax(*nodes_, node);
    return node;
  }
  return std::nullopt;
}

const std::vector<uint32_t>& RouteFinder::to(uint32_t goal) {
  route_.clear();
  for (uint32_t node = goal; before_[node] != kNone; node = before_[node]) route_.push_back(node);
  std::reverse(route_.begin(), route_.end());
  return route_;
}

}  // namespace sightline
