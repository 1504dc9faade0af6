#include "client/check/level_facts.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "client/check/level_triangles.h"

namespace sightline {
namespace {

constexpr double kCosineOf30Degrees = 0.86602540378443865;

void count_meshes(const SceneAsset& asset, LevelFacts& facts) {
  std::set<const Geometry*> counted;
  for (size_t i = 0; i < asset.meshes.size(); ++i) {
    const Geometry* mesh = asset.meshes[i].get();
    if (!mesh || !counted.insert(mesh).second) continue;
    facts.stored_triangles += mesh->triangle_count();
    if (mesh->triangle_count() <= facts.largest_mesh_triangles) continue;
    facts.largest_mesh_triangles = mesh->triangle_count();
    facts.largest_mesh = asset.mesh_names[i];
  }
}

void count_instance(const Instance& instance, LevelFacts& facts) {
  ++facts.instances;
  facts.triangles += instance.geometry->triangle_count();
  if (instance.occludes() && instance.geometry->occluding_index_count > 0) ++facts.hiding;
  if (!instance.collides()) return;
  ++facts.colliding;
  if (2.0 * instance.radius_m < kSmallInstanceM) ++facts.small_colliding;
}

// Takes the areas of what stands alone: a body's shape says nothing about the level's axes.
void measure(const Level& level, uint32_t slot, LevelFacts& facts) {
  for_each_triangle(level.mirror->instances()[slot], [&](const LevelTriangle& triangle) {
    for (const glm::dvec3& corner : triangle.corners_m) {
      facts.min_m = glm::min(facts.min_m, corner);
      facts.max_m = glm::max(facts.max_m, corner);
    }
    if (!triangle.hides || !level.stands(slot)) return;
    for (int axis = 0; axis < 3; ++axis)
      if (std::abs(triangle.normal[axis]) > kCosineOf30Degrees)
        facts.facing_m2[static_cast<size_t>(axis)] += triangle.area_m2;
  });
}

}  // namespace

LevelFacts facts_of(const Level& level) {
  LevelFacts facts;
  facts.min_m = glm::dvec3(std::numeric_limits<double>::infinity()), facts.max_m = -facts.min_m;
  const std::span<const Instance> instances = level.mirror->instances();
  for (uint32_t slot = 0; slot < instances.size(); ++slot) {
    if (!instances[slot].attributes.visible) continue;
    count_instance(instances[slot], facts);
    measure(level, slot, facts);
  }
  if (facts.triangles == 0) facts.min_m = facts.max_m = glm::dvec3(0.0);
  count_meshes(*level.asset, facts);
  for (const AssetMaterial& material : level.asset->materials)
    if (material.see_through) facts.see_through_materials.push_back(material.name);
  for (const ScenarioActor& actor : level.actors) ++(actor.is_target ? facts.targets : facts.occluders);
  return facts;
}

}  // namespace sightline
