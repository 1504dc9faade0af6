#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "server/scene/mirror.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

constexpr double kPi = std::numbers::pi;

glm::dquat about_y(double angle) {
  return {std::cos(angle / 2), 0, std::sin(angle / 2), 0};
}

// A scene made by hand: node 0 and so on in the order of add().
class InstantiateTest : public ::testing::Test {
 protected:
  InstantiateTest() {
    // A wedge without symmetry, so that a wrong frame shows.
    MeshData wedge;
    wedge.positions = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}};
    wedge.indices = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    asset.meshes = {store.intern(wedge).value(), store.intern(tessellate(BoxShape{}).value()).value()};
    asset.mesh_names = {"wedge", "box"};
  }

  int add(const std::string& name, int parent, int mesh, const glm::dvec3& t = {0, 0, 0},
          const glm::dquat& r = {1, 0, 0, 0}, const glm::dvec3& s = {1, 1, 1}) {
    AssetNode node;
    node.name = name, node.parent = parent, node.mesh = mesh;
    node.translation_m = t, node.rotation = r, node.scale = s;
    node.parent_from_node = make_affine(t, r, s);
    asset.nodes.push_back(node);
    return static_cast<int>(asset.nodes.size()) - 1;
  }

  std::vector<NewInstance> run(const std::vector<NodeBinding>& bindings = {}) {
    auto made = instantiate(asset, bindings, store);
    EXPECT_TRUE(made) << (made ? "" : to_string(made.error()));
    return made ? *made : std::vector<NewInstance>{};
  }

  void expect_refused(const std::vector<NodeBinding>& bindings, ErrorCode code, const std::string& field) {
    const auto made = instantiate(asset, bindings, store);
    ASSERT_FALSE(made) << field;
    EXPECT_EQ(made.error().code, code);
    EXPECT_EQ(made.error().field, field);
  }

  GeometryStore store;
  SceneAsset asset;
};

// The corners of an instance's triangles in the world, as sorted triples.
std::vector<std::array<std::array<double, 3>, 3>> world_triangles(const NewInstance& i) {
  std::vector<std::array<std::array<double, 3>, 3>> triangles;
  const auto& g = *i.geometry;
  for (size_t k = 0; k < g.indices.size(); k += 3) {
    std::array<std::array<double, 3>, 3> corners;
    for (size_t c = 0; c < 3; ++c) {
      const glm::dvec3 p = i.pose.position_m + i.pose.rotation * (i.linear * glm::dvec3(g.positions[g.indices[k + c]]));
      for (int axis = 0; axis < 3; ++axis) corners[c][axis] = std::round(p[axis] * 1e4) / 1e4 + 0.0;
    }
    // Start at the smallest corner, keeping the winding.
    std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
    triangles.push_back(corners);
  }
  std::sort(triangles.begin(), triangles.end());
  return triangles;
}

double signed_volume(const NewInstance& i) {
  double volume = 0;
  for (size_t k = 0; k < i.geometry->indices.size(); k += 3) {
    const auto corner = [&](size_t c) {
      return i.linear * glm::dvec3(i.geometry->positions[i.geometry->indices[k + c]]);
    };
    volume += glm::dot(corner(0), glm::cross(corner(1), corner(2))) / 6;
  }
  return volume;
}

TEST_F(InstantiateTest, EveryDrawableBecomesAnInstanceWithItsFileNumber) {
  add("root", -1, -1);
  add("a", 0, 0, {1, 0, 0});
  add("b", 0, 1, {2, 0, 0});
  const auto made = run();
  ASSERT_EQ(made.size(), 2u);
  EXPECT_EQ(made[0].id, kAssetIdBit | 0);
  EXPECT_EQ(made[1].id, kAssetIdBit | 1);
  EXPECT_EQ(made[0].geometry, asset.meshes[0]);
  EXPECT_EQ(made[1].pose.position_m, glm::dvec3(2, 0, 0));
  EXPECT_FALSE(made[0].moving);
}

TEST_F(InstantiateTest, TheMirrorTakesTheResult) {
  add("a", -1, 0, {1, 2, 3}, about_y(1), {1, -2, 3});
  add("b", 0, 1, {1, 2, 3}, about_y(2), {3, 1, 0.1});
  SceneDelta delta;
  delta.add = run({{"b", 7}});
  delta.asset_ids_allowed = true;
  SceneMirror mirror;
  EXPECT_TRUE(mirror.apply(delta, {}));
  EXPECT_EQ(mirror.size(), 2u);
}

