#include "client/check/level_surfaces.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "client/check/level_triangles.h"
#include "server/sample/embree_scene.h"
#include "server/scene/crossings.h"

namespace sightline {
namespace {

constexpr int kSamples = 20'000;  // 0.2 s with Embree on one core
// Fewer samples on one instance may be chance: near a sharp edge every solid is thin.
constexpr int kLeastSamples = 3;
// So may a small share of an instance be: where instances touch, a ray meets only one of two equal surfaces.
constexpr double kLeastShare = 0.25;
constexpr int kMostCrossings = 64;
constexpr double kUpFacing = 0.5;  // from this y of the normal on, a surface is floor; below -0.5, ceiling

using TriangleKey = std::array<uint32_t, 3>;

// Triangles that lie in a geometry once for each side, as some exporters write double-sided surfaces. Equal positions
// have been merged (weld.h), so that both have the same vertices.
class DoubledTriangles {
 public:
  bool contains(const Geometry& geometry, size_t first_index) {
    const auto [found, is_new] = by_geometry_.try_emplace(&geometry);
    if (is_new) found->second = doubled_in(geometry);
    return found->second.contains(key_of(geometry, first_index));
  }

 private:
  static TriangleKey key_of(const Geometry& geometry, size_t first) {
    TriangleKey key{geometry.indices[first], geometry.indices[first + 1], geometry.indices[first + 2]};
    std::ranges::sort(key);
    return key;
  }
  static std::set<TriangleKey> doubled_in(const Geometry& geometry) {
    std::vector<TriangleKey> keys;
    for (size_t first = 0; first < geometry.indices.size(); first += 3) keys.push_back(key_of(geometry, first));
    std::ranges::sort(keys);
    std::set<TriangleKey> doubled;
    for (size_t i = 1; i < keys.size(); ++i)
      if (keys[i] == keys[i - 1]) doubled.insert(keys[i]);
    return doubled;
  }

  std::map<const Geometry*, std::set<TriangleKey>> by_geometry_;
};

// A place on a triangle by the R2 sequence (Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences", 2018).
glm::dvec3 place_on(const LevelTriangle& triangle, int sample) {
  double u = std::fmod(0.5 + 0.7548776662466927 * sample, 1.0), v = std::fmod(0.5 + 0.5698402909980532 * sample, 1.0);
  if (u + v > 1.0) u = 1.0 - u, v = 1.0 - v;
  const auto& [a, b, c] = triangle.corners_m;
  return a + u * (b - a) + v * (c - a);
}

class SurfaceJudge {
 public:
  explicit SurfaceJudge(const Level& level) : level_(level), scene_(device_, EmbreeScene::Content::kOccluders) {
    scene_.take_in(*level.mirror);
    const SceneAsset& asset = *level.asset;
    for (size_t i = 0; i < asset.meshes.size(); ++i)
      if (!asset.mesh_double_sided[i]) drawn_from_one_side_.insert(asset.meshes[i].get());
  }

  SurfaceFindings judge() {
    double total_m2 = 0.0, largest_m = 0.0;
    for_each_judged([&](uint32_t, const LevelTriangle& triangle) {
      total_m2 += triangle.area_m2;
      for (const glm::dvec3& corner : triangle.corners_m) largest_m = std::max(largest_m, glm::length(corner));
    });
    near_m_ = std::max(1e-4, 1e-6 * largest_m);
    const double step_m2 = total_m2 / kSamples;
    if (!(step_m2 > 0.0)) return {};
    double walked_m2 = 0.0;
    int sample = 0;
    for_each_judged([&](uint32_t slot, const LevelTriangle& triangle) {
      walked_m2 += triangle.area_m2;
      for (; (sample + 0.5) * step_m2 < walked_m2; ++sample) judge_sample(slot, triangle, place_on(triangle, sample));
    });
    return {list(thin_, step_m2), list(one_sided_, step_m2)};
  }

 private:
  template <typename Visit>
  void for_each_judged(Visit visit) const {
    const std::span<const Instance> instances = level_.mirror->instances();
    for (uint32_t slot = 0; slot < instances.size(); ++slot)
      if (level_.stands(slot) && instances[slot].occludes())
        for_each_triangle(instances[slot], [&](const LevelTriangle& triangle) {
          if (triangle.hides && triangle.normal.y < kUpFacing) visit(slot, triangle);
        });
  }

