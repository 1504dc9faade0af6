// What clusters of at most 64 triangles are worth to a depth map, by who makes them: the tree builder of
// server/scene/geometry.cpp, meshoptimizer's meshlets, and meshoptimizer's spatial sort cut every 64 triangles.
// Printed for the city, mesh by mesh and as one mesh: clusters and triangles that survive the culling of one 7 x 7 map
// (mean of 500 maps from the streets), bytes of cluster bounds, and the time to make the clusters (least of five; of
// the tree builder with its tree, checks and hash, of the library without any tree above its clusters).
#include <meshoptimizer.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <string>
#include <vector>

#include "scenes/city.h"
#include "server/base/random.h"
#include "server/sample/cull.h"
#include "server/scene/gltf.h"

namespace sightline {
namespace {

constexpr int kMaps = 500;
constexpr int kRounds = 5;

// Leaves alone: what survives is not to depend on the tree above them.
using Clusters = std::vector<TreeNode>;
using MakeClusters = std::function<Clusters(const MeshData&)>;

struct Placed {
  MeshData mesh;
  Affine world_from_mesh;
};

TreeNode leaf(const MeshData& mesh, std::span<const uint32_t> indices) {
  TreeNode node;
  for (const uint32_t index : indices) node.bounds.grow(mesh.positions[index]);
  node.index_count = static_cast<uint32_t>(indices.size());
  return node;
}

Clusters by_tree_builder(const MeshData& mesh) {
  const auto geometry = build_geometry(mesh).value();
  Clusters clusters;
  for (const TreeNode& node : geometry->occluding)
    if (node.is_leaf()) clusters.push_back(node);
  return clusters;
}

Clusters by_meshlets(const MeshData& mesh) {
  constexpr size_t kMaxVertices = 255;
  const size_t count = meshopt_buildMeshletsBound(mesh.indices.size(), kMaxVertices, kMaxClusterTriangles);
  std::vector<meshopt_Meshlet> meshlets(count);
  std::vector<uint32_t> vertices(count * kMaxVertices);
  std::vector<unsigned char> triangles(count * kMaxClusterTriangles * 3);
  meshlets.resize(meshopt_buildMeshlets(meshlets.data(), vertices.data(), triangles.data(),
                                        mesh.indices.data(), mesh.indices.size(), &mesh.positions[0].x,
                                        mesh.positions.size(), sizeof(glm::vec3), kMaxVertices,
                                        kMaxClusterTriangles, 0.0f));
  Clusters clusters;
  std::vector<uint32_t> indices;
  for (const meshopt_Meshlet& m : meshlets) {
    indices.clear();
    for (size_t i = 0; i < 3 * size_t{m.triangle_count}; ++i)
      indices.push_back(vertices[m.vertex_offset + triangles[m.triangle_offset + i]]);
    clusters.push_back(leaf(mesh, indices));
  }
  return clusters;
}

Clusters by_spatial_sort(const MeshData& mesh) {
  std::vector<uint32_t> sorted(mesh.indices.size());
  meshopt_spatialSortTriangles(sorted.data(), mesh.indices.data(), mesh.indices.size(), &mesh.positions[0].x,
                               mesh.positions.size(), sizeof(glm::vec3));
  Clusters clusters;
  const size_t step = 3 * kMaxClusterTriangles;
  for (size_t i = 0; i < sorted.size(); i += step)
    clusters.push_back(leaf(mesh, std::span(sorted).subspan(i, std::min(step, sorted.size() - i))));
  return clusters;
}

// What maps see of one placed mesh.
struct Survivors {
  double clusters = 0.0, triangles = 0.0;
};

MapView view_from_street(CounterRandom& random) {
  MapView view;
  view.eye_m = {random.next_in(-100, 100), random.next_in(0.5, 2.5), random.next_in(-100, 100)};
  const glm::dvec3 forward =
      glm::normalize(glm::dvec3(random.next_in(-1, 1), random.next_in(0, 0.7), random.next_in(-1, 1)));
  view.world_from_view = glm::mat3_cast(look_rotation(forward, {0, 1, 0}, {1, 0, 0}));
  view.left = view.bottom = -0.25;
  view.right = view.top = 0.25;
  view.width = view.height = 7;
  view.jitter = {random.next_unit(), random.next_unit()};
  return view;
}

Survivors survivors(const std::vector<Placed>& scene, const std::vector<Clusters>& clusters) {
  CounterRandom random(5, 0, RandomPurpose::kTest);
  Survivors mean;
  for (int map = 0; map < kMaps; ++map) {
    const MapView view = view_from_street(random);
    const ClipMap clip = clip_map(view);
    for (size_t i = 0; i < scene.size(); ++i) {
      const SampleGrid grid = sample_grid(clip_rows(clip, view, scene[i].world_from_mesh), view);
      Aabb bounds;
      for (const TreeNode& cluster : clusters[i])
        bounds.grow(cluster.bounds.min), bounds.grow(cluster.bounds.max);
      const BoxTest test(grid, bounds);
      Footprint where;
      for (const TreeNode& cluster : clusters[i]) {
        if (!test.may_show(cluster.bounds, where)) continue;
        mean.clusters += 1.0 / kMaps;
        mean.triangles += cluster.index_count / 3.0 / kMaps;
      }
    }
  }
  return mean;
}

void print_row(const char* name, const std::vector<Placed>& scene, const MakeClusters& make) {
  std::vector<Clusters> clusters;
  double best_s = 1e30;
  for (int round = 0; round < kRounds; ++round) {
    clusters.clear();
    const auto start = std::chrono::steady_clock::now();
    for (const Placed& placed : scene) clusters.push_back(make(placed.mesh));
    best_s =
        std::min(best_s, std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  size_t count = 0;
  for (const Clusters& of_mesh : clusters) count += of_mesh.size();
  const Survivors seen = survivors(scene, clusters);
  std::printf("  %-20s %8zu clusters  %7.1f survive with %9.1f triangles  made in %7.1f ms\n", name, count,
              seen.clusters, seen.triangles, 1e3 * best_s);
}

void compare(const char* title, const std::vector<Placed>& scene) {
  size_t triangles = 0;
  for (const Placed& placed : scene) triangles += placed.mesh.indices.size() / 3;
  std::printf("%s: %zu meshes, %zu triangles\n", title, scene.size(), triangles);
  print_row("tree builder", scene, by_tree_builder);
  print_row("meshlets", scene, by_meshlets);
  print_row("spatial sort", scene, by_spatial_sort);
}

std::vector<Placed> placed_city() {
  GeometryStore store;
  const auto asset = read_gltf(scenes::make_city({}), nullptr, store).value();
  const std::vector<Affine> world_from_node = rest_world_from_node(*asset);
  std::vector<Placed> scene;
  for (size_t i = 0; i < asset->nodes.size(); ++i) {
    if (asset->nodes[i].mesh < 0) continue;
    const Geometry& geometry = *asset->meshes[static_cast<size_t>(asset->nodes[i].mesh)];
    scene.push_back({{geometry.positions, geometry.indices}, world_from_node[i]});
  }
  return scene;
}

// As a tool that merges everything would export it, the triangles in the order of the meshes.
Placed merged(const std::vector<Placed>& scene) {
  Placed all{{}, identity_affine()};
  for (const Placed& placed : scene) {
    const auto first = static_cast<uint32_t>(all.mesh.positions.size());
    for (const glm::vec3& p : placed.mesh.positions)
      all.mesh.positions.emplace_back(transform_point(placed.world_from_mesh, glm::dvec3(p)));
    for (const uint32_t index : placed.mesh.indices) all.mesh.indices.push_back(first + index);
  }
  return all;
}

}  // namespace
}  // namespace sightline

int main() {
  using namespace sightline;
  const std::vector<Placed> city = placed_city();
  compare("city, mesh by mesh", city);
  compare("city as one mesh", {merged(city)});
}
