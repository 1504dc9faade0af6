#include "server/scene/geometry.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <optional>

namespace sightline {
namespace {

constexpr int kBins = 16;
// Below this depth the heuristic is given up for medians, which bounds the depth of hostile input.
constexpr int kHeuristicDepth = 32;

struct Part {
  Aabb bounds;
  uint32_t triangle = 0;  // in the mesh as given
  // Twice the centre: only compared.
  glm::vec3 centroid() const { return bounds.min + bounds.max; }
};

Aabb joined(const Aabb& a, const Aabb& b) {
  return {glm::min(a.min, b.min), glm::max(a.max, b.max)};
}

float half_area(const Aabb& box) {
  const glm::vec3 d = box.max - box.min;
  return d.x * d.y + d.y * d.z + d.z * d.x;
}

struct Bin {
  Aabb bounds;
  uint32_t count = 0;
};

// Which of kBins equal slabs of the centroid bounds a part falls in.
struct Binning {
  glm::vec3 low, scale;
  explicit Binning(const Aabb& centroids) : low(centroids.min), scale(0.0f) {
    const glm::vec3 extent = centroids.max - centroids.min;
    for (int axis = 0; axis < 3; ++axis)
      if (extent[axis] > 1e-30f) scale[axis] = kBins / extent[axis];
  }
  int operator()(const Part& part, int axis) const {
    return std::min(static_cast<int>((part.centroid()[axis] - low[axis]) * scale[axis]), kBins - 1);
  }
};

struct Plane {
  int axis;
  int first_right_bin;
};

float cost_in_clusters(const Aabb& bounds, uint32_t count) {
  return half_area(bounds) * static_cast<float>((count + kMaxClusterTriangles - 1) / kMaxClusterTriangles);
}

// The cheapest plane of one axis, when it beats `best_cost`.
void try_axis(const std::array<Bin, kBins>& bins, int axis, float& best_cost, std::optional<Plane>& best) {
  std::array<Bin, kBins> from_right;
  from_right[kBins - 1] = bins[kBins - 1];
  for (int i = kBins - 2; i > 0; --i)
    from_right[i] = {joined(bins[i].bounds, from_right[i + 1].bounds),
                     bins[i].count + from_right[i + 1].count};
  Bin left;
  for (int i = 1; i < kBins; ++i) {
    left = {joined(left.bounds, bins[i - 1].bounds), left.count + bins[i - 1].count};
    if (left.count == 0 || from_right[i].count == 0) continue;
    const float cost = cost_in_clusters(left.bounds, left.count) +
                       cost_in_clusters(from_right[i].bounds, from_right[i].count);
    if (cost < best_cost) best_cost = cost, best = Plane{axis, i};
  }
}

class TreeBuilder {
 public:
  // Orders `parts`; their triangles will stand at `first_index` in that order.
  TreeBuilder(std::span<Part> parts, uint32_t first_index) : parts_(parts), first_index_(first_index) {}

  TriangleTree build() {
    if (!parts_.empty()) build_range(0, parts_.size(), 0);
    return std::move(tree_);
  }

 private:
  void build_range(size_t begin, size_t end, int depth) {
    assert(depth <= kMaxTreeDepth);
    const size_t self = tree_.size();
    TreeNode node;
    Aabb centroids;
    for (const Part& part : parts_.subspan(begin, end - begin)) {
      node.bounds = joined(node.bounds, part.bounds);
      centroids.grow(part.centroid());
    }
    node.first_index = first_index_ + static_cast<uint32_t>(3 * begin);
    node.index_count = static_cast<uint32_t>(3 * (end - begin));
    tree_.push_back(node);
    if (end - begin <= kMaxClusterTriangles) return;
    const size_t middle = split(begin, end, centroids, depth);
    build_range(begin, middle, depth + 1);
    tree_[self].right = static_cast<uint32_t>(tree_.size());
    build_range(middle, end, depth + 1);
  }

  size_t split(size_t begin, size_t end, const Aabb& centroids, int depth) {
    const Binning bin_of(centroids);
    const auto plane = depth < kHeuristicDepth ? best_plane(begin, end, bin_of) : std::nullopt;
    if (!plane) return split_at_median(begin, end, centroids);
    const auto middle = std::partition(
        parts_.begin() + static_cast<ptrdiff_t>(begin), parts_.begin() + static_cast<ptrdiff_t>(end),
        [&](const Part& part) { return bin_of(part, plane->axis) < plane->first_right_bin; });
    return static_cast<size_t>(middle - parts_.begin());
  }

