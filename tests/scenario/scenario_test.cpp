// Scenarios: roles out of node extras, and motion against plain interpolation.
#include "client/scenario/scenario.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "client/scenario/scenario_limits.h"
#include "client/scenario/scenario_session.h"
#include "scenes/glb_writer.h"
#include "server/scene/gltf.h"
#include "server/scene/mirror.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

Json role(const std::string& name) {
  return {{"sightline", {{"role", name}}}};
}

// A hand-made asset: a camera and the nodes that a test adds.
struct Asset {
  std::shared_ptr<SceneAsset> asset = std::make_shared<SceneAsset>();

  Asset() { add("eye", role("camera")); }
  int add(const std::string& name, const Json& extras, int parent = -1) {
    AssetNode node;
    node.name = name;
    node.parent = parent;
    if (!extras.is_null()) node.extras_json = extras.dump();
    asset->nodes.push_back(node);
    return static_cast<int>(asset->nodes.size()) - 1;
  }
  void place(int node, const glm::dvec3& at, const glm::dquat& rotation, const glm::dvec3& scale) {
    AssetNode& n = asset->nodes[node];
    n.translation_m = at, n.rotation = rotation, n.scale = scale;
    n.parent_from_node = make_affine(at, rotation, scale);
  }
  AssetChannel& animate(int node, AssetChannel::Path path, std::vector<float> times, std::vector<float> values) {
    if (asset->animations.empty()) asset->animations.push_back({"scenario", 0.0, {}});
    AssetAnimation& animation = asset->animations.front();
    animation.duration_s = std::max<double>(animation.duration_s, times.back());
    animation.channels.push_back(
        {node, path, AssetChannel::Interpolation::kLinear, std::move(times), std::move(values)});
    return animation.channels.back();
  }
  Result<Scenario> read() const { return Scenario::from_asset(asset); }
};

std::string field_of_failure(const Asset& asset) {
  const auto scenario = asset.read();
  return scenario ? "no error" : scenario.error().field;
}

double angle_deg(const glm::dquat& a, const glm::dquat& b) {
  return angle_between(a, b) * 180 / std::numbers::pi;
}

glm::dquat turn(double degrees, const glm::dvec3& axis) {
  return glm::angleAxis(degrees * std::numbers::pi / 180, glm::normalize(axis));
}

TEST(ScenarioRoles, ActorsAreNumberedFromOneInFileOrder) {
  Asset asset;
  asset.add("wall", nullptr);
  asset.add("anna", {{"sightline", {{"role", "target"}, {"weight", 2.5}, {"required", 0}}}});
  asset.add("cart", role("occluder"));
  asset.add("ben", role("target"));
  const auto scenario = asset.read();
  ASSERT_TRUE(scenario) << to_string(scenario.error());
  ASSERT_EQ(scenario->actors().size(), 3u);
  EXPECT_EQ(scenario->actors()[0].id, 1u);
  EXPECT_EQ(scenario->actors()[0].weight, 2.5);
  EXPECT_FALSE(scenario->actors()[0].required);
  EXPECT_EQ(scenario->actors()[1].name, "cart");
  EXPECT_FALSE(scenario->actors()[1].is_target);
  ASSERT_EQ(scenario->targets().size(), 2u);
  EXPECT_EQ(scenario->targets()[1].id, 3u);
  EXPECT_TRUE(scenario->targets()[1].required);
  EXPECT_EQ(scenario->targets()[1].weight, 1.0);
}

TEST(ScenarioRoles, ExtrasOfOtherToolsAreLeftAlone) {
  Asset asset;
  asset.add("a", {{"role", "boss"}, {"hp", 100}});
  asset.add("b", {{"sightline", {{"layers", 4}}}});
  asset.add("c", {{"sightline", 7}});
  asset.add("d", Json::array({1, 2}));
  const auto scenario = asset.read();
  ASSERT_TRUE(scenario) << to_string(scenario.error());
  EXPECT_TRUE(scenario->actors().empty());
}

TEST(ScenarioRoles, WrongOnesNameTheNodeAndTheKey) {
  const auto with = [](const Json& extras) {
    Asset asset;
    asset.add("anna", {{"sightline", extras}});
    return field_of_failure(asset);
  };
  EXPECT_EQ(with({{"role", "hero"}}), "nodes[anna].extras.sightline.role");
  EXPECT_EQ(with({{"role", 7}}), "nodes[anna].extras.sightline.role");
  EXPECT_EQ(with({{"role", "target"}, {"weight", -1}}), "nodes[anna].extras.sightline.weight");
  EXPECT_EQ(with({{"role", "target"}, {"weight", "much"}}), "nodes[anna].extras.sightline.weight");
  EXPECT_EQ(with({{"role", "target"}, {"required", 2}}), "nodes[anna].extras.sightline.required");
  EXPECT_EQ(with({{"role", "camera"}}), "nodes[anna].extras.sightline.role") << "a second camera";
}

