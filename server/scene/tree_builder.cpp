#include "server/scene/tree_builder.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstring>
#include <optional>

#include "server/base/parallel.h"

namespace sightline {
namespace {

constexpr int kBins = 16;
// Below this depth nodes are split at medians, which bounds the depth for hostile input.
constexpr int kHeuristicDepth = 32;
// The least number of triangles that is worth a thread.
constexpr size_t kParallelTriangles = size_t{1} << 15;

// x, y, z and a lane that is 0: boxes grow by one instruction a corner. Plain vectors of the compiler, on any machine.
using Lanes = float __attribute__((vector_size(16)));
using IntLanes = int32_t __attribute__((vector_size(16)));

Lanes least(Lanes a, Lanes b) {
  return a < b ? a : b;
}
Lanes greatest(Lanes a, Lanes b) {
  return a > b ? a : b;
}
Lanes lanes(const glm::vec3& v) {
  return Lanes{v.x, v.y, v.z, 0.0f};
}
glm::vec3 vec3(Lanes v) {
  return {v[0], v[1], v[2]};
}

struct Box {
  Lanes min = lanes(glm::vec3(std::numeric_limits<float>::infinity()));
  Lanes max = lanes(glm::vec3(-std::numeric_limits<float>::infinity()));

  void grow(const Box& other) { min = least(min, other.min), max = greatest(max, other.max); }
  void grow(Lanes point) { min = least(min, point), max = greatest(max, point); }
};

static_assert(sizeof(Aabb) == 24 && sizeof(TreePart) == 28);
// Four floats from each corner on lie within the part; the fourth is cleared, for it may be of another kind.
Box box_of(const TreePart& part) {
  constexpr IntLanes kThree = {-1, -1, -1, 0};
  IntLanes low, high;
  std::memcpy(&low, &part.bounds.min, sizeof low);
  std::memcpy(&high, &part.bounds.max, sizeof high);
  return {reinterpret_cast<Lanes>(low & kThree), reinterpret_cast<Lanes>(high & kThree)};
}

// Twice the centre: only compared.
Lanes centroid(const Box& box) {
  return box.min + box.max;
}
float centroid(const TreePart& part, int axis) {
  return part.bounds.min[axis] + part.bounds.max[axis];
}

float half_area(const Box& box) {
  const glm::vec3 d = vec3(box.max - box.min);
  return d.x * d.y + d.y * d.z + d.z * d.x;
}

struct Bin {
  Box box;
  uint32_t count = 0;
};
using Bins = std::array<std::array<Bin, kBins>, 3>;

// The slab, of kBins equal ones across the centroids' box, that contains a centroid, on each axis.
struct Binning {
  Lanes low, scale;
  explicit Binning(const Box& centroids) : low(centroids.min), scale(lanes(glm::vec3(0.0f))) {
    const Lanes extent = centroids.max - centroids.min;
    for (int axis = 0; axis < 3; ++axis)
      if (extent[axis] > 1e-30f) scale[axis] = kBins / extent[axis];
  }
  IntLanes operator()(const Box& box) const {
    constexpr IntLanes kLast = {kBins - 1, kBins - 1, kBins - 1, kBins - 1};
    const IntLanes bin = __builtin_convertvector((centroid(box) - low) * scale, IntLanes);
    return bin < kLast ? bin : kLast;
  }
  int operator()(const TreePart& part, int axis) const {
    return std::min(static_cast<int>((centroid(part, axis) - low[axis]) * scale[axis]), kBins - 1);
  }
};

struct Plane {
  int axis;
  int first_right_bin;
};

float cost_in_clusters(const Bin& side) {
  return half_area(side.box) * static_cast<float>((side.count + kMaxClusterTriangles - 1) / kMaxClusterTriangles);
}

void join(Bin& into, const Bin& other) {
  into.box.grow(other.box);
  into.count += other.count;
}

// The cheapest plane of one axis, when it beats `best_cost`.
void try_axis(const std::array<Bin, kBins>& bins, int axis, float& best_cost, std::optional<Plane>& best) {
  std::array<Bin, kBins> from_right = bins;
  for (int i = kBins - 2; i > 0; --i) join(from_right[i], from_right[i + 1]);
  Bin left;
  for (int i = 1; i < kBins; ++i) {
    join(left, bins[i - 1]);
    if (left.count == 0 || from_right[i].count == 0) continue;
    const float cost = cost_in_clusters(left) + cost_in_clusters(from_right[i]);
    if (cost < best_cost) best_cost = cost, best = Plane{axis, i};
  }
}

class TreeBuilder {
 public:
  TreeBuilder(std::span<TreePart> parts, uint32_t first_index) : parts_(parts), first_index_(first_index) {}