  std::optional<Plane> best_plane(size_t begin, size_t end, const Binning& bin_of) const {
    std::array<std::array<Bin, kBins>, 3> bins;
    for (const Part& part : parts_.subspan(begin, end - begin))
      for (int axis = 0; axis < 3; ++axis) {
        Bin& bin = bins[axis][bin_of(part, axis)];
        bin.bounds = joined(bin.bounds, part.bounds);
        ++bin.count;
      }
    float best_cost = std::numeric_limits<float>::infinity();
    std::optional<Plane> best;
    for (int axis = 0; axis < 3; ++axis) try_axis(bins[axis], axis, best_cost, best);
    return best;
  }

  // Halves by count, the left half in whole clusters. Always parts the range, even when all centroids are
  // equal.
  size_t split_at_median(size_t begin, size_t end, const Aabb& centroids) {
    const glm::vec3 extent = centroids.max - centroids.min;
    const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
    const size_t half = (end - begin) / 2;
    const size_t middle =
        begin + (half + kMaxClusterTriangles - 1) / kMaxClusterTriangles * kMaxClusterTriangles;
    const auto at = [&](size_t i) { return parts_.begin() + static_cast<ptrdiff_t>(i); };
    std::nth_element(at(begin), at(middle), at(end), [axis](const Part& a, const Part& b) {
      const float ca = a.centroid()[axis], cb = b.centroid()[axis];
      return ca != cb ? ca < cb : a.triangle < b.triangle;
    });
    return middle;
  }

