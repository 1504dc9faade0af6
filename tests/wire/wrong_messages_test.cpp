// A wrong message is refused, and the error names its field.
#include "server/wire/from_proto.h"

#include <cmath>
#include <limits>

#include "tests/wire/from_proto_fixture.h"

namespace sightline::test {
namespace {

using E = ErrorCode;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

// ---- wrong openings ----

struct WrongOpen {
  const char* field;
  ErrorCode code;
  void (*spoil)(v1::OpenSession&);
};
void PrintTo(const WrongOpen& wrong, std::ostream* out) {
  *out << wrong.field;
}

v1::NewInstance& first(v1::OpenSession& o) {
  return *o.mutable_instances(0);
}
v1::CustomConvention& custom(v1::OpenSession& o) {
  o.mutable_convention()->set_preset(v1::Convention::PRESET_CUSTOM);
  v1::CustomConvention& c = *o.mutable_convention()->mutable_custom();
  c.set_x(v1::CustomConvention::AXIS_PLUS_X), c.set_y(v1::CustomConvention::AXIS_PLUS_Y),
      c.set_z(v1::CustomConvention::AXIS_PLUS_Z);
  c.set_camera_forward(v1::CustomConvention::AXIS_MINUS_Z), c.set_camera_up(v1::CustomConvention::AXIS_PLUS_Y);
  c.set_metres_per_unit(1);
  return c;
}
template <typename Enum>
Enum unknown() {
  return static_cast<Enum>(99);
}

const WrongOpen kWrongOpens[] = {
    {"open.convention.preset", E::kInvalidArgument,
     [](v1::OpenSession& o) { o.mutable_convention()->set_preset(unknown<v1::Convention::Preset>()); }},
    {"open.convention.custom", E::kInvalidArgument,
     [](v1::OpenSession& o) { o.mutable_convention()->set_preset(v1::Convention::PRESET_CUSTOM); }},
    {"open.convention.custom", E::kInvalidArgument,
     [](v1::OpenSession& o) { o.mutable_convention()->mutable_custom(); }},
    {"open.convention.custom.y", E::kInvalidArgument,
     [](v1::OpenSession& o) { custom(o).set_y(v1::CustomConvention::AXIS_MINUS_X); }},
    {"open.convention.custom.z", E::kInvalidArgument, [](v1::OpenSession& o) { custom(o).clear_z(); }},
    {"open.convention.custom.x", E::kInvalidArgument,
     [](v1::OpenSession& o) { custom(o).set_x(unknown<v1::CustomConvention::Axis>()); }},
    {"open.convention.custom.camera_up", E::kInvalidArgument,
     [](v1::OpenSession& o) { custom(o).set_camera_up(v1::CustomConvention::AXIS_PLUS_Z); }},
    {"open.convention.custom.metres_per_unit", E::kInvalidArgument,
     [](v1::OpenSession& o) { custom(o).clear_metres_per_unit(); }},
    {"open.world_origin.y", E::kInvalidArgument, [](v1::OpenSession& o) { set(o.mutable_world_origin(), 0, kInf, 0); }},
    {"open.camera", E::kInvalidArgument, [](v1::OpenSession& o) { o.clear_camera(); }},
    {"open.camera.position.z", E::kInvalidArgument,
     [](v1::OpenSession& o) { o.mutable_camera()->mutable_position()->set_z(kNan); }},
    {"open.camera.rotation", E::kInvalidArgument, [](v1::OpenSession& o) { o.mutable_camera()->mutable_rotation(); }},
    {"open.camera.rotation", E::kInvalidArgument,
     [](v1::OpenSession& o) { o.mutable_camera()->mutable_rotation()->set_w(1.002); }},
    {"open.camera.rotation", E::kInvalidArgument,
     [](v1::OpenSession& o) { o.mutable_camera()->mutable_rotation()->set_w(kNan); }},
    {"open.lens.field_of_view", E::kInvalidArgument,
     [](v1::OpenSession& o) { o.mutable_lens()->set_field_of_view(3); }},
    {"open.lens.field_of_view", E::kInvalidArgument,
     [](v1::OpenSession& o) { o.mutable_lens()->set_field_of_view(-1); }},
    {"open.lens.field_of_view", E::kInvalidArgument,
     [](v1::OpenSession& o) { o.mutable_lens()->set_field_of_view(kNan); }},
    {"open.lens.field_of_view", E::kInvalidArgument,
     [](v1::OpenSession& o) {  // right as a width, but a tenth of it is left in height
       o.mutable_convention()->set_preset(v1::Convention::PRESET_UNREAL);
       o.mutable_lens()->set_field_of_view(0.7), o.mutable_lens()->set_aspect(10);
     }},
    {"open.lens.aspect", E::kInvalidArgument, [](v1::OpenSession& o) { o.mutable_lens()->set_aspect(0.05); }},
    {"open.lens.aspect", E::kInvalidArgument, [](v1::OpenSession& o) { o.mutable_lens()->set_aspect(kNan); }},
    {"open.lens.near_m", E::kInvalidArgument, [](v1::OpenSession& o) { o.mutable_lens()->set_near_m(-0.1); }},
    {"open.lens.near_m", E::kInvalidArgument, [](v1::OpenSession& o) { o.mutable_lens()->set_near_m(11); }},
    {"open.settings.preset", E::kInvalidArgument,
     [](v1::OpenSession& o) { o.mutable_settings()->set_preset(unknown<v1::Settings::Preset>()); }},
    {"open.tuning.bound.mode", E::kInvalidArgument,
     [](v1::OpenSession& o) { o.mutable_tuning()->mutable_bound()->set_mode(unknown<tuning::v1alpha1::BoundMode>()); }},
    {"open.tuning.aggregate.volume", E::kInvalidArgument,
     [](v1::OpenSession& o) {
       o.mutable_tuning()->mutable_aggregate()->set_volume(unknown<tuning::v1alpha1::Volume>());
     }},
    {"open.settings.follow", E::kInvalidArgument,
     [](v1::OpenSession& o) { o.mutable_settings()->set_follow(unknown<v1::Settings::Follow>()); }},
    {"open.settings.max_vertical_fov_rad", E::kInvalidArgument,
     [](v1::OpenSession& o) { o.mutable_settings()->set_min_vertical_fov_rad(0.5); }},
    {"open.settings.min_vertical_fov_rad", E::kInvalidArgument,
     [](v1::OpenSession& o) { o.mutable_settings()->set_max_vertical_fov_rad(0.5); }},
    {"open.settings.max_vertical_fov_rad", E::kInvalidArgument,
     [](v1::OpenSession& o) {
       o.mutable_settings()->set_min_vertical_fov_rad(0.6);
       o.mutable_settings()->set_max_vertical_fov_rad(0.5);
     }},
    {"open.settings.min_vertical_fov_rad", E::kInvalidArgument,
     [](v1::OpenSession& o) {
       o.mutable_settings()->set_min_vertical_fov_rad(0);
       o.mutable_settings()->set_max_vertical_fov_rad(0);
     }},
    {"open.label", E::kInvalidArgument, [](v1::OpenSession& o) { o.set_label(std::string(65, 'x')); }},
    {"open.targets[1].aim_offset.x", E::kInvalidArgument,
     [](v1::OpenSession& o) { set(o.mutable_targets(1)->mutable_aim_offset(), kNan, 0, 0); }},
    {"open.instances[0].id", E::kInvalidArgument, [](v1::OpenSession& o) { first(o).set_id(0); }},
    {"open.instances[0].id", E::kInvalidArgument, [](v1::OpenSession& o) { first(o).set_id(kAssetIdBit); }},
    {"open.instances[0].geometry", E::kInvalidArgument, [](v1::OpenSession& o) { first(o).clear_geometry(); }},
    {"open.instances[0].shape", E::kInvalidArgument, [](v1::OpenSession& o) { first(o).mutable_shape()->Clear(); }},
    {"open.instances[0].shape.offset.y", E::kInvalidArgument,
     [](v1::OpenSession& o) { first(o).mutable_shape()->mutable_offset()->set_y(2e5); }},
    {"open.instances[0].shape.offset", E::kInvalidArgument,
     [](v1::OpenSession& o) {  // single precision would make it a point
       first(o).mutable_shape()->mutable_sphere()->set_radius(1e-3);
       first(o).mutable_shape()->mutable_offset()->set_y(1e5);
     }},
    {"open.instances[0].shape.compound.parts[0].shape.offset", E::kInvalidArgument,
     [](v1::OpenSession& o) {
       first(o).mutable_shape()->mutable_compound()->add_parts()->mutable_shape()->mutable_sphere()->set_radius(1e-3);
       first(o).mutable_shape()->mutable_offset()->set_x(1e5);
     }},
    {"open.instances[0].shape.compound.parts", E::kInvalidArgument,
     [](v1::OpenSession& o) { first(o).mutable_shape()->mutable_compound(); }},
    {"open.instances[0].shape.compound.parts", E::kInvalidArgument,
     [](v1::OpenSession& o) {
       for (int i = 0; i < 65; ++i)
         first(o).mutable_shape()->mutable_compound()->add_parts()->mutable_shape()->mutable_sphere()->set_radius(1);
     }},
    {"open.instances[0].shape.compound.parts[0].shape", E::kInvalidArgument,
     [](v1::OpenSession& o) { first(o).mutable_shape()->mutable_compound()->add_parts(); }},
    {"open.instances[0].shape.compound.parts[0].shape.compound", E::kInvalidArgument,
     [](v1::OpenSession& o) {
       first(o).mutable_shape()->mutable_compound()->add_parts()->mutable_shape()->mutable_compound();
     }},
    {"open.instances[0].shape.compound.parts[0].rotation", E::kInvalidArgument,
     [](v1::OpenSession& o) {
       v1::Shape::Part& part = *first(o).mutable_shape()->mutable_compound()->add_parts();
       part.mutable_shape()->mutable_sphere()->set_radius(1);
       part.mutable_rotation()->set_w(2);
     }},
    {"open.instances[0].shape.capsule.radius", E::kInvalidArgument,
     [](v1::OpenSession& o) { first(o).mutable_shape()->mutable_capsule()->set_radius(0); }},
    {"open.instances[0].shape.capsule.radius", E::kInvalidArgument,
     [](v1::OpenSession& o) { first(o).mutable_shape()->mutable_capsule()->set_radius(kNan); }},
    {"open.instances[0].shape.capsule.half_height", E::kInvalidArgument,
     [](v1::OpenSession& o) { first(o).mutable_shape()->mutable_capsule()->set_half_height(1e6); }},
    {"open.instances[0].shape.cylinder.half_height", E::kInvalidArgument,
     [](v1::OpenSession& o) { first(o).mutable_shape()->mutable_cylinder()->set_radius(1); }},
    {"open.instances[0].shape.sphere.radius", E::kInvalidArgument,
     [](v1::OpenSession& o) {  // a millimetre in centimetres
       o.mutable_convention()->set_preset(v1::Convention::PRESET_UNREAL);
       first(o).mutable_shape()->mutable_sphere()->set_radius(0.009);
     }},
    {"open.instances[0].shape.box.half_extent.y", E::kInvalidArgument,
     [](v1::OpenSession& o) { set(first(o).mutable_shape()->mutable_box()->mutable_half_extent(), 1, -1, 1); }},
    {"open.instances[0].scale.z", E::kInvalidArgument,
     [](v1::OpenSession& o) { set(first(o).mutable_scale(), 1, 1, 0); }},
    {"open.instances[0].scale.x", E::kInvalidArgument,
     [](v1::OpenSession& o) { set(first(o).mutable_scale(), 2e4, 1, 1); }},
    {"open.instances[0].pose.position.x", E::kInvalidArgument,
     [](v1::OpenSession& o) { first(o).mutable_pose()->mutable_position()->set_x(kInf); }},
    {"open.instances[0].attributes.opacity", E::kInvalidArgument,
     [](v1::OpenSession& o) { first(o).mutable_attributes()->set_opacity(1.5f); }},
    {"open.instances[0].mesh.source", E::kInvalidArgument,
     [](v1::OpenSession& o) { first(o).mutable_mesh()->set_mesh("x"); }},
    {"open.instances[0].mesh.scene_name", E::kNotFound,
     [](v1::OpenSession& o) { first(o).mutable_mesh()->set_scene_name("none.glb"); }},
    {"open.instances[0].mesh.scene_hash", E::kInvalidArgument,
     [](v1::OpenSession& o) { first(o).mutable_mesh()->set_scene_hash("zz"); }},
    {"open.instances[0].mesh.mesh", E::kNotFound,
     [](v1::OpenSession& o) {
       first(o).mutable_mesh()->set_scene_name("town.glb"), first(o).mutable_mesh()->set_mesh("spire");
     }},
    {"open.scene.source", E::kInvalidArgument, [](v1::OpenSession& o) { o.mutable_scene(); }},
    {"open.scene.name", E::kNotFound, [](v1::OpenSession& o) { o.mutable_scene()->set_name("none.glb"); }},
    {"open.scene.name", E::kInvalidArgument, [](v1::OpenSession& o) { o.mutable_scene()->set_name("../town.glb"); }},
    {"open.scene.hash", E::kNotFound, [](v1::OpenSession& o) { o.mutable_scene()->set_hash(std::string(32, '0')); }},
    {"open.scene.metres_per_unit", E::kInvalidArgument,
     [](v1::OpenSession& o) { o.mutable_scene()->set_name("town.glb"), o.mutable_scene()->set_metres_per_unit(0); }},
    {"open.scene.bindings[0].node", E::kNotFound,
     [](v1::OpenSession& o) {
       o.mutable_scene()->set_name("town.glb");
       o.mutable_scene()->add_bindings()->set_id(5), o.mutable_scene()->mutable_bindings(0)->set_node("ship");
     }},
    {"open.scene.bindings[0].id", E::kInvalidArgument,
     [](v1::OpenSession& o) {
       o.mutable_scene()->set_name("town.glb"), o.mutable_scene()->add_bindings()->set_node("cart");
     }},
};

class WrongOpenings : public FromProto, public testing::WithParamInterface<WrongOpen> {};

TEST_P(WrongOpenings, AreNamed) {
  v1::OpenSession open = make_open();
  ASSERT_TRUE(read(open).has_value());
  GetParam().spoil(open);
  const auto refused = read(open);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().field, GetParam().field) << refused.error().message;
  EXPECT_EQ(refused.error().code, GetParam().code);
  EXPECT_FALSE(refused.error().message.empty());
}

INSTANTIATE_TEST_SUITE_P(All, WrongOpenings, testing::ValuesIn(kWrongOpens));

// ---- wrong ticks ----

struct WrongTick {
  const char* field;
  void (*spoil)(v1::Tick&);
};
void PrintTo(const WrongTick& wrong, std::ostream* out) {
  *out << wrong.field;
}

v1::Transforms& moved(v1::Tick& t) {
  return *t.mutable_transforms();
}

const WrongTick kWrongTicks[] = {
    {"tick.transforms.positions", [](v1::Tick& t) { moved(t).add_positions(0); }},
    {"tick.transforms.positions", [](v1::Tick& t) { moved(t).clear_positions(); }},
    {"tick.transforms.positions", [](v1::Tick& t) { moved(t).clear_ids(); }},
    {"tick.transforms.rotations", [](v1::Tick& t) { moved(t).mutable_rotations()->RemoveLast(); }},
    {"tick.transforms.velocities", [](v1::Tick& t) { moved(t).mutable_velocities()->Truncate(3); }},
    {"tick.transforms.positions[4]", [](v1::Tick& t) { moved(t).set_positions(4, kNan); }},
    {"tick.transforms.rotations[7]", [](v1::Tick& t) { moved(t).set_rotations(7, -INFINITY); }},
    {"tick.transforms.rotations[4]", [](v1::Tick& t) { moved(t).set_rotations(7, 0.99f); }},
    {"tick.transforms.rotations[0]", [](v1::Tick& t) { moved(t).set_rotations(3, 0); }},
    {"tick.transforms.velocities[5]", [](v1::Tick& t) { moved(t).set_velocities(5, NAN); }},
    {"tick.delta.added_instances[1].id",
     [](v1::Tick& t) {
       *t.mutable_delta()->add_added_instances() = make_open().instances(0);
       *t.mutable_delta()->add_added_instances() = make_open().instances(0);
       t.mutable_delta()->mutable_added_instances(1)->set_id(UINT64_MAX);
     }},
    {"tick.delta.changed_instances[0].attributes.opacity",
     [](v1::Tick& t) { t.mutable_delta()->add_changed_instances()->mutable_attributes()->set_opacity(-1); }},
    {"tick.targets.targets[0].aim_offset.y",
     [](v1::Tick& t) { set(t.mutable_targets()->add_targets()->mutable_aim_offset(), 0, kNan, 0); }},
    {"tick.observed_camera.pose", [](v1::Tick& t) { t.mutable_observed_camera(); }},
    {"tick.observed_camera.pose.rotation",
     [](v1::Tick& t) { t.mutable_observed_camera()->mutable_pose()->mutable_rotation()->set_x(0.5); }},
    {"tick.observed_camera.velocity.z",
     [](v1::Tick& t) {
       t.mutable_observed_camera()->mutable_pose();
       set(t.mutable_observed_camera()->mutable_velocity(), 0, 0, kInf);
     }},
    {"tick.observed_camera.angular_velocity.x",
     [](v1::Tick& t) {
       t.mutable_observed_camera()->mutable_pose();
       set(t.mutable_observed_camera()->mutable_angular_velocity(), kNan, 0, 0);
     }},
    {"tick.lens.aspect", [](v1::Tick& t) { t.mutable_lens()->set_aspect(20); }},
    {"tick.settings.preset", [](v1::Tick& t) { t.mutable_settings()->set_preset(unknown<v1::Settings::Preset>()); }},
    {"tick.tuning.aggregate.filter.mode",
     [](v1::Tick& t) {
       t.mutable_tuning()->mutable_aggregate()->mutable_filter()->set_mode(unknown<tuning::v1alpha1::FilterMode>());
     }},
    {"tick.tuning.move.strategy",
     [](v1::Tick& t) { t.mutable_tuning()->mutable_move()->set_strategy(unknown<tuning::v1alpha1::Strategy>()); }},
    {"tick.settings.max_vertical_fov_rad", [](v1::Tick& t) { t.mutable_settings()->set_min_vertical_fov_rad(0.5); }},
};

class WrongTicksOnTheWire : public FromProto, public testing::WithParamInterface<WrongTick> {};

TEST_P(WrongTicksOnTheWire, AreNamed) {
  v1::Tick tick = make_tick(1);
  ASSERT_TRUE(read(tick).has_value());
  GetParam().spoil(tick);
  const auto refused = read(tick);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().field, GetParam().field) << refused.error().message;
  EXPECT_EQ(refused.error().code, E::kInvalidArgument);
}