  // Appends the subtree over parts [begin, end), as if `tree` began at the root.
  void build_range(size_t begin, size_t end, int depth, TriangleTree& tree, WorkLimit::Part& work) const {
    assert(depth <= kMaxTreeDepth);
    const size_t self = tree.size();
    Box box, centroids;
    for (const TreePart& part : parts_.subspan(begin, end - begin)) {
      const Box of_part = box_of(part);
      box.grow(of_part);
      centroids.grow(centroid(of_part));
    }
    tree.push_back({{vec3(box.min), vec3(box.max)},
                    first_index_ + static_cast<uint32_t>(3 * begin),
                    static_cast<uint32_t>(3 * (end - begin)),
                    0});
    if (end - begin <= kMaxClusterTriangles || work.ends(1 + (end - begin) / 16)) return;
    const size_t middle = split(begin, end, centroids, depth);
    if (end - begin >= kParallelTriangles) return build_both(begin, middle, end, depth, tree, work.limit());
    build_range(begin, middle, depth + 1, tree, work);
    tree[self].right = static_cast<uint32_t>(tree.size());
    build_range(middle, end, depth + 1, tree, work);
  }

 private:
  // The two children of the last node in `tree`, at the same time.
  void build_both(size_t begin, size_t middle, size_t end, int depth, TriangleTree& tree, WorkLimit* limit) const {
    std::array<TriangleTree, 2> children;
    parallel_for(2, [&](size_t side) {
      WorkLimit::Part work(limit);
      build_range(side == 0 ? begin : middle, side == 0 ? middle : end, depth + 1, children[side], work);
    });
    const size_t self = tree.size() - 1;
    for (size_t side = 0; side < 2; ++side) {
      const auto base = static_cast<uint32_t>(tree.size());
      if (side == 1) tree[self].right = base;
      for (TreeNode node : children[side]) {
        if (!node.is_leaf()) node.right += base;
        tree.push_back(node);
      }
    }
  }

  size_t split(size_t begin, size_t end, const Box& centroids, int depth) const {
    const Binning bin_of(centroids);
    const auto plane = depth < kHeuristicDepth ? best_plane(begin, end, bin_of) : std::nullopt;
    if (!plane) return split_at_median(begin, end, centroids);
    const auto middle = std::partition(at(begin), at(end), [&bin_of, plane = *plane](const TreePart& part) {
      return bin_of(part, plane.axis) < plane.first_right_bin;
    });
    return static_cast<size_t>(middle - parts_.begin());
  }

  std::optional<Plane> best_plane(size_t begin, size_t end, const Binning& bin_of) const {
    Bins bins;
    for (const TreePart& part : parts_.subspan(begin, end - begin)) {
      const Box box = box_of(part);
      const IntLanes index = bin_of(box);
      for (int axis = 0; axis < 3; ++axis) {
        Bin& bin = bins[axis][index[axis]];
        bin.box.grow(box);
        ++bin.count;
      }
    }
    float best_cost = std::numeric_limits<float>::infinity();
    std::optional<Plane> best;
    for (int axis = 0; axis < 3; ++axis) try_axis(bins[axis], axis, best_cost, best);
    return best;
  }

  // Splits by count, the left half in whole clusters. Always splits, even when all centroids are equal.
  size_t split_at_median(size_t begin, size_t end, const Box& centroids) const {
    const glm::vec3 extent = vec3(centroids.max - centroids.min);
    const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
    const size_t half = (end - begin) / 2;
    const size_t middle = begin + (half + kMaxClusterTriangles - 1) / kMaxClusterTriangles * kMaxClusterTriangles;
    std::nth_element(at(begin), at(middle), at(end), [axis](const TreePart& a, const TreePart& b) {
      const float ca = centroid(a, axis), cb = centroid(b, axis);
      return ca != cb ? ca < cb : a.triangle < b.triangle;
    });
    return middle;
  }

  std::span<TreePart>::iterator at(size_t i) const { return parts_.begin() + static_cast<ptrdiff_t>(i); }

  const std::span<TreePart> parts_;
  const uint32_t first_index_;
};

}  // namespace

TriangleTree build_tree(std::span<TreePart> parts, uint32_t first_index, WorkLimit::Part& work) {
  TriangleTree tree;
  if (!parts.empty()) TreeBuilder(parts, first_index).build_range(0, parts.size(), 0, tree, work);
  return tree;
}

}  // namespace sightline
