// Depth is the exact Euclidean distance transform of Meijster, Roerdink & Hesselink, "A general algorithm for
// computing distance transforms in linear time" (2000): one pass an axis, each the lower envelope of
// parabolas along a line. A run of members ends at cells of distance 0, beyond which no parabola can be
// lower, so each run is a problem of its own and no dense grid around the candidates is needed: they may be
// scattered.
#include "server/move/groups.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>

namespace sightline {
namespace {

constexpr int64_t kFar = int64_t{1} << 40;  // larger than any squared distance on a run, far from overflow

uint32_t hash_cell(const glm::ivec3& c) {
  uint64_t h = static_cast<uint32_t>(c.x) * 0x9E3779B97F4A7C15ull;
  h = (h ^ (h >> 29) ^ static_cast<uint32_t>(c.y)) * 0xBF58476D1CE4E5B9ull;
  h = (h ^ (h >> 31) ^ static_cast<uint32_t>(c.z)) * 0x94D049BB133111EBull;
  return static_cast<uint32_t>(h >> 32);
}

class Finder {
 public:
  Finder(std::span<const glm::ivec3> cell, std::span<const uint8_t> member, GroupScratch& scratch,
         Groups& groups)
      : cell_(cell), member_(member), s_(scratch), g_(groups) {}

  void index_cells() {
    const size_t n = cell_.size();
    s_.slots.assign(std::bit_ceil(std::max<size_t>(2 * n, 8)), -1);
    s_.first_in_cell.resize(n);
    for (size_t i = 0; i < n; ++i) {
      int32_t& slot = slot_of(cell_[i]);
      if (slot < 0) slot = static_cast<int32_t>(i);
      s_.first_in_cell[i] = slot;
    }
  }

  void link_neighbours() {
    s_.beside.resize(cell_.size());
    for (size_t i = 0; i < cell_.size(); ++i) {
      if (!owns_member_cell(i)) continue;
      for (int side = 0; side < 6; ++side) {
        glm::ivec3 at = cell_[i];
        at[side / 2] += side % 2 == 0 ? -1 : 1;
        const int32_t other = slot_of(at);
        s_.beside[i][side] = other >= 0 && member_[other] ? other : -1;
      }
    }
  }

  void flood_all() {
    g_.size_cells.clear();
    g_.group_of.assign(cell_.size(), kNoGroup);
    for (size_t i = 0; i < cell_.size(); ++i)
      if (owns_member_cell(i) && g_.group_of[i] == kNoGroup) flood(static_cast<int32_t>(i));
  }

  void measure_depth() {
    s_.distance.resize(cell_.size());
    for (size_t i = 0; i < cell_.size(); ++i) s_.distance[i] = owns_member_cell(i) ? kFar : 0;
    for (int axis = 0; axis < 3; ++axis)
      for (size_t i = 0; i < cell_.size(); ++i)
        if (owns_member_cell(i) && s_.beside[i][2 * axis] < 0) transform_run(static_cast<int32_t>(i), axis);
  }

  // Gives every member what its cell has: no group and no depth where the first candidate of the cell is no
  // member.
  void share_out() {
    g_.depth_squared.assign(cell_.size(), 0);
    g_.max_depth_squared = 0;
    for (size_t i = 0; i < cell_.size(); ++i) {
      const int32_t first = s_.first_in_cell[i];
      if (!member_[i]) continue;
      g_.group_of[i] = g_.group_of[first];
      g_.depth_squared[i] = static_cast<uint32_t>(s_.distance[first]);
      g_.max_depth_squared = std::max(g_.max_depth_squared, g_.depth_squared[i]);
    }
  }

 private:
  bool owns_member_cell(size_t i) const {
    return member_[i] && s_.first_in_cell[i] == static_cast<int32_t>(i);
  }

  // The slot that holds the cell's first candidate, or the free one where it would be put.
  int32_t& slot_of(const glm::ivec3& cell) {
    const size_t mask = s_.slots.size() - 1;
    size_t k = hash_cell(cell) & mask;
    while (s_.slots[k] >= 0 && cell_[s_.slots[k]] != cell) k = (k + 1) & mask;
    return s_.slots[k];
  }

  void flood(int32_t from) {
    const auto group = static_cast<int32_t>(g_.size_cells.size());
    s_.queue.assign(1, from);
    g_.group_of[from] = group;
    for (size_t head = 0; head < s_.queue.size(); ++head) {
      for (const int32_t next : s_.beside[s_.queue[head]]) {
        if (next < 0 || g_.group_of[next] != kNoGroup) continue;
        g_.group_of[next] = group;
        s_.queue.push_back(next);
      }
    }
    g_.size_cells.push_back(static_cast<uint32_t>(s_.queue.size()));
  }

