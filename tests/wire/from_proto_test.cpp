// What a message says arrives; what it does not say has the default.
#include "server/wire/from_proto.h"

#include <gmock/gmock.h>

#include <cmath>

#include "server/sample/extent.h"
#include "tests/wire/from_proto_fixture.h"

namespace sightline::test {
namespace {

void expect_near(const glm::dvec3& got, const glm::dvec3& expected, double tolerance = 1e-9) {
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(got[i], expected[i], tolerance) << "component " << i;
}

TEST_F(FromProto, AbsentSettingsAreTheDefaultsOfTheStructs) {
  const SessionOptions options = must_read(make_open());
  EXPECT_EQ(options.settings.bound.horizon_s, BoundSettings{}.horizon_s);
  EXPECT_EQ(options.settings.sample.resolution, SampleSettings{}.resolution);
  EXPECT_EQ(options.settings.sample.jitter, SampleSettings{}.jitter);
  EXPECT_EQ(options.settings.aggregate.candidates, AggregateSettings{}.candidates);
  EXPECT_EQ(options.settings.move.max_distance_m, MoveSettings{}.max_distance_m);
  EXPECT_EQ(options.settings.framing.aim_response_s, FramingSettings{}.aim_response_s);
  EXPECT_EQ(options.limits.max_speed_mps, CameraLimits{}.max_speed_mps);
  EXPECT_EQ(options.lens.vertical_fov_rad, Lens{}.vertical_fov_rad);
  EXPECT_EQ(options.lens.aspect, Lens{}.aspect);
  EXPECT_EQ(options.instances[0].attributes, InstanceAttributes{});
  EXPECT_EQ(options.targets[0].weight, Target{}.weight);
  EXPECT_EQ(options.targets[0].layer_mask, Target{}.layer_mask);
  EXPECT_FALSE(options.targets[0].aim_offset_m.has_value());
}

TEST_F(FromProto, EverySettingArrives) {
  v1::OpenSession open = make_open();
  v1::Settings& s = *open.mutable_settings();
  tuning::v1alpha1::Tuning& t = *open.mutable_tuning();
  t.mutable_bound()->set_mode(tuning::v1alpha1::BOUND_MODE_PAPER);
  t.mutable_bound()->set_horizon_s(0.6), t.mutable_bound()->set_max_horizon_s(1.1), t.mutable_bound()->set_paper_n(55);
  t.mutable_sample()->set_resolution(9), t.mutable_sample()->set_jitter(false);
  t.mutable_aggregate()->set_volume(tuning::v1alpha1::VOLUME_PAIR);
  t.mutable_aggregate()->set_candidates(99), t.mutable_aggregate()->set_relative_bias(0.02);
  s.set_follow(v1::Settings::FOLLOW_STAY);
  s.set_min_distance_m(2), s.set_max_distance_m(20);
  s.set_min_elevation_rad(-0.1), s.set_max_elevation_rad(0.9);
  s.set_framing_margin(0.2), s.set_dead_zone(0.3), s.set_aim_response_s(1);
  s.set_min_vertical_fov_rad(0.4), s.set_max_vertical_fov_rad(1.2);
  v1::CameraLimits& l = *open.mutable_limits();
  l.set_max_speed_mps(3), l.set_max_acceleration_mps2(4), l.set_max_angular_speed_radps(5);
  l.set_max_angular_acceleration_radps2(6), l.set_body_radius_m(0.7);
  open.set_seed(42), open.set_label("arena"), open.mutable_diagnostics()->set_candidates(true);

  const SessionOptions o = must_read(open);
  EXPECT_EQ(o.settings.bound.mode, BoundMode::kPaper);
  EXPECT_EQ(o.settings.bound.horizon_s, 0.6);
  EXPECT_EQ(o.settings.bound.max_horizon_s, 1.1);
  EXPECT_EQ(o.settings.bound.paper_n, 55);
  EXPECT_EQ(o.settings.sample.resolution, 9);
  EXPECT_FALSE(o.settings.sample.jitter);
  EXPECT_EQ(o.settings.aggregate.volume, Volume::kPair);
  EXPECT_EQ(o.settings.aggregate.candidates, 99);
  EXPECT_EQ(o.settings.aggregate.relative_bias, 0.02);
  EXPECT_EQ(o.settings.move.follow, Follow::kStay);
  EXPECT_EQ(o.settings.move.min_distance_m, 2);
  EXPECT_EQ(o.settings.move.max_distance_m, 20);
  EXPECT_EQ(o.settings.move.min_elevation_rad, -0.1);
  EXPECT_EQ(o.settings.move.max_elevation_rad, 0.9);
  EXPECT_EQ(o.settings.framing.framing_margin, 0.2);
  EXPECT_EQ(o.settings.framing.dead_zone, 0.3);
  EXPECT_EQ(o.settings.framing.aim_response_s, 1);
  EXPECT_EQ(o.settings.framing.min_vertical_fov_rad, 0.4);
  EXPECT_EQ(o.settings.framing.max_vertical_fov_rad, 1.2);
  EXPECT_EQ(o.limits.max_speed_mps, 3);
  EXPECT_EQ(o.limits.max_acceleration_mps2, 4);
  EXPECT_EQ(o.limits.max_angular_speed_radps, 5);
  EXPECT_EQ(o.limits.max_angular_acceleration_radps2, 6);
  EXPECT_EQ(o.limits.body_radius_m, 0.7);
  EXPECT_EQ(o.seed, 42u);
  EXPECT_EQ(o.label, "arena");
  EXPECT_TRUE(o.diagnostics.candidates);
  EXPECT_FALSE(o.diagnostics.depth_maps);
}

TEST_F(FromProto, AnUnrealClientIsUnderstood) {
  v1::OpenSession open = make_open();
  open.mutable_convention()->set_preset(v1::Convention::PRESET_UNREAL);
  open.mutable_lens()->set_field_of_view(90);
  set(open.mutable_world_origin(), 1000, 0, 0);
  open.clear_instances(), open.clear_targets();
  v1::NewInstance& box = *open.add_instances();
  box.set_id(7);
  set(box.mutable_shape()->mutable_box()->mutable_half_extent(), 50, 100, 200);
  set(box.mutable_scale(), 2, 3, 4);
  set(box.mutable_pose()->mutable_position(), 1100, 200, 300);
  set(open.mutable_camera()->mutable_position(), 1000, 0, 150);
  open.add_targets()->set_id(7);
  set(open.mutable_targets(0)->mutable_aim_offset(), 0, 0, 80);

  const SessionOptions o = must_read(open);
  expect_near(o.instances[0].pose.position_m, {1, 3, 2});
  expect_near(glm::dvec3(o.instances[0].geometry->bounds.half_extent()), {0.5, 2, 1}, 1e-6);
  expect_near({o.instances[0].linear[0][0], o.instances[0].linear[1][1], o.instances[0].linear[2][2]}, {2, 4, 3});
  expect_near(o.camera.position_m, {0, 1.5, 0});
  expect_near(o.camera.rotation * glm::dvec3(0, 0, -1), {1, 0, 0});
  expect_near(*o.targets[0].aim_offset_m, {0, 0.8, 0});
  EXPECT_NEAR(o.lens.vertical_fov_rad, 2 * std::atan(9.0 / 16), 1e-9);
}

TEST_F(FromProto, TheIdsOfATargetArriveInTheirOrder) {
  v1::OpenSession open = make_open();
  v1::Target& target = *open.mutable_targets(0);
  for (const uint64_t id : {9, 8}) target.add_attached_ids(id);
  target.add_ignored_ids(7);
  for (const uint64_t id : {6, 4, 5}) target.add_part_ids(id);
  const Target read = must_read(open).targets[0];
  EXPECT_EQ(read.attached_ids, (std::vector<uint64_t>{9, 8}));
  EXPECT_EQ(read.ignored_ids, std::vector<uint64_t>{7});
  EXPECT_EQ(read.part_ids, (std::vector<uint64_t>{6, 4, 5}));
}

TEST_F(FromProto, ACapsuleStandsAlongTheClientsUpAxis) {
  for (const auto preset : {v1::Convention::PRESET_GLTF, v1::Convention::PRESET_UNITY, v1::Convention::PRESET_UNREAL,
                            v1::Convention::PRESET_ROS}) {
    v1::OpenSession open = make_open();
    open.mutable_convention()->set_preset(preset);
    v1::NewInstance& instance = *open.mutable_instances(0);
    const double unit = preset == v1::Convention::PRESET_UNREAL ? 100 : 1;
    instance.mutable_shape()->mutable_capsule()->set_radius(0.25 * unit);
    instance.mutable_shape()->mutable_capsule()->set_half_height(0.75 * unit);
    open.mutable_instances(1)->mutable_shape()->mutable_capsule()->set_radius(unit);
    open.mutable_instances(1)->mutable_shape()->mutable_capsule()->set_half_height(0);
    const SessionOptions o = must_read(open);
    expect_near(glm::dvec3(o.instances[0].geometry->bounds.half_extent()), {0.25, 1, 0.25}, 1e-5);
  }
}

// In every convention: half a metre to glTF's +X and one up.
TEST_F(FromProto, AnOffsetMovesTheShapeInItsInstance) {
  for (const auto preset : {v1::Convention::PRESET_GLTF, v1::Convention::PRESET_UNITY, v1::Convention::PRESET_UNREAL,
                            v1::Convention::PRESET_ROS}) {
    v1::OpenSession open = make_open();
    open.mutable_convention()->set_preset(preset);
    const double unit = preset == v1::Convention::PRESET_UNREAL ? 100 : 1;
    v1::Shape& shape = *open.mutable_instances(0)->mutable_shape();
    shape.mutable_sphere()->set_radius(0.25 * unit);
    switch (preset) {
      case v1::Convention::PRESET_UNITY:
        set(shape.mutable_offset(), -0.5, 1, 0);
        break;
      case v1::Convention::PRESET_UNREAL:
        set(shape.mutable_offset(), 50, 0, 100);
        break;
      case v1::Convention::PRESET_ROS:
        set(shape.mutable_offset(), 0, 0.5, 1);
        break;
      default:
        set(shape.mutable_offset(), 0.5, 1, 0);
    }
    open.mutable_instances(1)->mutable_shape()->mutable_sphere()->set_radius(unit);
    const SessionOptions o = must_read(open);
    expect_near(glm::dvec3(o.instances[0].geometry->bounds.center()), {0.5, 1, 0}, 1e-5);
    expect_near(glm::dvec3(o.instances[0].geometry->bounds.half_extent()), {0.25, 0.25, 0.25}, 1e-5);
  }
}

// A body 1 m above its instance, of a box and a capsule that lies along Unity's x axis.
TEST_F(FromProto, ACompoundIsOneMeshOfItsParts) {
  v1::OpenSession open = make_open();
  open.mutable_convention()->set_preset(v1::Convention::PRESET_UNITY);
  v1::Shape& body = *open.mutable_instances(0)->mutable_shape();
  v1::Shape::Part &trunk = *body.mutable_compound()->add_parts(), &arm = *body.mutable_compound()->add_parts();
  set(body.mutable_offset(), 0, 1, 0);
  set(trunk.mutable_shape()->mutable_box()->mutable_half_extent(), 0.2, 0.5, 0.1);
  arm.mutable_shape()->mutable_capsule()->set_radius(0.1);
  arm.mutable_shape()->mutable_capsule()->set_half_height(0.4);
  set(arm.mutable_shape()->mutable_offset(), 0.7, 0.3, 0);
  arm.mutable_rotation()->set_z(std::sqrt(0.5)), arm.mutable_rotation()->set_w(std::sqrt(0.5));
  const Aabb bounds = must_read(open).instances[0].geometry->bounds;
  expect_near(glm::dvec3(bounds.min), {-1.2, 0.5, -0.1}, 1e-5);
  expect_near(glm::dvec3(bounds.max), {0.2, 1.5, 0.1}, 1e-5);
}

TEST_F(FromProto, ACustomConventionIsLikeThePresetThatItSpellsOut) {
  v1::OpenSession custom = make_open(), preset = make_open();
  preset.mutable_convention()->set_preset(v1::Convention::PRESET_UNITY);
  custom.mutable_convention()->set_preset(v1::Convention::PRESET_CUSTOM);
  v1::CustomConvention& c = *custom.mutable_convention()->mutable_custom();
  c.set_x(v1::CustomConvention::AXIS_MINUS_X), c.set_y(v1::CustomConvention::AXIS_PLUS_Y),
      c.set_z(v1::CustomConvention::AXIS_PLUS_Z);
  c.set_camera_forward(v1::CustomConvention::AXIS_PLUS_Z), c.set_camera_up(v1::CustomConvention::AXIS_PLUS_Y);
  c.set_metres_per_unit(1), c.set_degrees(true);
  const Convention a = must_read(custom).convention, b = must_read(preset).convention;
  EXPECT_EQ(a.canonical_from_client, b.canonical_from_client);
  EXPECT_EQ(a.camera_forward, b.camera_forward);
  EXPECT_EQ(a.camera_up, b.camera_up);
  EXPECT_EQ(a.metres_per_unit, b.metres_per_unit);
  EXPECT_EQ(a.degrees, b.degrees);
  EXPECT_EQ(a.horizontal_fov, b.horizontal_fov);
}

TEST_F(FromProto, ASceneFileComesFirstAndIsMovedToTheWorldOrigin) {
  v1::OpenSession open = make_open();
  open.mutable_scene()->set_name("town.glb");
  v1::NodeBinding& cart = *open.mutable_scene()->add_bindings();
  cart.set_node("cart"), cart.set_id(50);
  set(open.mutable_world_origin(), 4, 0, 0);
  const SessionOptions o = must_read(open);
  ASSERT_EQ(o.scene_instances, 2u);
  ASSERT_EQ(o.instances.size(), 4u);
  EXPECT_TRUE(o.scene);
  EXPECT_EQ(o.instances[0].id, 50u);
  expect_near(o.instances[0].pose.position_m, {-4, 0, 20});
  EXPECT_EQ(o.instances[1].id, kAssetIdBit | 0);
  expect_near(o.instances[1].pose.position_m, {6, 0, 0});
  EXPECT_EQ(o.instances[2].id, 1u);
}

// A corner of an instance's triangle in the world: the town's triangles have corners at (0, 0, 0), (1, 0, 0) and (0, 1,
// 0).
glm::dvec3 far_corner_m(const NewInstance& instance) {
  return transform_point(instance.pose, instance.linear * glm::dvec3(1, 0, 0));
}

TEST_F(FromProto, ASceneFileHasAUnitOfItsOwn) {
  v1::OpenSession open = make_open();
  open.mutable_scene()->set_name("town.glb");
  v1::NodeBinding& cart = *open.mutable_scene()->add_bindings();
  cart.set_node("cart"), cart.set_id(50);
  open.mutable_convention()->set_preset(v1::Convention::PRESET_UNREAL);
  const SessionOptions metres = must_read(open);
  expect_near(metres.instances[1].pose.position_m, {10, 0, 0});  // the convention's centimetres do not apply
  open.mutable_scene()->set_metres_per_unit(0.01);
  const SessionOptions centimetres = must_read(open);
  expect_near(centimetres.instances[0].pose.position_m, {0, 0, 0.2});
  expect_near(far_corner_m(centimetres.instances[0]), {0.01, 0, 0.2});
  expect_near(centimetres.instances[1].pose.position_m, {0.1, 0, 0});
  expect_near(far_corner_m(centimetres.instances[1]), {0.11, 0, 0});
  set(open.mutable_world_origin(), 400, 0, 0);  // 4 m
  expect_near(must_read(open).instances[1].pose.position_m, {-3.9, 0, 0});
}

TEST_F(FromProto, SizesThatCannotBeRightAreWarnedOf) {
  using testing::ElementsAre, testing::HasSubstr, testing::IsEmpty;
  const auto warnings_of = [this](double metres_per_unit, double radius_m) {
    v1::OpenSession open = make_open();
    open.mutable_scene()->set_name("town.glb");
    open.mutable_scene()->set_metres_per_unit(metres_per_unit);
    for (v1::NewInstance& person : *open.mutable_instances())
      person.mutable_shape()->mutable_capsule()->set_radius(radius_m);
    warnings.clear();
    must_read(open);
    return warnings;
  };
  // The town is 20 m long.
  EXPECT_THAT(warnings_of(1, 0.3), IsEmpty());
  EXPECT_THAT(warnings_of(99, 0.3), IsEmpty());
  EXPECT_THAT(warnings_of(101, 0.3), ElementsAre(HasSubstr("open.scene.metres_per_unit")));
  EXPECT_THAT(warnings_of(0.051, 0.3), IsEmpty());
  EXPECT_THAT(warnings_of(0.049, 0.3), ElementsAre(HasSubstr("less than 1 m")));
  EXPECT_THAT(warnings_of(1, 30), ElementsAre(HasSubstr("open.targets")));
  EXPECT_THAT(warnings_of(1, 24), IsEmpty());
}

TEST_F(FromProto, WarningsOfTheSceneFileAreTold) {
  GlbBuilder file;
  const int house = file.triangle_node();
  file.json["meshes"][file.json["nodes"][house]["mesh"].get<int>()]["primitives"][0]["mode"] = 1;  // lines
  const auto bytes = file.glb();
  std::ofstream(folder / "lines.glb", std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  v1::OpenSession open = make_open();
  open.mutable_scene()->set_name("lines.glb");
  must_read(open);
  EXPECT_THAT(warnings, testing::Contains(testing::HasSubstr("points and lines are skipped")));
}

TEST_F(FromProto, AnObservedCameraTurnsByTheClientsHandedness) {
  v1::Tick wire = make_tick(1);
  wire.mutable_observed_camera()->mutable_pose();
  set(wire.mutable_observed_camera()->mutable_angular_velocity(), 1, 2, 3);
  SessionOptions unity;
  unity.convention = unity_convention();
  const glm::dvec3 read = must_read(wire, unity).observed_camera->angular_velocity_radps;
  expect_near(read, {1, -2, -3});  // Unity's x is mirrored, and an axial vector changes sign under a mirror
  expect_near(angular_velocity_to_client(unity.convention, read), {1, 2, 3});
}

TEST_F(FromProto, AnObservedVelocityIsInTheClientsUnitAndAxes) {
  v1::Tick wire = make_tick(1);
  wire.mutable_observed_camera()->mutable_pose();
  set(wire.mutable_observed_camera()->mutable_velocity(), 100, 200, 300);
  v1::OpenSession open = make_open();
  open.mutable_convention()->set_preset(v1::Convention::PRESET_UNREAL);
  open.clear_instances(), open.clear_targets();
  SessionOptions unreal;
  unreal.convention = must_read(open).convention;
  // Unreal's z is up.
  expect_near(must_read(wire, unreal).observed_camera->velocity_mps, {1, 3, 2});
}

TEST_F(FromProto, AMeshOfAFileIsFoundByNameAndByHash) {
  v1::OpenSession open = make_open();
  open.mutable_instances(0)->mutable_mesh()->set_scene_name("town.glb");
  open.mutable_instances(0)->mutable_mesh()->set_mesh("gable");
  const SessionOptions by_name = must_read(open);
  ASSERT_EQ(by_name.mesh_assets.size(), 1u);
  open.mutable_instances(0)->mutable_mesh()->set_scene_hash(to_hex(by_name.mesh_assets[0]->hash));
  EXPECT_EQ(must_read(open).instances[0].geometry, by_name.instances[0].geometry);
}

TEST_F(FromProto, ATickArrivesWhole) {
  v1::Tick wire = make_tick(9);
  wire.set_dt_s(0.5);
  wire.mutable_transforms()->set_rotations(6, 1.0009f), wire.mutable_transforms()->set_rotations(7, 0);
  v1::SceneDelta& delta = *wire.mutable_delta();
  delta.set_base_revision(3);
  delta.add_removed_ids(8);
  *delta.add_added_instances() = make_open().instances(0);
  delta.add_changed_instances()->set_id(2);
  delta.mutable_changed_instances(0)->mutable_attributes()->set_opacity(0.5f);
  wire.mutable_targets();
  wire.mutable_observed_camera()->mutable_pose();
  wire.mutable_observed_camera()->set_cut(true);
  wire.mutable_lens()->set_near_m(0.2);
  SessionOptions unity;
  unity.convention = unity_convention();
  const TickInput tick = must_read(wire, unity);
  EXPECT_EQ(tick.sequence, 9u);
  EXPECT_EQ(tick.time_s, 9.0 / 64);
  EXPECT_EQ(tick.dt_s, 0.5);
  expect_near(tick.transforms.poses[0].position_m, {1, 1, 0});  // Unity's x is mirrored
  expect_near(tick.transforms.velocities_mps[1], {-1, 0, 0});
  EXPECT_NEAR(glm::length(tick.transforms.poses[1].rotation), 1, 1e-12);
  EXPECT_FALSE(tick.keeps_rotations);
  EXPECT_EQ(tick.delta.base_revision, 3u);
  EXPECT_EQ(tick.delta.remove, std::vector<uint64_t>{8});
  EXPECT_EQ(tick.delta.add.size(), 1u);
  EXPECT_FALSE(tick.delta.asset_ids_allowed);
  EXPECT_EQ(tick.delta.change[0].attributes.opacity, 0.5f);
  EXPECT_EQ(tick.delta.change[0].attributes.layers, InstanceAttributes{}.layers);
  EXPECT_TRUE(tick.targets && tick.targets->empty());
  EXPECT_TRUE(tick.observed_camera->cut);
  EXPECT_EQ(tick.lens->near_m, 0.2);
}

// Instances 1 and 2 are targets whose shape has a table already; the sphere 3 and the box 4 are none, and have none.
class SlowTicks : public FromProto {
 protected:
  std::unique_ptr<Session> session_of(ExtentCache* extents, int points, const std::vector<uint64_t>& parts = {}) {
    v1::OpenSession open = make_open();
    for (const uint64_t id : {3, 4}) {
      open.add_instances()->set_id(id);
      v1::Shape& shape = *open.mutable_instances(open.instances_size() - 1)->mutable_shape();
      if (id == 3) shape.mutable_sphere()->set_radius(0.4);
      if (id == 4) set(shape.mutable_box()->mutable_half_extent(), 0.1, 0.2, 0.3);
    }
    for (const uint64_t part : parts) open.mutable_targets(0)->add_part_ids(part);
    SessionOptions options = must_read(open);
    options.extents = extents;
    options.settings.sample.points = points;
    auto session = Session::open(std::move(options), nullptr, nullptr);
    if (!session) throw std::runtime_error(to_string(session.error()));
    return std::move(*session);
  }
  static v1::Tick tick_with_targets(const std::vector<uint64_t>& ids, const std::vector<uint64_t>& parts = {}) {
    v1::Tick tick = make_tick(1);
    for (const uint64_t id : ids) tick.mutable_targets()->add_targets()->set_id(id);
    for (const uint64_t part : parts) tick.mutable_targets()->mutable_targets(0)->add_part_ids(part);
    return tick;
  }
  static v1::Tick tick_with_points(uint32_t points) {
    v1::Tick tick = make_tick(1);
    tick.mutable_tuning()->mutable_sample()->set_points(points);
    return tick;
  }
};

TEST_F(SlowTicks, BuildTheTableOfATargetThatHasNone) {
  ExtentCache cache;
  const auto session = session_of(&cache, 1);
  const auto slow = [&](const v1::Tick& tick) { return takes_long(tick, *session, library); };
  EXPECT_FALSE(slow(make_tick(1)));
  EXPECT_FALSE(slow(tick_with_targets({})));
  EXPECT_FALSE(slow(tick_with_targets({2, 1})));
  EXPECT_FALSE(slow(tick_with_targets({99}))) << "no such instance, which is found out soon";
  EXPECT_TRUE(slow(tick_with_targets({1, 3})));
  EXPECT_FALSE(slow(tick_with_targets({1}, {2})));
  EXPECT_TRUE(slow(tick_with_targets({1}, {2, 4})));
  EXPECT_FALSE(slow(tick_with_points(3)));
  v1::Tick without_points = tick_with_targets({1, 3});
  without_points.mutable_tuning()->mutable_sample()->set_points(0);
  EXPECT_FALSE(slow(without_points)) << "only aim points are sampled";
  v1::Tick wrong = tick_with_targets({1, 3});
  wrong.mutable_settings()->set_preset(static_cast<v1::Settings::Preset>(77));
  EXPECT_FALSE(slow(wrong)) << "it is refused";
}

TEST_F(SlowTicks, BuildTheTablesOfAllTargetsWhenSurfacePointsComeOn) {
  ExtentCache cache;
  auto session = session_of(&cache, 0);
  EXPECT_FALSE(takes_long(make_tick(1), *session, library));
  EXPECT_FALSE(takes_long(tick_with_targets({1, 3}), *session, library)) << "no points are sampled";
  EXPECT_TRUE(takes_long(tick_with_points(1), *session, library));
  const auto other = session_of(&cache, 1);  // makes the tables of the targets
  EXPECT_FALSE(takes_long(tick_with_points(1), *session, library));
  session = session_of(&cache, 0, {4});
  EXPECT_TRUE(takes_long(tick_with_points(1), *session, library)) << "a part has none";
  session = session_of(nullptr, 0);
  EXPECT_FALSE(takes_long(tick_with_points(1), *session, library)) << "without tables";
}

TEST_F(SlowTicks, ReadASceneFileThatIsNotLoaded) {
  const auto session = session_of(nullptr, 0);
  v1::Tick tick = make_tick(1);
  const auto slow = [&] { return takes_long(tick, *session, library); };
  *tick.mutable_delta()->add_added_instances() = make_open().instances(0);
  EXPECT_FALSE(slow());
  v1::MeshRef& mesh = *tick.mutable_delta()->add_added_instances()->mutable_mesh();
  mesh.set_scene_hash(std::string(32, '0'));
  EXPECT_FALSE(slow()) << "an upload is there or not";
  mesh.set_scene_name("town.glb");
  EXPECT_TRUE(slow());
  const auto loaded = library.load_named("town.glb");
  ASSERT_TRUE(loaded.has_value());
  EXPECT_FALSE(slow());
  tick.mutable_delta()->add_added_instances()->mutable_mesh()->set_scene_name("other.glb");
  EXPECT_TRUE(slow());
}

TEST_F(FromProto, RotationsAndVelocitiesMayBeLeftOut) {
  v1::Tick wire = make_tick(1);
  wire.mutable_transforms()->clear_rotations(), wire.mutable_transforms()->clear_velocities();
  const TickInput tick = must_read(wire);
  EXPECT_TRUE(tick.keeps_rotations);
  EXPECT_TRUE(tick.transforms.velocities_mps.empty());
  EXPECT_FALSE(tick.targets.has_value());
}

}  // namespace
}  // namespace sightline::test