TEST(ScenarioRoles, AnActorNeedsANameOfItsOwn) {
  Asset unnamed, twice;
  unnamed.add("", role("target"));
  EXPECT_EQ(field_of_failure(unnamed), "nodes[].extras.sightline.role");
  twice.add("anna", role("target"));
  twice.add("anna", nullptr);
  EXPECT_EQ(field_of_failure(twice), "nodes[anna].extras.sightline.role");
}

TEST(ScenarioRoles, AFileWithoutACameraIsNoScenario) {
  Asset asset;
  asset.asset->nodes.clear();
  asset.add("anna", role("target"));
  EXPECT_EQ(field_of_failure(asset), "nodes");
}

TEST(ScenarioCamera, HasThePlaceAndTheLensOfItsNode) {
  Asset asset;
  asset.place(0, {1, 2, 3}, turn(30, {0, 1, 0}), {2, 2, 2});
  asset.asset->nodes[0].camera = 0;
  asset.asset->cameras.push_back({0.9, 1.5, 0.25});
  const auto scenario = asset.read();
  ASSERT_TRUE(scenario);
  EXPECT_LT(glm::distance(scenario->camera().position_m, glm::dvec3(1, 2, 3)), 1e-12);
  EXPECT_LT(angle_deg(scenario->camera().rotation, turn(30, {0, 1, 0})), 1e-5);
  EXPECT_EQ(scenario->lens().vertical_fov_rad, 0.9);
  EXPECT_EQ(scenario->lens().aspect, 1.5);
  EXPECT_EQ(scenario->lens().near_m, 0.25);
}

TEST(ScenarioMotion, PositionsAreLinearBetweenKeysAndStayOutsideThem) {
  Asset asset;
  const int anna = asset.add("anna", role("target"));
  asset.animate(anna, AssetChannel::Path::kTranslation, {1, 2, 4}, {0, 0, 0, 4, 0, 2, 4, 6, 2});
  const auto scenario = asset.read();
  ASSERT_TRUE(scenario);
  EXPECT_EQ(scenario->duration_s(), 4.0);
  for (double t = -1; t < 6; t += 0.037) {
    glm::dvec3 expected;
    if (t <= 1)
      expected = {0, 0, 0};
    else if (t <= 2)
      expected = glm::mix(glm::dvec3(0), glm::dvec3(4, 0, 2), t - 1);
    else if (t <= 4)
      expected = glm::mix(glm::dvec3(4, 0, 2), glm::dvec3(4, 6, 2), (t - 2) / 2);
    else
      expected = {4, 6, 2};
    EXPECT_LT(glm::distance(scenario->poses_at(t)[0].position_m, expected), 1e-6) << t;
  }
}

TEST(ScenarioMotion, RotationsTakeTheShortWayAtConstantSpeed) {
  Asset asset;
  const int anna = asset.add("anna", role("target"));
  const glm::dquat to = -turn(100, {1, 2, 3});  // the other sign of the same rotation: the long way if taken as it is
  asset.animate(anna, AssetChannel::Path::kRotation, {0, 2},
                {0, 0, 0, 1, float(to.x), float(to.y), float(to.z), float(to.w)});
  const auto scenario = asset.read();
  ASSERT_TRUE(scenario);
  for (double t = 0; t <= 2; t += 0.1)
    EXPECT_LT(angle_deg(scenario->poses_at(t)[0].rotation, turn(50 * t, {1, 2, 3})), 1e-3) << t;
}

TEST(ScenarioMotion, PosesComposeDownTheHierarchy) {
  Asset asset;
  const int cart = asset.add("cart", role("occluder"));
  const int anna = asset.add("anna", role("target"), cart);
  asset.place(anna, {0, 1, -2}, turn(90, {0, 1, 0}), {1, 1, 1});
  asset.animate(cart, AssetChannel::Path::kTranslation, {0, 10}, {0, 0, 0, 10, 0, 0});
  asset.animate(cart, AssetChannel::Path::kRotation, {0, 10},
                {0, 0, 0, 1, 0, float(std::sqrt(0.5)), 0, float(std::sqrt(0.5))});
  const auto scenario = asset.read();
  ASSERT_TRUE(scenario);
  for (double t = 0; t <= 10; t += 0.5) {
    const glm::dquat yaw = turn(9 * t, {0, 1, 0});
    const Pose pose = scenario->poses_at(t)[1];
    EXPECT_LT(glm::distance(pose.position_m, glm::dvec3(t, 0, 0) + yaw * glm::dvec3(0, 1, -2)), 1e-5) << t;
    EXPECT_LT(angle_deg(pose.rotation, yaw * turn(90, {0, 1, 0})), 1e-3) << t;
  }
}