  // One axis of the transform for the run of members that begins at `first`. On the line, place 0 and the
  // last place are the cells of distance 0 that bound the run.
  void transform_run(int32_t first, int axis) {
    s_.run.clear();
    s_.line.assign(1, 0);
    for (int32_t i = first; i >= 0; i = s_.beside[i][2 * axis + 1]) {
      s_.run.push_back(i);
      s_.line.push_back(s_.distance[i]);
    }
    s_.line.push_back(0);
    const int top = lower_envelope();
    for (int u = static_cast<int>(s_.run.size()), q = top; u >= 1; --u) {
      while (s_.start[q] > u) --q;
      s_.distance[s_.run[u - 1]] = parabola(s_.source[q], u);
    }
  }

  int64_t parabola(int64_t source, int64_t at) const {
    return (at - source) * (at - source) + s_.line[source];
  }

  // source[k] is the lowest parabola from place start[k] up to start[k + 1]; returns the last k.
  int lower_envelope() {
    const int n = static_cast<int>(s_.line.size());
    s_.source.assign(1, 0);
    s_.start.assign(1, 0);
    for (int u = 1; u < n; ++u) {
      while (!s_.source.empty() && parabola(s_.source.back(), s_.start.back()) > parabola(u, s_.start.back()))
        s_.source.pop_back(), s_.start.pop_back();
      const int64_t begin = s_.source.empty() ? 0 : 1 + last_place_below(s_.source.back(), u);
      if (begin >= n) continue;
      s_.source.push_back(u);
      s_.start.push_back(static_cast<int32_t>(begin));
    }
    return static_cast<int>(s_.source.size()) - 1;
  }

  // The last place at which the parabola of `a` is no higher than that of b > a.
  int64_t last_place_below(int64_t a, int64_t b) const {
    return (b * b - a * a + s_.line[b] - s_.line[a]) / (2 * (b - a));
  }

  std::span<const glm::ivec3> cell_;
  std::span<const uint8_t> member_;
  GroupScratch& s_;
  Groups& g_;
};

int32_t choose_largest(std::span<const glm::dvec3> position_m, const glm::dvec3& desired_m,
                       std::vector<double>& nearest_m, const Groups& g) {
  nearest_m.assign(g.size_cells.size(), std::numeric_limits<double>::infinity());
  for (size_t i = 0; i < position_m.size(); ++i) {
    if (g.group_of[i] == kNoGroup) continue;
    double& nearest = nearest_m[g.group_of[i]];
    nearest = std::min(nearest, glm::distance(position_m[i], desired_m));
  }
  int32_t best = kNoGroup;
  for (int32_t k = 0; k < static_cast<int32_t>(g.size_cells.size()); ++k) {
    const bool larger = best == kNoGroup || g.size_cells[k] > g.size_cells[best];
    if (larger || (g.size_cells[k] == g.size_cells[best] && nearest_m[k] < nearest_m[best])) best = k;
  }
  return best;
}

int32_t choose_deepest(std::span<const glm::dvec3> position_m, const glm::dvec3& desired_m, const Groups& g) {
  int32_t best = -1;
  double best_distance = 0;
  for (size_t i = 0; i < position_m.size(); ++i) {
    if (g.largest == kNoGroup || g.group_of[i] != g.largest) continue;
    const double distance = glm::distance(position_m[i], desired_m);
    const bool deeper = best < 0 || g.depth_squared[i] > g.depth_squared[best];
    if (!deeper && (g.depth_squared[i] < g.depth_squared[best] || distance >= best_distance)) continue;
    best = static_cast<int32_t>(i);
    best_distance = distance;
  }
  return best;
}

}  // namespace

double Groups::depth_steps(size_t candidate) const {
  return std::sqrt(static_cast<double>(depth_squared[candidate]));
}

double Groups::depth_share(size_t candidate) const {
  if (max_depth_squared == 0) return 0.0;
  return std::sqrt(static_cast<double>(depth_squared[candidate]) / max_depth_squared);
}

void lattice_cells(std::span<const glm::dvec3> position_m, double spacing_m, std::vector<glm::ivec3>& cells) {
  assert(spacing_m > 0);
  cells.resize(position_m.size());
  for (size_t i = 0; i < cells.size(); ++i) cells[i] = glm::ivec3(glm::round(position_m[i] / spacing_m));
}

void find_groups(std::span<const glm::ivec3> cell, std::span<const glm::dvec3> position_m,
                 std::span<const uint8_t> member, const glm::dvec3& desired_m, GroupScratch& scratch,
                 Groups& groups) {
  assert(cell.size() == position_m.size() && cell.size() == member.size());
  Finder finder(cell, member, scratch, groups);
  finder.index_cells();
  finder.link_neighbours();
  finder.flood_all();
  finder.measure_depth();
  finder.share_out();
  groups.largest = choose_largest(position_m, desired_m, scratch.nearest_m, groups);
  groups.deepest = choose_deepest(position_m, desired_m, groups);
}

}  // namespace sightline