INSTANTIATE_TEST_SUITE_P(All, WrongTicksOnTheWire, testing::ValuesIn(kWrongTicks));

TEST_F(FromProto, AnIdThatWasNegativeIsToldWhatItShouldBe) {
  v1::OpenSession open = make_open();
  first(open).set_id(static_cast<uint64_t>(int64_t{-10}));
  EXPECT_EQ(read(open).error().message,
            "must be in [1, 2^63), got 18446744073709551606, which is -10 as a signed number; convert a 32-bit id to "
            "an unsigned one first: "
            "4294967286");
  first(open).set_id(kAssetIdBit);
  EXPECT_EQ(read(open).error().message, "must be in [1, 2^63), got 9223372036854775808");
}

TEST_F(FromProto, MessagesStateTheRangeAndTheValue) {
  v1::OpenSession open = make_open();
  first(open).mutable_shape()->mutable_capsule()->set_radius(2e6);
  EXPECT_EQ(read(open).error().message, "must be in [1e-4, 1e5] m, got 2e+06 m");
  v1::Tick tick = make_tick(1);
  moved(tick).clear_rotations(), moved(tick).add_rotations(1);
  EXPECT_EQ(read(tick).error().message, "must hold 8 numbers (4 for each id, or none), got 1");
}

}  // namespace
}  // namespace sightline::test