TEST_F(InstantiateTest, ABoundNodeMovesAsOneRigidBodyInItsOwnFrame) {
  add("car", -1, 0, {10, 0, 5}, about_y(kPi / 2));
  add("wheel", 0, 1, {1, 0, 0});
  add("cap", 1, 1, {0, 2, 0}, about_y(0.3), {0.1, 0.1, 0.1});
  const auto made = run({{"car", 42}});
  ASSERT_EQ(made.size(), 1u);
  EXPECT_EQ(made[0].id, 42u);
  EXPECT_EQ(made[0].pose.position_m, glm::dvec3(10, 0, 5));
  EXPECT_LT(angle_between(made[0].pose.rotation, about_y(kPi / 2)), 1e-9);
  EXPECT_EQ(made[0].linear, glm::dmat3(1.0));
  EXPECT_EQ(made[0].geometry->triangle_count(), 4u + 12 + 12);
}

TEST_F(InstantiateTest, BindingMovesNothingInTheWorld) {
  // Scale above, below and at the bound node; uneven, so that the children are sheared.
  add("root", -1, -1, {1, 2, 3}, about_y(0.4), {1, 2, 0.5});
  add("body", 0, 0, {4, 5, 6}, about_y(-1.1), {2, 1, 3});
  add("arm", 1, 0, {1, 0, 0}, about_y(0.7), {1, 1.5, 1});
  std::vector<std::array<std::array<double, 3>, 3>> apart;
  for (const NewInstance& i : run()) {
    const auto t = world_triangles(i);
    apart.insert(apart.end(), t.begin(), t.end());
  }
  std::sort(apart.begin(), apart.end());
  const auto bound = run({{"body", 1}});
  ASSERT_EQ(bound.size(), 1u);
  const auto together = world_triangles(bound[0]);
  ASSERT_EQ(together.size(), apart.size());
  for (size_t i = 0; i < apart.size(); ++i)
    for (size_t c = 0; c < 3; ++c)
      for (size_t axis = 0; axis < 3; ++axis) EXPECT_NEAR(together[i][c][axis], apart[i][c][axis], 2e-4);
  EXPECT_EQ(bound[0].linear, glm::dmat3(1.0));
  EXPECT_LT(angle_between(bound[0].pose.rotation, about_y(0.4 - 1.1)), 1e-9);
}

TEST_F(InstantiateTest, AMirroredNodeStillFacesOutwardWhenBaked) {
  add("left hand", -1, 0, {0, 0, 0}, about_y(0.5), {-1, 1, 1});
  EXPECT_LT(signed_volume(run()[0]), 0);  // as an instance: the linear map mirrors, drawing is two-sided
  EXPECT_NEAR(signed_volume(run({{"left hand", 1}})[0]), 1.0, 1e-6);
}

TEST_F(InstantiateTest, AnUnscaledNodeSharesTheGeometryOfTheFile) {
  add("a", -1, 0, {7, 0, 0}, about_y(1));
  add("b", -1, 0, {8, 0, 0}, about_y(2));
  const auto made = run({{"a", 1}, {"b", 2}});
  EXPECT_EQ(made[0].geometry, asset.meshes[0]);
  EXPECT_EQ(made[1].geometry, asset.meshes[0]);
  EXPECT_EQ(store.live_count(), 2u);
}

TEST_F(InstantiateTest, EquallyScaledNodesShareOneBakedGeometry) {
  add("a", -1, 0, {0, 0, 0}, {1, 0, 0, 0}, {2, 2, 2});
  add("b", -1, 0, {0, 0, 0}, {1, 0, 0, 0}, {2, 2, 2});
  const auto made = run({{"a", 1}, {"b", 2}});
  EXPECT_EQ(made[0].geometry, made[1].geometry);
}

TEST_F(InstantiateTest, ANestedBindingTakesItsSubtreeAway) {
  add("tank", -1, 1);
  add("turret", 0, 0, {0, 1, 0});
  add("gun", 1, 1, {0, 0, -1});
  const auto made = run({{"turret", 2}, {"tank", 1}});
  ASSERT_EQ(made.size(), 2u);
  EXPECT_EQ(made[0].id, 2u);
  EXPECT_EQ(made[0].geometry->triangle_count(), 4u + 12);
  EXPECT_EQ(made[1].id, 1u);
  EXPECT_EQ(made[1].geometry->triangle_count(), 12u);
}

TEST_F(InstantiateTest, AssetIdsDoNotDependOnTheBindings) {
  for (const char* name : {"a", "b", "c"}) add(name, -1, 0);
  const auto made = run({{"b", 5}});
  ASSERT_EQ(made.size(), 3u);
  EXPECT_EQ(made[0].id, 5u);
  EXPECT_EQ(made[1].id, kAssetIdBit | 0);
  EXPECT_EQ(made[2].id, kAssetIdBit | 2);
}

