// Depth is the exact Euclidean distance transform, one pass an axis (Meijster, Roerdink & Hesselink, "A general algorithm for
// computing distance transforms in linear time", 2000). A run of members ends at cells of distance 0, beyond which nothing can be
// nearer, so each run is a problem of its own. Within a run the nearest place is sought outwards and not by the paper's envelope of
// parabolas: runs are a few cells deep, where dividing costs more than looking.
#include "server/move/groups.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace sightline {
namespace {

constexpr int32_t kFar = 1 << 29;  // larger than any squared distance on a run, and twice it still is an int

class Finder {
 public:
  Finder(std::span<const glm::ivec3> cell, std::span<const uint8_t> member, GroupScratch& scratch,
         Groups& groups)
      : cell_(cell), member_(member), s_(scratch), g_(groups) {}

  void index_cells() {
    const size_t n = cell_.size();
    s_.table.clear(cell_);
    s_.first_in_cell.resize(n);
    for (size_t i = 0; i < n; ++i) {
      int32_t& slot = s_.table.slot_of(cell_[i]);
      if (slot < 0) slot = static_cast<int32_t>(i);
      s_.first_in_cell[i] = slot;
    }
  }

  void link_neighbours() {
    s_.beside.resize(cell_.size());
    if (s_.table.box()) return link_in_box(*s_.table.box());
    for (size_t i = 0; i < cell_.size(); ++i) {
      if (!owns_member_cell(i)) continue;
      for (int side = 0; side < 6; ++side) {
        glm::ivec3 at = cell_[i];
        at[side / 2] += side % 2 == 0 ? -1 : 1;
        const int32_t other = s_.table.slot_of(at);
        s_.beside[i][side] = other >= 0 && member_[other] ? other : -1;
      }
    }
  }

  // There may be as many groups as candidates, and one of them may hold all: room for either is kept from the first.
  void flood_all() {
    g_.size_cells.clear();
    g_.size_cells.reserve(cell_.size());
    s_.nearest_m.reserve(cell_.size());
    s_.queue.reserve(cell_.size());
    s_.run.resize(cell_.size());
    s_.line.resize(cell_.size() + 2);
    g_.group_of.assign(cell_.size(), kNoGroup);
    for (size_t i = 0; i < cell_.size(); ++i)
      if (owns_member_cell(i) && g_.group_of[i] == kNoGroup) flood(static_cast<int32_t>(i));
  }

  void measure_depth() {
    s_.distance.resize(cell_.size());
    for (size_t i = 0; i < cell_.size(); ++i) s_.distance[i] = owns_member_cell(i) ? kFar : 0;
    for (int axis = 0; axis < 3; ++axis)
      for (size_t i = 0; i < cell_.size(); ++i)
        if (s_.distance[i] != 0 && s_.beside[i][2 * axis] < 0) transform_run(static_cast<int32_t>(i), axis);
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

  // The table keeps the cells of members alone; neighbours lie at fixed ways from each other in it.
  void link_in_box(const CellBox& box) {
    for (size_t i = 0; i < cell_.size(); ++i)
      if (!member_[i] && s_.first_in_cell[i] == static_cast<int32_t>(i)) s_.table.slot_of(cell_[i]) = -1;
    const auto row = static_cast<ptrdiff_t>(box.row()), slice = static_cast<ptrdiff_t>(box.slice());
    for (size_t i = 0; i < cell_.size(); ++i) {
      if (!owns_member_cell(i)) continue;
      const int32_t* const at = &s_.table.slot_of(cell_[i]);
      s_.beside[i] = {at[-1], at[1], at[-row], at[row], at[-slice], at[slice]};
    }
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
    int32_t length = 0;
    s_.line[0] = 0;
    for (int32_t i = first; i >= 0; i = s_.beside[i][2 * axis + 1]) {
      s_.run[length++] = i;
      s_.line[length] = s_.distance[i];
    }
    s_.line[length + 1] = 0;
    for (int32_t u = 1; u <= length; ++u) {
      // Along the first axis nothing but the ends is near.
      const int32_t to_end = std::min(u, length + 1 - u);
      s_.distance[s_.run[u - 1]] = axis == 0 ? to_end * to_end : least_around(u);
    }
  }

  // The least of (distance of a place on the line) + (squared way to it). Ends where no farther place can have less: at the latest
  // at the nearer end of the line, whose distance is 0.
  int32_t least_around(int32_t place) const {
    const int32_t* const at = &s_.line[place];
    int32_t least = *at;
    for (int32_t way = 1; way * way < least; ++way) least = std::min(least, std::min(at[-way], at[way]) + way * way);
    return least;
  }

  std::span<const glm::ivec3> cell_;
  std::span<const uint8_t> member_;
  GroupScratch& s_;
  Groups& g_;
};

// Distances are measured when groups of one size leave the choice to them.
int32_t choose_largest(std::span<const glm::dvec3> position_m, const glm::dvec3& desired_m,
                       std::vector<double>& nearest_m, const Groups& g) {
  if (g.size_cells.empty()) return kNoGroup;
  const auto largest = std::max_element(g.size_cells.begin(), g.size_cells.end());
  if (std::count(g.size_cells.begin(), g.size_cells.end(), *largest) == 1)
    return static_cast<int32_t>(largest - g.size_cells.begin());
  nearest_m.assign(g.size_cells.size(), std::numeric_limits<double>::infinity());
  for (size_t i = 0; i < position_m.size(); ++i) {
    if (g.group_of[i] == kNoGroup) continue;
    double& nearest = nearest_m[g.group_of[i]];
    nearest = std::min(nearest, glm::distance(position_m[i], desired_m));
  }
  int32_t best = kNoGroup;
  for (int32_t k = 0; k < static_cast<int32_t>(g.size_cells.size()); ++k)
    if (g.size_cells[k] == *largest && (best == kNoGroup || nearest_m[k] < nearest_m[best])) best = k;
  return best;
}

int32_t choose_deepest(std::span<const glm::dvec3> position_m, const glm::dvec3& desired_m, const Groups& g) {
  int32_t best = -1;
  double best_distance = 0;
  for (size_t i = 0; i < position_m.size(); ++i) {
    if (g.largest == kNoGroup || g.group_of[i] != g.largest) continue;
    const bool deeper = best < 0 || g.depth_squared[i] > g.depth_squared[best];
    if (!deeper && g.depth_squared[i] < g.depth_squared[best]) continue;
    const double distance = glm::distance(position_m[i], desired_m);
    if (!deeper && distance >= best_distance) continue;
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

void lattice_cells(const PlaceView& places, double spacing_m, std::vector<glm::ivec3>& cells) {
  assert(spacing_m > 0 && (places.in_runs() == 0 || places.spacing_m() == spacing_m));
  cells.resize(places.size());
  for (size_t run = 0; run < places.runs().size(); ++run) {
    glm::ivec3 cell = places.runs()[run].cell;
    for (size_t i = places.runs()[run].first; i < places.end_of_run(run); ++i, ++cell.x) cells[i] = cell;
  }
  for (size_t k = 0; k < places.singles_m().size(); ++k)
    cells[places.in_runs() + k] = glm::ivec3(glm::round(places.singles_m()[k] / spacing_m));
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