  void judge_sample(uint32_t slot, const LevelTriangle& triangle, const glm::dvec3& place_m) {
    const Geometry& geometry = *level_.mirror->instances()[slot].geometry;
    const bool upright = triangle.normal.y > -kUpFacing;
    ++judged_[slot];
    const std::optional<double> thickness_m = thickness_at(slot, place_m, -triangle.normal);
    const bool one_sided = !thickness_m && drawn_from_one_side_.contains(&geometry) &&
                           !doubled_.contains(geometry, triangle.first_index);
    if (one_sided)
      ++one_sided_[slot];
    else if (thickness_m.value_or(0.0) < kThinnestWallM && upright)
      ++thin_[slot];
  }

  // Of the solid behind a place on its surface; none where there is only a surface. A solid is most often one instance,
  // which may touch others. But a wall's two sides may also be two instances.
  std::optional<double> thickness_at(uint32_t slot, const glm::dvec3& place_m, const glm::dvec3& inwards) const {
    const std::optional<double> own_m = way_out_of_own(slot, place_m, inwards);
    return own_m ? own_m : way_out(place_m, glm::vec3(inwards));
  }

  // How far a ray that starts inside a solid goes until it is outside. It enters whatever shows it its front, and
  // leaves whatever shows it its back. Where two solids of one mesh touch, it leaves the first and enters the second at
  // once.
  std::optional<double> way_out_of_own(uint32_t slot, const glm::dvec3& place_m, const glm::dvec3& direction) const {
    const Instance& instance = level_.mirror->instances()[slot];
    const Affine instance_from_world = inverse(instance.world_from_instance);
    const std::vector<Crossing> crossings = all_crossings(*instance.geometry,
                                                          transform_point(instance_from_world, place_m),
                                                          transform_vector(instance_from_world, direction));
    int inside = 1;
    for (size_t i = 0, end = 0; i < crossings.size(); i = end) {
      int entered = 0;
      for (; end < crossings.size() && crossings[end].distance <= crossings[i].distance + near_m_; ++end) {
        if (crossings[end].distance <= near_m_) continue;
        crossings[end].from_back ? --inside : ++entered;
      }
      if (inside <= 0) return crossings[i].distance;
      inside += entered;
    }
    return std::nullopt;
  }

  // The same among all instances.
  std::optional<double> way_out(const glm::dvec3& place_m, const glm::vec3& direction) const {
    auto from_m = static_cast<float>(near_m_);
    int inside = 1;
    for (int crossing = 0; crossing < kMostCrossings; ++crossing) {
      const RayHit hit = scene_.trace(place_m, direction, from_m, std::numeric_limits<float>::infinity());
      if (hit.slot == UINT32_MAX) return std::nullopt;
      inside += glm::dot(hit.normal, direction) > 0.0f ? -1 : 1;
      if (inside == 0) return hit.distance_m;
      from_m = hit.distance_m + static_cast<float>(near_m_);
    }
    return std::nullopt;
  }

  std::vector<SurfaceFinding> list(const std::map<uint32_t, int>& samples, double step_m2) const {
    std::map<std::string, int> by_name;
    for (const auto& [slot, count] : samples)
      if (count >= kLeastSamples && count * step_m2 >= kLeastNamedM2 && count >= kLeastShare * judged_.at(slot))
        by_name[level_.name_of(slot)] += count;
    std::vector<SurfaceFinding> found;
    for (const auto& [name, count] : by_name) found.push_back({name, count * step_m2});
    std::ranges::stable_sort(found, std::ranges::greater{}, &SurfaceFinding::area_m2);
    return found;
  }

  const Level& level_;
  EmbreeDevice device_;
  EmbreeScene scene_;
  double near_m_ = 0.0;  // nearer surfaces are one; a ray leaves its own triangle behind
  std::set<const Geometry*> drawn_from_one_side_;
  DoubledTriangles doubled_;
  std::map<uint32_t, int> judged_, thin_, one_sided_;  // samples by slot
};

}  // namespace

SurfaceFindings surface_findings(const Level& level) {
  return SurfaceJudge(level).judge();
}

}  // namespace sightline
