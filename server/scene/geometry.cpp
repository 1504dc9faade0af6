#include "server/scene/geometry.h"

#include <openssl/evp.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <new>
#include <optional>

#include "server/scene/tree_builder.h"
#include "server/scene/weld.h"

namespace sightline {
namespace {

// The bytes of a digest between two looks at the limit of the work.
constexpr size_t kDigestedAtOnce = size_t{1} << 18;

Aabb joined(const Aabb& a, const Aabb& b) {
  return {glm::min(a.min, b.min), glm::max(a.max, b.max)};
}

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
std::vector<TreePart> parts_of(const MeshData& mesh, size_t first, size_t last) {
  std::vector<TreePart> parts;
  parts.reserve(last - first);
  for (size_t t = first; t < last; ++t) {
    const glm::vec3 &a = mesh.positions[mesh.indices[3 * t]], &b = mesh.positions[mesh.indices[3 * t + 1]],
                    &c = mesh.positions[mesh.indices[3 * t + 2]];
    if (!has_area(a, b, c)) continue;
    parts.push_back({{glm::min(a, glm::min(b, c)), glm::max(a, glm::max(b, c))}, static_cast<uint32_t>(t)});
  }
  return parts;
}

void append_in_order(const std::vector<TreePart>& parts, const std::vector<uint32_t>& from, std::vector<uint32_t>& to) {
  for (const TreePart& part : parts)
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
  geometry.radius_m = std::nextafter(static_cast<float>(std::sqrt(squared)), std::numeric_limits<float>::infinity());
}

// Empty when the work has to end.
std::optional<GeometryKey> key_of(const MeshData& mesh, WorkLimit::Part& work) {
  const std::array<uint64_t, 3> sizes = {mesh.positions.size(), mesh.indices.size(),
                                         std::min<uint64_t>(mesh.see_through_first_index, mesh.indices.size())};
  GeometryKey key{};
  const std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> digest(EVP_MD_CTX_new(), &EVP_MD_CTX_free);
  bool well = digest && EVP_DigestInit_ex(digest.get(), EVP_sha256(), nullptr) == 1;
  const auto add = [&](std::span<const std::byte> bytes) {
    for (; !bytes.empty() && well && !work.ends(kDigestedAtOnce / 256);
         bytes = bytes.subspan(std::min(bytes.size(), kDigestedAtOnce)))
      well = EVP_DigestUpdate(digest.get(), bytes.data(), std::min(bytes.size(), kDigestedAtOnce)) == 1;
  };
  add(std::as_bytes(std::span(sizes)));
  add(std::as_bytes(std::span(mesh.positions)));
  add(std::as_bytes(std::span(mesh.indices)));
  if (work.ends()) return std::nullopt;
  if (!well || EVP_DigestFinal_ex(digest.get(), key.data(), nullptr) != 1) throw std::bad_alloc();
  return key;
}

// Null when the work has to end.
std::shared_ptr<const Geometry> build_checked(MeshData mesh, const ContentHash& hash, const GeometryKey& key,
                                              WorkLimit::Part& work) {
  if (!weld(mesh.positions, mesh.indices, work)) return nullptr;
  const size_t triangles = mesh.indices.size() / 3;
  const size_t opaque = std::min<size_t>(triangles, mesh.see_through_first_index / 3);
  std::vector<TreePart> occluding = parts_of(mesh, 0, opaque), see_through = parts_of(mesh, opaque, triangles);

  auto geometry = std::make_shared<Geometry>();
  geometry->hash = hash;
  geometry->key = key;
  geometry->occluding_index_count = static_cast<uint32_t>(3 * occluding.size());
  geometry->occluding = build_tree(occluding, 0, work);
  geometry->see_through = build_tree(see_through, geometry->occluding_index_count, work);
  if (work.ends_now()) return nullptr;
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

GeometryBytes Geometry::bytes_by_part() const {
  return {positions.size() * sizeof(positions[0]) + indices.size() * sizeof(indices[0]),
          sizeof(Geometry) + (occluding.size() + see_through.size()) * sizeof(TreeNode)};
}

ContentHash hash_mesh(const MeshData& mesh) {
  const ContentHash positions = hash_bytes(std::as_bytes(std::span(mesh.positions)));
  const ContentHash indices = hash_bytes(std::as_bytes(std::span(mesh.indices)));
  const std::array<uint64_t, 7> parts = {positions.high,
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
  WorkLimit::Part endless(nullptr);
  const GeometryKey key = *key_of(mesh, endless);
  return build_checked(std::move(mesh), hash, key, endless);
}

namespace {

// The indices and both trees take this for each triangle.
constexpr size_t kBytesOfBuiltTriangle = 36;

using Bytes = std::shared_ptr<std::atomic<size_t>>;

// Builds a geometry. `bytes` holds the estimate `reserved` for it meanwhile, then the geometry's own bytes until it is
// no longer used.
template <typename Build>
std::shared_ptr<const Geometry> counted(size_t reserved, const Bytes& bytes, const Build& build) try {
  std::shared_ptr<const Geometry> built = build();
  if (!built) {
    bytes->fetch_sub(reserved);
    return nullptr;
  }
  const size_t own = built->bytes();
  const Geometry* const plain = built.get();
  std::shared_ptr<const Geometry> guarded(plain, [built = std::move(built), bytes, own](const Geometry*) mutable {
    built.reset();
    bytes->fetch_sub(own);
  });
  bytes->fetch_add(own);
  bytes->fetch_sub(reserved);
  return guarded;
} catch (...) {
  bytes->fetch_sub(reserved);
  throw;
}

}  // namespace

bool GeometryStore::reserve(size_t bytes) {
  if (max_bytes_ == 0) return true;
  if (bytes_->fetch_add(bytes) + bytes <= max_bytes_) return true;
  bytes_->fetch_sub(bytes);
  return false;
}

Result<std::shared_ptr<const Geometry>> GeometryStore::intern(MeshData mesh, WorkLimit* limit) {
  WorkLimit::Part work(limit);
  const auto digest = key_of(mesh, work);
  if (!digest) return tl::unexpected(limit->error());
  const GeometryKey& key = *digest;
  if (auto alive = find(key)) return alive;
  if (const Status ok = check_mesh(mesh); !ok) return tl::unexpected(ok.error());
  const ContentHash hash = hash_mesh(mesh);
  const size_t reserved = mesh.positions.size() * sizeof(glm::vec3) + mesh.indices.size() / 3 * kBytesOfBuiltTriangle;
  if (!reserve(reserved))
    return fail(ErrorCode::kResourceExhausted, "",
                "the geometry of all scenes and shapes together takes more than " + std::to_string(max_bytes_ >> 20) +
                    " MiB (--geometry-memory-mib)");
  const auto build = [&] { return build_checked(std::move(mesh), hash, key, work); };
  auto built = max_bytes_ == 0 ? build() : counted(reserved, bytes_, build);
  if (!built) return tl::unexpected(limit->error());
  const MutexLock lock(mutex_);
  if (by_key_.size() >= forget_at_size_) forget_dead();
  std::weak_ptr<const Geometry>& kept = by_key_[key];
  if (auto alive = kept.lock()) return alive;  // another thread was faster: its copy is the one
  kept = built;
  return built;
}

std::shared_ptr<const Geometry> GeometryStore::find(const GeometryKey& key) const {
  const MutexLock lock(mutex_);
  const auto it = by_key_.find(key);
  return it == by_key_.end() ? nullptr : it->second.lock();
}

void GeometryStore::forget_dead() {
  std::erase_if(by_key_, [](const auto& entry) { return entry.second.expired(); });
  forget_at_size_ = std::max<size_t>(64, 2 * by_key_.size());
}

GeometryBytes GeometryStore::live_bytes_by_part() const {
  const MutexLock lock(mutex_);
  GeometryBytes all;
  for (const auto& [key, geometry] : by_key_) {
    const auto alive = geometry.lock();
    if (!alive) continue;
    const GeometryBytes one = alive->bytes_by_part();
    all.source += one.source;
    all.clusters += one.clusters;
  }
  return all;
}

size_t GeometryStore::live_count() const {
  const MutexLock lock(mutex_);
  return static_cast<size_t>(
      std::count_if(by_key_.begin(), by_key_.end(), [](const auto& entry) { return !entry.second.expired(); }));
}

}  // namespace sightline
