// The writer's files, read by the server's reader.
#include "scenes/glb_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "scenes/shapes.h"
#include "server/scene/gltf.h"

namespace sightline::scenes {
namespace {

std::shared_ptr<const SceneAsset> read(const GlbWriter& writer, GeometryStore& store) {
  const auto asset = read_gltf(writer.finish("play"), nullptr, store);
  EXPECT_TRUE(asset) << (asset ? "" : to_string(asset.error()));
  return asset ? *asset : nullptr;
}

TEST(GlbWriter, SharesAMeshBetweenNodesAndKeepsTheHierarchy) {
  GlbWriter writer;
  const int box = writer.add_mesh("box", standing_box(1, 2, 3), {1, 0, 0});
  const int parent = writer.add_node({"parent", -1, box, -1, {1, 0, 0}, {1, 0, 0, 0}, {}});
  writer.add_node({"child", parent, box, -1, {0, 5, 0}, {1, 0, 0, 0}, {}});
  GeometryStore store;
  const auto asset = read(writer, store);
  ASSERT_EQ(asset->nodes.size(), 2u);
  EXPECT_EQ(asset->meshes.size(), 1u);
  EXPECT_EQ(asset->nodes[1].parent, 0);
  EXPECT_EQ(rest_world_from_node(*asset)[1][3], glm::dvec3(1, 5, 0));
  EXPECT_EQ(asset->triangle_count(), 24u);
  EXPECT_EQ(asset->meshes[0]->bounds.max, glm::vec3(0.5f, 2.0f, 1.5f));
}

TEST(GlbWriter, KeepsExtrasAndCameras) {
  GlbWriter writer;
  const int camera = writer.add_camera(0.5, 1.5, 0.25);
  GlbNode node{"eye", -1, -1, camera, {0, 1, 2}, {0.6, 0.8, 0, 0}, {}};
  node.extras = nlohmann::ordered_json::object({{"sightline", {{"role", "camera"}, {"weight", 2}}}});
  writer.add_node(node);
  GeometryStore store;
  const auto asset = read(writer, store);
  ASSERT_EQ(asset->cameras.size(), 1u);
  EXPECT_DOUBLE_EQ(asset->cameras[0].vertical_fov_rad, 0.5);
  EXPECT_DOUBLE_EQ(asset->cameras[0].near_m, 0.25);
  EXPECT_NEAR(asset->nodes[0].rotation.x, 0.8, 1e-7);
  EXPECT_EQ(nlohmann::json::parse(asset->nodes[0].extras_json)["sightline"]["weight"], 2);
}

TEST(GlbWriter, PlaysBackTheKeysThatItWasGiven) {
  GlbWriter writer;
  const int node = writer.add_node({"mover", -1, -1, -1, {}, {1, 0, 0, 0}, {}});
  const std::vector<float> times{0.0f, 2.0f};
  const std::vector<glm::vec3> positions{{0, 0, 0}, {4, 0, 0}};
  const std::vector<glm::quat> rotations{{1, 0, 0, 0}, {0, 0, 1, 0}};  // half a turn about +y
  writer.animate(node, times, positions, rotations);
  GeometryStore store;
  const auto asset = read(writer, store);
  ASSERT_EQ(asset->animations.size(), 1u);
  EXPECT_EQ(asset->animations[0].name, "play");
  EXPECT_EQ(asset->animations[0].duration_s, 2.0);
  const Affine halfway = animated_world_from_node(*asset, asset->animations[0], 1.0)[0];
  EXPECT_NEAR(glm::distance(halfway[3], glm::dvec3(2, 0, 0)), 0, 1e-6);
  EXPECT_NEAR(glm::distance(halfway[0], glm::dvec3(0, 0, -1)), 0, 1e-6);  // a quarter turn takes +x to -z
}

TEST(GlbWriter, UsesWideIndicesWhenAMeshNeedsThem) {
  MeshData mesh;
  for (int i = 0; i < 9000; ++i) append_box(mesh, {i, 0, 0}, {i + 0.5, 1, 1});  // 72,000 vertices
  GlbWriter writer;
  writer.add_node({"many", -1, writer.add_mesh("many", mesh, {1, 1, 1}), -1, {}, {1, 0, 0, 0}, {}});
  GeometryStore store;
  EXPECT_EQ(read(writer, store)->triangle_count(), 108'000u);
}

}  // namespace
}  // namespace sightline::scenes
