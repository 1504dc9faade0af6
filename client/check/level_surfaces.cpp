#include "client/check/level_surfaces.h"

#include <algorithm>
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

  // What a ray meets behind a place on an instance, of that instance alone.
  struct Behind {
    bool covered = false;  // another surface of it lies on the place and faces the other way
    std::optional<double> way_out_m;
  };

  void judge_sample(uint32_t slot, const LevelTriangle& triangle, const glm::dvec3& place_m) {
    const bool upright = triangle.normal.y > -kUpFacing;
    ++judged_[slot];
    const Behind own = behind_in_own(slot, place_m, -triangle.normal);
    if (own.covered && own.way_out_m) return;  // two parts of a body touch here
    // A solid is most often one instance, which may touch others. But a wall's two sides may also be two instances.
    const std::optional<double> thickness_m = own.way_out_m ? own.way_out_m
                                                            : way_out(place_m, glm::vec3(-triangle.normal));
    const bool drawn_from_one_side = drawn_from_one_side_.contains(level_.mirror->instances()[slot].geometry.get());
    // Some exporters write a double-sided surface as one for each side: those cover each other.
    if (!thickness_m && drawn_from_one_side && !own.covered)
      ++one_sided_[slot];
    else if (thickness_m.value_or(0.0) < kThinnestWallM && upright)
      ++thin_[slot];
  }

  // How far a ray that starts inside a solid goes until it is outside. It enters whatever shows it its front, and
  // leaves whatever shows it its back. Where two solids of one mesh touch, it goes on in the second.
  Behind behind_in_own(uint32_t slot, const glm::dvec3& place_m, const glm::dvec3& direction) const {
    const Instance& instance = level_.mirror->instances()[slot];
    const Affine instance_from_world = inverse(instance.world_from_instance);
    // From a little before the place, so that surfaces there are met for certain.
    const std::vector<Crossing> crossings = all_crossings(
        *instance.geometry, transform_point(instance_from_world, place_m - near_m_ * direction),
        transform_vector(instance_from_world, direction));
    Behind behind;
    int inside = 1;
    for (size_t i = 0, end = 0; i < crossings.size(); i = end) {
      for (; end < crossings.size() && crossings[end].distance <= crossings[i].distance + near_m_; ++end)
        if (crossings[end].distance > 2.0 * near_m_)
          inside += crossings[end].from_back ? -1 : 1;
        else
          behind.covered = behind.covered || crossings[end].from_back;
      if (inside > 0) continue;
      behind.way_out_m = crossings[i].distance - near_m_;
      break;
    }
    return behind;
  }

  // The way out, among all instances.
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
  std::map<uint32_t, int> judged_, thin_, one_sided_;  // samples by slot
};

}  // namespace

SurfaceFindings surface_findings(const Level& level) {
  return SurfaceJudge(level).judge();
}

}  // namespace sightline