TEST(ScenarioMotion, ScaleAndMirroringLeaveTheRotationAlone) {
  Asset asset;
  const int anna = asset.add("anna", role("target"));
  asset.place(anna, {0, 0, 0}, turn(20, {0, 0, 1}), {2, 3, -0.5});
  const glm::dquat q = turn(70, {0, 1, 1});
  const glm::dquat p = turn(20, {0, 0, 1});
  asset.animate(anna, AssetChannel::Path::kRotation, {0, 1},
                {float(p.x), float(p.y), float(p.z), float(p.w), float(q.x), float(q.y), float(q.z), float(q.w)});
  const auto scenario = asset.read();
  ASSERT_TRUE(scenario);
  EXPECT_LT(angle_deg(scenario->poses_at(0)[0].rotation, p), 1e-3);
  EXPECT_LT(angle_deg(scenario->poses_at(1)[0].rotation, q), 1e-3);
}

TEST(ScenarioMotion, VelocityIsTheSlopeOfThePathAndZeroAtRest) {
  Asset asset;
  const int anna = asset.add("anna", role("target"));
  asset.animate(anna, AssetChannel::Path::kTranslation, {0, 2}, {0, 0, 0, 6, 0, -2});
  const auto scenario = asset.read();
  ASSERT_TRUE(scenario);
  const glm::dvec3 slope(3, 0, -1);
  for (const double t : {0.0, 0.004, 1.0, 1.999, 2.0})
    EXPECT_LT(glm::distance(scenario->motion_at(t, 1.0 / 60)[0].velocity_mps, slope), 1e-4) << t;
  EXPECT_EQ(glm::length(scenario->motion_at(3.0, 1.0 / 60)[0].velocity_mps), 0.0);
}

// At a corner of the path, as much time before it counts as after it.
TEST(ScenarioMotion, VelocityAtACornerIsTheMeanOfBothSlopes) {
  Asset asset;
  const int anna = asset.add("anna", role("target"));
  asset.animate(anna, AssetChannel::Path::kTranslation, {0, 1, 2}, {0, 0, 0, 1, 0, 0, 4, 0, 0});
  const auto scenario = asset.read();
  ASSERT_TRUE(scenario);
  EXPECT_LT(glm::distance(scenario->motion_at(1.0, 0.1)[0].velocity_mps, glm::dvec3(2, 0, 0)), 1e-4);
}

TEST(ScenarioMotion, WithoutAnAnimationEveryoneStands) {
  Asset asset;
  const int anna = asset.add("anna", role("target"));
  asset.place(anna, {1, 2, 3}, turn(45, {0, 1, 0}), {1, 1, 1});
  const auto scenario = asset.read();
  ASSERT_TRUE(scenario);
  EXPECT_EQ(scenario->duration_s(), 0.0);
  const ActorMotion motion = scenario->motion_at(5.0, 0.1)[0];
  EXPECT_LT(glm::distance(motion.pose.position_m, glm::dvec3(1, 2, 3)), 1e-12);
  EXPECT_EQ(glm::length(motion.velocity_mps), 0.0);
}

// A file: the bound instance of the mirror and the player must speak of the same frame.
TEST(ScenarioFile, RestPosesAreThoseOfTheBoundInstances) {
  scenes::GlbWriter writer;
  const int box = writer.add_mesh("box", *tessellate(BoxShape{}), {1, 1, 1});
  writer.add_node({"eye", -1, -1, writer.add_camera(0.7, 1.6, 0.1), {0, 1, 5}, {1, 0, 0, 0}, role("camera")});
  const int root = writer.add_node({"root", -1, -1, -1, {4, 0, 1}, turn(35, {1, 1, 0}), nullptr});
  const int anna = writer.add_node({"anna", root, box, -1, {0, 2, 0}, turn(-80, {0, 0, 1}), role("target")});
  writer.animate(anna, std::vector<float>{0, 1}, std::vector<glm::vec3>{{0, 2, 0}, {1, 2, 0}},
                 std::vector<glm::quat>{glm::quat(turn(-80, {0, 0, 1})), glm::quat(1, 0, 0, 0)});
  GeometryStore store;
  const auto asset = read_gltf(writer.finish("scenario"), nullptr, store);
  ASSERT_TRUE(asset) << to_string(asset.error());
  const auto scenario = Scenario::from_asset(*asset);
  ASSERT_TRUE(scenario) << to_string(scenario.error());
  const std::vector<NodeBinding> bindings{{"anna", 1}};
  const auto instances = instantiate(**asset, bindings, store);
  ASSERT_TRUE(instances) << to_string(instances.error());
  const Pose played = scenario->poses_at(0.0)[0];
  EXPECT_LT(glm::distance(played.position_m, instances->front().pose.position_m), 1e-5);
  EXPECT_LT(angle_deg(played.rotation, instances->front().pose.rotation), 1e-3);
}

