// Skinned meshes: the vertices are where the joints put them, by a plain reimplementation with 4 x 4 matrices.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <numeric>

#include "server/base/random.h"
#include "server/scene/gltf.h"
#include "server/scene/mirror.h"
#include "tests/support/glb_builder.h"

namespace sightline {
namespace {

using nlohmann::json;
using testing::HasSubstr;

json numbers(const glm::dmat4& matrix) {
  json list = json::array();
  for (int k = 0; k < 16; ++k) list.push_back(glm::value_ptr(matrix)[k]);
  return list;
}

// Rotation, even scale and translation by chance.
glm::dmat4 random_matrix(CounterRandom& random, double scale) {
  const glm::dvec3 axis = glm::normalize(
      glm::dvec3(random.next_in(-1, 1), random.next_in(-1, 1), random.next_in(0.1, 1)));
  const glm::dmat4 moved = glm::translate(
      glm::dmat4(1.0), glm::dvec3(random.next_in(-1, 1), random.next_in(-1, 1), random.next_in(-1, 1)));
  return moved * glm::rotate(glm::dmat4(1.0), random.next_in(-3, 3), axis) *
         glm::scale(glm::dmat4(1.0), glm::dvec3(scale));
}

class GltfSkinned : public testing::Test {
 protected:
  std::shared_ptr<const SceneAsset> load() {
    auto asset = read_gltf(file.glb(), nullptr, store);
    if (asset) return *asset;
    ADD_FAILURE() << to_string(asset.error());
    return std::make_shared<SceneAsset>();
  }
  Error load_error() {
    const auto asset = read_gltf(file.glb(), nullptr, store);
    return asset ? Error{ErrorCode::kInternal, "", "was read without an error"} : asset.error();
  }
  // The drawn vertices of a node, world.
  static std::vector<glm::dvec3> drawn(const SceneAsset& asset, const std::string& name) {
    std::vector<glm::dvec3> vertices;
    const std::vector<Affine> world = rest_world_from_node(asset);
    for (size_t i = 0; i < asset.nodes.size(); ++i)
      if (asset.nodes[i].name == name && asset.nodes[i].mesh >= 0)
        for (const glm::vec3& p : asset.meshes[static_cast<size_t>(asset.nodes[i].mesh)]->positions)
          vertices.push_back(transform_point(world[i], glm::dvec3(p)));
    return vertices;
  }

  // A body of `vertices` over a chain of joints, as files have them: an armature turned and scaled, the mesh below it
  // with a transform of its own, which does not count. Returns where each vertex belongs.
  struct Body {
    std::vector<glm::dvec3> expected;
    size_t node = 0;
  };
  Body add_body(CounterRandom& random, size_t joints, size_t vertices, double armature_scale) {
    const glm::dmat4 armature = random_matrix(random, armature_scale);
    std::vector<glm::dmat4> world{armature};
    const auto armature_node = static_cast<size_t>(
        file.add("nodes", {{"name", "armature"}, {"matrix", numbers(armature)}}));
    std::vector<size_t> nodes;
    std::vector<float> binds;
    std::vector<glm::dmat4> node_from_vertex;
    for (size_t k = 0; k < joints; ++k) {
      const glm::dmat4 own = random_matrix(random, 1.0), bind = random_matrix(random, 1 / armature_scale);
      world.push_back(world.back() * own);
      nodes.push_back(
          static_cast<size_t>(file.add("nodes", {{"name", "joint-" + std::to_string(k)}, {"matrix", numbers(own)}})));
      file.json["nodes"][k == 0 ? armature_node : nodes[k - 1]]["children"].push_back(nodes[k]);
      for (int n = 0; n < 16; ++n) binds.push_back(static_cast<float>(glm::value_ptr(bind)[n]));
      node_from_vertex.push_back(world.back() * bind);
    }
    std::vector<float> positions, weights;
    std::vector<uint16_t> which;
    Body body;
    for (size_t i = 0; i < vertices; ++i) {
      const glm::vec3 at(random.next_in(-1, 1), random.next_in(-1, 1), random.next_in(-1, 1));
      positions.insert(positions.end(), {at.x, at.y, at.z});
      std::array<float, 4> shares;
      for (float& share : shares) share = static_cast<float>(random.next_unit());
      const float sum = std::accumulate(shares.begin(), shares.end(), 0.0f);
      glm::dvec4 moved(0.0);
      for (int n = 0; n < 4; ++n) {
        const auto joint = static_cast<uint16_t>(random.next_below(static_cast<uint32_t>(joints)));
        which.push_back(joint), weights.push_back(shares[static_cast<size_t>(n)] / sum);
        moved += static_cast<double>(weights.back()) * (node_from_vertex[joint] * glm::dvec4(at, 1.0));
      }
      body.expected.emplace_back(moved);
    }
    const json attributes{{"POSITION", file.floats(positions)},
                          {"JOINTS_0", file.accessor(which, "VEC4", kUnsignedShort)},
                          {"WEIGHTS_0", file.accessor(weights, "VEC4", kFloat)}};
    const int skin = file.add("skins",
                              {{"joints", nodes}, {"inverseBindMatrices", file.accessor(binds, "MAT4", kFloat)}});
    const int mesh = file.add("meshes",
                              {{"name", "skin"}, {"primitives", json::array({{{"attributes", attributes}}})}});
    body.node = static_cast<size_t>(file.add(
        "nodes", {{"name", "body"}, {"mesh", mesh}, {"skin", skin}, {"matrix", numbers(random_matrix(random, 0.37))}}));
    file.json["nodes"][armature_node]["children"].push_back(body.node);
    file.json["scenes"] = json::array({{{"nodes", json::array({armature_node})}}});
    return body;
  }