  std::span<Part> parts_;
  const uint32_t first_index_;
  TriangleTree tree_;
};

Status check_mesh(const MeshData& mesh) {
  if (mesh.indices.size() % 3 != 0) return invalid("indices", "count must be a multiple of 3");
  if (mesh.indices.size() > UINT32_MAX - 2) return invalid("indices", "too many for 32-bit ranges");
  if (mesh.see_through_first_index < mesh.indices.size() && mesh.see_through_first_index % 3 != 0)
    return invalid("see_through_first_index", "must be a multiple of 3");
  for (size_t i = 0; i < mesh.positions.size(); ++i) {
    const glm::vec3 p = glm::abs(mesh.positions[i]);
    if (!(p.x <= kMaxCoordinateM && p.y <= kMaxCoordinateM && p.z <= kMaxCoordinateM))
      return invalid(indexed("positions", i), "must be finite and within 1e9 m");
  }
  for (size_t i = 0; i < mesh.indices.size(); ++i)
    if (mesh.indices[i] >= mesh.positions.size()) return invalid(indexed("indices", i), "names no position");
  return {};
}

bool has_area(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  const glm::dvec3 n = glm::cross(b - a, c - a);
  return n.x != 0 || n.y != 0 || n.z != 0;
}

// The triangles [first, last) of the mesh that have an area.
std::vector<Part> parts_of(const MeshData& mesh, size_t first, size_t last) {
  std::vector<Part> parts;
  parts.reserve(last - first);
  for (size_t t = first; t < last; ++t) {
    const glm::vec3 &a = mesh.positions[mesh.indices[3 * t]], &b = mesh.positions[mesh.indices[3 * t + 1]],
                    &c = mesh.positions[mesh.indices[3 * t + 2]];
    if (!has_area(a, b, c)) continue;
    parts.push_back({{glm::min(a, glm::min(b, c)), glm::max(a, glm::max(b, c))}, static_cast<uint32_t>(t)});
  }
  return parts;
}

void append_in_order(const std::vector<Part>& parts, const std::vector<uint32_t>& from,
                     std::vector<uint32_t>& to) {
  for (const Part& part : parts)
    to.insert(to.end(), {from[3 * part.triangle], from[3 * part.triangle + 1], from[3 * part.triangle + 2]});
}

void bound_by_sphere(Geometry& geometry) {
  if (geometry.indices.empty()) return;
  geometry.center = geometry.bounds.center();
  double squared = 0.0;
  for (const uint32_t i : geometry.indices) {
    const glm::dvec3 d = glm::dvec3(geometry.positions[i]) - glm::dvec3(geometry.center);
    squared = std::max(squared, glm::dot(d, d));
  }
  // Rounded up, so that no vertex lies outside.
  geometry.radius_m =
      std::nextafter(static_cast<float>(std::sqrt(squared)), std::numeric_limits<float>::infinity());
}

std::shared_ptr<const Geometry> build_checked(MeshData mesh, const ContentHash& hash) {
  const size_t triangles = mesh.indices.size() / 3;
  const size_t opaque = std::min<size_t>(triangles, mesh.see_through_first_index / 3);
  std::vector<Part> occluding = parts_of(mesh, 0, opaque), see_through = parts_of(mesh, opaque, triangles);

  auto geometry = std::make_shared<Geometry>();
  geometry->hash = hash;
  geometry->occluding_index_count = static_cast<uint32_t>(3 * occluding.size());
  geometry->occluding = TreeBuilder(occluding, 0).build();
  geometry->see_through = TreeBuilder(see_through, geometry->occluding_index_count).build();
  geometry->indices.reserve(3 * (occluding.size() + see_through.size()));
  append_in_order(occluding, mesh.indices, geometry->indices);
  append_in_order(see_through, mesh.indices, geometry->indices);
  geometry->positions = std::move(mesh.positions);
  for (const TriangleTree* tree : {&geometry->occluding, &geometry->see_through})
    if (!tree->empty()) geometry->bounds = joined(geometry->bounds, tree->front().bounds);
  bound_by_sphere(*geometry);
  geometry->positions.shrink_to_fit();
  geometry->occluding.shrink_to_fit();
  geometry->see_through.shrink_to_fit();
  return geometry;
}

}  // namespace

size_t Geometry::bytes() const {
  return sizeof(Geometry) + positions.size() * sizeof(positions[0]) + indices.size() * sizeof(indices[0]) +
         (occluding.size() + see_through.size()) * sizeof(TreeNode);
}

ContentHash hash_mesh(const MeshData& mesh) {
  const ContentHash positions = hash_bytes(std::as_bytes(std::span(mesh.positions)));
  const ContentHash indices = hash_bytes(std::as_bytes(std::span(mesh.indices)));
  const std::array<uint64_t, 7> parts = {
      positions.high,
      positions.low,
      indices.high,
      indices.low,
      mesh.positions.size(),
      mesh.indices.size(),
      std::min<uint64_t>(mesh.see_through_first_index, mesh.indices.size())};
  return hash_bytes(std::as_bytes(std::span(parts)));
}

Result<std::shared_ptr<const Geometry>> build_geometry(MeshData mesh) {
  if (const Status ok = check_mesh(mesh); !ok) return tl::unexpected(ok.error());
  const ContentHash hash = hash_mesh(mesh);
  return build_checked(std::move(mesh), hash);
}

Result<std::shared_ptr<const Geometry>> GeometryStore::intern(MeshData mesh) {
  const ContentHash hash = hash_mesh(mesh);
  if (auto alive = find(hash)) return alive;
  if (const Status ok = check_mesh(mesh); !ok) return tl::unexpected(ok.error());
  auto built = build_checked(std::move(mesh), hash);
  const std::lock_guard lock(mutex_);
  if (by_hash_.size() >= forget_at_size_) forget_dead();
  std::weak_ptr<const Geometry>& kept = by_hash_[hash];
  if (auto alive = kept.lock()) return alive;  // another thread was faster: its copy is the one
  kept = built;
  return built;
}

std::shared_ptr<const Geometry> GeometryStore::find(const ContentHash& hash) const {
  const std::lock_guard lock(mutex_);
  const auto it = by_hash_.find(hash);
  return it == by_hash_.end() ? nullptr : it->second.lock();
}

void GeometryStore::forget_dead() {
  std::erase_if(by_hash_, [](const auto& entry) { return entry.second.expired(); });
  forget_at_size_ = std::max<size_t>(64, 2 * by_hash_.size());
}

size_t GeometryStore::live_bytes() const {
  const std::lock_guard lock(mutex_);
  size_t bytes = 0;
  for (const auto& [hash, geometry] : by_hash_)
    if (const auto alive = geometry.lock()) bytes += alive->bytes();
  return bytes;
}

size_t GeometryStore::live_count() const {
  const std::lock_guard lock(mutex_);
  return static_cast<size_t>(std::count_if(by_hash_.begin(), by_hash_.end(),
                                           [](const auto& entry) { return !entry.second.expired(); }));
}

}  // namespace sightline