TEST_F(InstantiateTest, GpuInstancesStandEachForThemselvesOrAreMergedWhenBound) {
  const int trees = add("trees", -1, 0, {100, 0, 0});
  for (int i = 0; i < 3; ++i) asset.nodes[trees].gpu_instances.push_back(make_affine({i, 0, 0}, about_y(i), {1, 2, 1}));
  add("rock", -1, 1);
  const auto made = run();
  ASSERT_EQ(made.size(), 4u);
  EXPECT_EQ(made[2].id, kAssetIdBit | 2);
  EXPECT_EQ(made[2].pose.position_m, glm::dvec3(102, 0, 0));
  EXPECT_LT(angle_between(made[2].pose.rotation, about_y(2)), 1e-9);
  EXPECT_EQ(made[2].geometry, asset.meshes[0]);
  EXPECT_EQ(made[3].id, kAssetIdBit | 3);
  EXPECT_EQ(run({{"trees", 1}})[0].geometry->triangle_count(), 12u);
}

TEST_F(InstantiateTest, AZeroScaleFlattensOrLeavesOut) {
  add("gone", -1, 0, {0, 0, 0}, {1, 0, 0, 0}, {0, 0, 0});
  add("flat", -1, 0, {0, 0, 0}, about_y(1), {1, 0, 1});
  const auto made = run();
  ASSERT_EQ(made.size(), 1u);
  EXPECT_EQ(made[0].id, kAssetIdBit | 1);
  EXPECT_TRUE(is_valid_linear(made[0].linear));
  for (const auto& triangle : world_triangles(made[0]))
    for (const auto& corner : triangle) EXPECT_EQ(corner[1], 0.0);
  expect_refused({{"gone", 1}}, ErrorCode::kInvalidArgument, "bindings[0].node");
}

TEST_F(InstantiateTest, AShearedMatrixIsKeptAndItsPoseIsRigid) {
  const int node = add("sheared", -1, 0);
  asset.nodes[node].parent_from_node = compose(make_affine({1, 2, 3}, about_y(0.8), {1, 1, 1}),
                                               Affine({1, 0, 0}, {0.5, 1, 0}, {0, 0, 2}, {0, 0, 0}));
  const auto made = run();
  EXPECT_LT(angle_between(made[0].pose.rotation, about_y(0.8)), 1e-9);
  EXPECT_NEAR(made[0].linear[1].x, 0.5, 1e-12);
  EXPECT_NEAR(made[0].linear[2].z, 2.0, 1e-12);
}

TEST_F(InstantiateTest, PartsOfABoundNodeKeepWhatOneInstanceCanSay) {
  const int car = add("car", -1, 0), window = add("window", car, 1, {0, 1, 0}), lamp = add("lamp", car, 1);
  asset.nodes[car].attributes.layers = 8;
  asset.nodes[window].attributes.opacity = 0.2f;
  asset.nodes[lamp].attributes.visible = false;
  const auto made = run({{"car", 1}});
  EXPECT_EQ(made[0].attributes, asset.nodes[car].attributes);
  EXPECT_EQ(made[0].geometry->occluding_index_count, 3u * 4);
  EXPECT_EQ(made[0].geometry->triangle_count(), 4u + 12);
}

TEST_F(InstantiateTest, AHiddenBoundNodeIsAHiddenInstanceWithItsGeometry) {
  asset.nodes.clear();
  asset.nodes.reserve(1);
  asset.nodes[static_cast<size_t>(add("spare", -1, 0))].attributes.visible = false;
  const auto made = run({{"spare", 1}});
  EXPECT_FALSE(made[0].attributes.visible);
  EXPECT_EQ(made[0].geometry->triangle_count(), 4u);
}

TEST_F(InstantiateTest, BadBindingsAreRefusedByField) {
  add("empty", -1, -1);
  add("twin", -1, 0);
  add("twin", -1, 0);
  add("a", -1, 0);
  expect_refused({{"a", 1}, {"nobody", 2}}, ErrorCode::kNotFound, "bindings[1].node");
  expect_refused({{"twin", 1}}, ErrorCode::kInvalidArgument, "bindings[0].node");
  expect_refused({{"empty", 1}}, ErrorCode::kInvalidArgument, "bindings[0].node");
  expect_refused({{"a", 1}, {"a", 2}}, ErrorCode::kInvalidArgument, "bindings[1].node");
  expect_refused({{"a", 0}}, ErrorCode::kInvalidArgument, "bindings[0].id");
  expect_refused({{"a", kAssetIdBit | 1}}, ErrorCode::kInvalidArgument, "bindings[0].id");
  expect_refused({{"a", 1}, {"empty", 1}}, ErrorCode::kInvalidArgument, "bindings[1].id");
}

TEST_F(InstantiateTest, AnEmptySceneHasNoInstances) {
  EXPECT_TRUE(run().empty());
}

}  // namespace
}  // namespace sightline