Result<CameraLimits> limits_with(const Json& extras) {
  Json camera = {{"role", "camera"}};
  camera.update(extras);
  Asset asset;
  asset.asset->nodes.clear();
  asset.add("eye", {{"sightline", camera}});
  return limits_of(*asset.read());
}

TEST(ScenarioLimits, AreThoseOfTheCameraNode) {
  const auto plain = limits_with(Json::object());
  ASSERT_TRUE(plain);
  EXPECT_EQ(plain->max_speed_mps, CameraLimits{}.max_speed_mps);
  EXPECT_EQ(plain->max_acceleration_mps2, CameraLimits{}.max_acceleration_mps2);
  const auto fast = limits_with({{"max_speed_mps", 40}, {"max_acceleration_mps2", 20.5}});
  ASSERT_TRUE(fast);
  EXPECT_EQ(fast->max_speed_mps, 40);
  EXPECT_EQ(fast->max_acceleration_mps2, 20.5);
  EXPECT_EQ(fast->body_radius_m, CameraLimits{}.body_radius_m);
}

TEST(ScenarioLimits, ThatAreNoNumberOrOutOfRangeAreRefusedByName) {
  EXPECT_EQ(limits_with({{"max_speed_mps", "fast"}}).error().field, "nodes[eye].extras.sightline.max_speed_mps");
  const auto below = limits_with({{"max_acceleration_mps2", -1}});
  ASSERT_FALSE(below);
  EXPECT_EQ(below.error().field, "nodes[eye].extras.sightline");
  EXPECT_NE(below.error().message.find("max_acceleration_mps2"), std::string::npos);
}

TEST(ScenarioMessages, TheOpenRequestBindsAllActorsAndListsTheTargets) {
  Asset asset;
  asset.add("cart", role("occluder"));
  asset.add("anna", {{"sightline", {{"role", "target"}, {"weight", 0.5}, {"required", false}}}});
  asset.add("ben", role("target"));
  asset.place(0, {1, 2, 3}, turn(30, {0, 1, 0}), {1, 1, 1});
  asset.asset->nodes[0].camera = 0;
  asset.asset->cameras.push_back({0.9, 1.5, 0.25});
  const auto scenario = asset.read();
  ASSERT_TRUE(scenario);
  const v1::OpenSession open = open_request(*scenario, "abc", 9);
  EXPECT_EQ(open.convention().preset(), v1::Convention::PRESET_GLTF);
  EXPECT_EQ(open.seed(), 9u);
  EXPECT_EQ(open.scene().hash(), "abc");
  ASSERT_EQ(open.scene().bindings_size(), 3);
  const char* const nodes[] = {"cart", "anna", "ben"};
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(open.scene().bindings(i).node(), nodes[i]);
    EXPECT_EQ(open.scene().bindings(i).id(), static_cast<uint64_t>(i) + 1);
  }
  ASSERT_EQ(open.targets_size(), 2);
  EXPECT_EQ(open.targets(0).id(), 2u);
  EXPECT_EQ(open.targets(0).weight(), 0.5);
  EXPECT_TRUE(open.targets(0).has_required());
  EXPECT_FALSE(open.targets(0).required());
  EXPECT_EQ(open.targets(1).id(), 3u);
  EXPECT_TRUE(open.targets(1).required());
  EXPECT_LT(glm::distance(pose_from(open.camera()).position_m, glm::dvec3(1, 2, 3)), 1e-12);
  EXPECT_LT(angle_deg(pose_from(open.camera()).rotation, turn(30, {0, 1, 0})), 1e-5);
  EXPECT_EQ(open.lens().field_of_view(), 0.9);
  EXPECT_EQ(open.lens().aspect(), 1.5);
  EXPECT_EQ(open.lens().near_m(), 0.25);
}