  GlbBuilder file;
  GeometryStore store;
};

void expect_near(const std::vector<glm::dvec3>& found, const std::vector<glm::dvec3>& expected, double tolerance) {
  ASSERT_EQ(found.size(), expected.size());
  for (size_t i = 0; i < found.size(); ++i) EXPECT_LT(glm::distance(found[i], expected[i]), tolerance) << i;
}

TEST_F(GltfSkinned, VerticesAreWhereTheJointsPutThemWhateverTheNodesOwnTransformSays) {
  for (const double scale : {1.0, 0.01, 100.0}) {
    file = GlbBuilder();
    CounterRandom random(7, 0, RandomPurpose::kTest);
    const Body body = add_body(random, 5, 60, scale);
    const auto asset = load();
    expect_near(drawn(*asset, "body"), body.expected, 1e-4);
    EXPECT_TRUE(asset->warnings.empty());
  }
}

// Moving the armature moves the body with it.
TEST_F(GltfSkinned, ABodyMovesWithTheNodeThatIsBound) {
  CounterRandom random(8, 0, RandomPurpose::kTest);
  const Body body = add_body(random, 4, 30, 0.5);
  const auto asset = load();
  const NodeBinding binding{"armature", 5};
  auto instances = instantiate(*asset, std::span(&binding, 1), store);
  ASSERT_TRUE(instances.has_value());
  SceneMirror mirror;
  SceneDelta delta;
  delta.add = *instances, delta.asset_ids_allowed = true;
  ASSERT_TRUE(mirror.apply(delta, {}));
  const Instance& bound = *mirror.find(5);
  const Pose before = bound.pose;
  TransformUpdate update;
  update.ids = {5}, update.poses = {{before.position_m + glm::dvec3(10, 0, -3), before.rotation}};
  ASSERT_TRUE(mirror.apply({}, update));
  std::vector<glm::dvec3> found, expected;
  for (const glm::vec3& p : bound.geometry->positions)
    found.push_back(transform_point(bound.world_from_instance, glm::dvec3(p)));
  for (const glm::dvec3& p : body.expected) expected.push_back(p + glm::dvec3(10, 0, -3));
  expect_near(found, expected, 1e-4);
}

// Positions of whole numbers from 0 to 65535; only the bind matrix knows what they mean, as compressors write it.
TEST_F(GltfSkinned, QuantisedPositionsAreWhatTheBindMatrixMakesOfThem) {
  const glm::dmat4 bind = glm::translate(glm::dmat4(1.0), {-1, 0, 2}) *
                          glm::scale(glm::dmat4(1.0), glm::dvec3(2.0 / 65535));
  std::vector<float> columns;
  for (int n = 0; n < 16; ++n) columns.push_back(static_cast<float>(glm::value_ptr(bind)[n]));
  const int joint = file.add("nodes", {{"name", "joint"}, {"translation", {0, 5, 0}}});
  const json attributes{
      {"POSITION", file.accessor<uint16_t>({0, 0, 0, 65535, 0, 0, 0, 65535, 0}, "VEC3", kUnsignedShort)},
      {"JOINTS_0", file.accessor<uint8_t>({0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC4", kUnsignedByte)},
      {"WEIGHTS_0", file.accessor<uint8_t>({255, 0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0}, "VEC4", kUnsignedByte, true)}};
  const int skin = file.add("skins",
                            {{"joints", {joint}}, {"inverseBindMatrices", file.accessor(columns, "MAT4", kFloat)}});
  const int mesh = file.add("meshes", {{"primitives", json::array({{{"attributes", attributes}}})}});
  file.add("nodes", {{"name", "body"}, {"mesh", mesh}, {"skin", skin}});
  file.json["scenes"] = json::array({{{"nodes", {0, 1}}}});
  file.json["extensionsRequired"] = {"KHR_mesh_quantization"};
  expect_near(drawn(*load(), "body"), {{-1, 5, 2}, {1, 5, 2}, {-1, 7, 2}}, 1e-4);
}

// Each of two sets names one joint. A vertex without weights belongs to its first joint.
TEST_F(GltfSkinned, FurtherSetsCountAndVerticesWithoutWeightsBelongToTheirFirstJoint) {
  const int low = file.add("nodes", {{"translation", {0, 0, 0}}}),
            high = file.add("nodes", {{"translation", {0, 4, 0}}});
  const json attributes{
      {"POSITION", file.floats({0, 0, 0, 1, 0, 0, 0, 1, 0})},
      {"JOINTS_0", file.accessor<uint8_t>({0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0}, "VEC4", kUnsignedByte)},
      {"WEIGHTS_0", file.accessor<float>({1, 0, 0, 0, 0.25f, 0, 0, 0, 0, 0, 0, 0}, "VEC4", kFloat)},
      {"JOINTS_1", file.accessor<uint8_t>({0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0}, "VEC4", kUnsignedByte)},
      {"WEIGHTS_1", file.accessor<float>({0, 0, 0, 0, 0.75f, 0, 0, 0, 0, 0, 0, 0}, "VEC4", kFloat)}};
  const int skin = file.add("skins", {{"joints", {low, high}}});
  const int mesh = file.add("meshes", {{"primitives", json::array({{{"attributes", attributes}}})}});
  file.add("nodes", {{"name", "body"}, {"mesh", mesh}, {"skin", skin}});
  file.json["scenes"] = json::array({{{"nodes", {0, 1, 2}}}});
  expect_near(drawn(*load(), "body"), {{0, 0, 0}, {1, 3, 0}, {0, 5, 0}}, 1e-6);
}

TEST_F(GltfSkinned, WhatIsWrongIsNamed) {
  const auto body = [&] {
    file = GlbBuilder();
    CounterRandom random(9, 0, RandomPurpose::kTest);
    add_body(random, 3, 30, 1.0);
  };
  body();
  file.json["meshes"][0]["primitives"][0]["attributes"].erase("WEIGHTS_0");
  EXPECT_EQ(load_error().field, "meshes[0].primitives[0].attributes.WEIGHTS_0");
  body();
  file.json["skins"][0]["joints"].erase(2);
  EXPECT_THAT(load_error().field, HasSubstr("meshes[0].primitives[0].attributes.JOINTS_0["));
  body();
  file.json["skins"][0]["joints"].push_back(0);
  EXPECT_EQ(load_error().field, "skins[0].inverseBindMatrices");
  body();
  file.json["skins"][0]["joints"][0] = 99;
  EXPECT_EQ(load_error().field, "skins[0].joints[0]");
  body();
  file.json["skins"][0].erase("joints");
  EXPECT_EQ(load_error().field, "skins[0].joints");
}

// Joints outside the scene have no place.
TEST_F(GltfSkinned, ASkinThatCannotBeUsedIsLeftOutWithAWarning) {
  CounterRandom random(10, 0, RandomPurpose::kTest);
  const Body body = add_body(random, 3, 30, 1.0);
  file.json["scenes"] = json::array({{{"nodes", json::array({body.node})}}});
  auto& armature = file.json["nodes"][0]["children"];
  armature.erase(armature.size() - 1);
  const auto asset = load();
  EXPECT_EQ(drawn(*asset, "body").size(), body.expected.size());
  ASSERT_EQ(asset->warnings.size(), 1u);
  EXPECT_THAT(asset->warnings[0], HasSubstr(".skin: one of its joints is not in the scene"));
}

}  // namespace
}  // namespace sightline