TEST(ScenarioTargets, OnesForAPartOfTheTimeFollowTheirSpans) {
  Asset asset;
  const int anna = asset.add("anna", {{"sightline", {{"role", "target"}, {"during", {{0, 1}, {2, 9}}}}}});
  asset.add("ben", {{"sightline", {{"role", "target"}, {"weight", 2}, {"during", {{1, 2.5}}}}}});
  asset.animate(anna, AssetChannel::Path::kTranslation, {0, 3}, {0, 0, 0, 1, 0, 0});
  const auto scenario = asset.read();
  ASSERT_TRUE(scenario) << to_string(scenario.error());
  EXPECT_EQ(scenario->target_changes_s(), (std::vector<double>{1, 2, 2.5}));
  const auto ids = [&](double time_s) {
    std::vector<uint64_t> found;
    for (const ScenarioActor& actor : scenario->actors())
      if (actor.is_target_at(time_s)) found.push_back(actor.id);
    return found;
  };
  EXPECT_EQ(ids(0), (std::vector<uint64_t>{1}));
  EXPECT_EQ(ids(0.999), (std::vector<uint64_t>{1}));
  EXPECT_EQ(ids(1), (std::vector<uint64_t>{2}));
  EXPECT_EQ(ids(2), (std::vector<uint64_t>{1, 2}));
  EXPECT_EQ(ids(2.5), (std::vector<uint64_t>{1}));
  EXPECT_TRUE(scenario->targets_change(0.9, 1));
  EXPECT_FALSE(scenario->targets_change(1, 1.9));

  const v1::OpenSession open = open_request(*scenario, "abc", 9);
  ASSERT_EQ(open.targets_size(), 1);
  EXPECT_EQ(open.targets(0).id(), 1u);
  for (int k = 1; k <= 30; ++k) {
    const v1::Tick tick = tick_at(*scenario, static_cast<uint64_t>(k), k / 10.0, 0.1);
    ASSERT_EQ(tick.has_targets(), k == 10 || k == 20 || k == 25) << k;
    if (k == 10) {
      ASSERT_EQ(tick.targets().targets_size(), 1);
      EXPECT_EQ(tick.targets().targets(0).id(), 2u);
      EXPECT_EQ(tick.targets().targets(0).weight(), 2);
    }
    if (k == 20) {
      EXPECT_EQ(tick.targets().targets_size(), 2);
    }
  }
}

TEST(ScenarioTargets, SpansThatAreNoneOrLeaveNobodyAreRefused) {
  const auto with = [](const Json& during) {
    Asset asset;
    const int anna = asset.add("anna", {{"sightline", {{"role", "target"}, {"during", during}}}});
    asset.animate(anna, AssetChannel::Path::kTranslation, {0, 5}, {0, 0, 0, 1, 0, 0});
    return field_of_failure(asset);
  };
  const std::string field = "nodes[anna].extras.sightline.during";
  EXPECT_EQ(with(Json::array({Json::array({0, 6})})), "no error");
  EXPECT_EQ(with(3), field);
  EXPECT_EQ(with(Json::array()), field);
  EXPECT_EQ(with(Json::array({0, 6})), field);
  EXPECT_EQ(with(Json::array({Json::array({2, 1})})), field);
  EXPECT_EQ(with(Json::array({Json::array({0, 3}), Json::array({2, 6})})), field) << "they overlap";
  EXPECT_EQ(with(Json::array({Json::array({0, "6"})})), field);
  EXPECT_EQ(with(Json::array({Json::array({0, 4})})), "nodes") << "nobody from 4 s on";
}

TEST(ScenarioMessages, ATickHoldsParallelArraysOfAllActors) {
  Asset asset;
  const int anna = asset.add("anna", role("target"));
  asset.add("ben", role("target"));
  asset.animate(anna, AssetChannel::Path::kTranslation, {0, 1}, {0, 0, 0, 2, 4, 6});
  const auto scenario = asset.read();
  ASSERT_TRUE(scenario);
  const v1::Tick tick = tick_at(*scenario, 12, 0.5, 0.1);
  EXPECT_EQ(tick.sequence(), 12u);
  EXPECT_EQ(tick.time_s(), 0.5);
  ASSERT_EQ(tick.transforms().ids_size(), 2);
  ASSERT_EQ(tick.transforms().positions_size(), 6);
  ASSERT_EQ(tick.transforms().rotations_size(), 8);
  ASSERT_EQ(tick.transforms().velocities_size(), 6);
  EXPECT_NEAR(tick.transforms().positions(1), 2.0, 1e-6);
  EXPECT_EQ(tick.transforms().rotations(3), 1.0f);
  EXPECT_NEAR(tick.transforms().velocities(2), 6.0, 1e-4);
}

}  // namespace
}  // namespace sightline
