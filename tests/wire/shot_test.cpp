// Shots on the wire: what arrives, what is refused by name, what is warned of, and the report in a reply.
#include "server/wire/from_proto_shot.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "server/sample/embree_sampler.h"
#include "server/wire/to_proto.h"
#include "tests/wire/from_proto_fixture.h"

namespace sightline::test {
namespace {

v1::Shot full_shot() {
  v1::Shot shot;
  shot.add_subject_ids(7), shot.add_subject_ids(8);
  shot.set_frame(v1::Shot::FRAME_LINE), shot.set_frame_id(7), shot.set_line_to_id(8);
  shot.set_side_rad(1.0), shot.set_height_rad(0.2), shot.set_orbit_radps(-0.5), shot.set_distance(300),
      shot.set_tolerance(0.4), shot.set_weight(2);
  v1::Shot::Place& place = *shot.add_places();
  place.set_id(8), place.set_x(0.3), place.set_y(-0.2);
  shot.set_cut(true), shot.set_blend_s(2);
  shot.set_either_side(true);
  return shot;
}

TEST(ShotOnTheWire, EveryFieldArrivesInCanonicalUnits) {
  AskedShot read;
  ASSERT_TRUE(read_shot(full_shot(), unreal_convention(), Lens{}.aspect, "open.shot", read));
  EXPECT_EQ(read.subject_ids, (std::vector<uint64_t>{7, 8}));
  EXPECT_EQ(read.frame, ShotFrame::kLine);
  EXPECT_EQ(read.frame_id, 7u);
  EXPECT_EQ(read.line_to_id, 8u);
  EXPECT_EQ(read.side_rad, 1.0);
  EXPECT_EQ(read.height_rad, 0.2);
  EXPECT_EQ(read.orbit_radps, -0.5);
  EXPECT_NEAR(read.distance_m.value(), 3.0, 1e-12) << "centimetres";
  EXPECT_FALSE(read.size);
  EXPECT_EQ(read.tolerance, 0.4);
  EXPECT_EQ(read.weight, 2.0);
  ASSERT_EQ(read.places.size(), 1u);
  EXPECT_EQ(read.places[0].id, 8u);
  EXPECT_EQ(read.places[0].half_pictures, glm::dvec2(0.3, -0.2));
  EXPECT_TRUE(read.cut);
  EXPECT_EQ(read.blend_s, 2.0);
  EXPECT_TRUE(read.either_side);
}

// Where the default front axis of each convention points in canonical axes, by what engines document.
TEST(ShotOnTheWire, TheFrontOfAModelIsThatOfTheConvention) {
  const auto front = [](const Convention& convention, const v1::Shot& shot = {}) {
    AskedShot read;
    EXPECT_TRUE(read_shot(shot, convention, Lens{}.aspect, "shot", read));
    return read.front;
  };
  EXPECT_EQ(front(gltf_convention()), glm::dvec3(0, 0, 1));
  EXPECT_EQ(front(godot_convention()), glm::dvec3(0, 0, -1));
  EXPECT_EQ(front(unity_convention()), unity_convention().canonical_from_client * glm::dvec3(0, 0, 1));
  EXPECT_EQ(front(unreal_convention()), unreal_convention().canonical_from_client * glm::dvec3(1, 0, 0));
  EXPECT_EQ(front(ros_convention()), ros_convention().canonical_from_client * glm::dvec3(1, 0, 0));
  v1::Shot sideways;
  sideways.mutable_front()->set_x(5);
  EXPECT_EQ(front(gltf_convention(), sideways), glm::dvec3(1, 0, 0));
}

TEST(ShotOnTheWire, WrongValuesAreRefusedByName) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const std::pair<const char*, std::function<void(v1::Shot&)>> wrong[] = {
      {"shot.side_rad", [](v1::Shot& s) { s.set_side_rad(7); }},
      {"shot.side_rad", [=](v1::Shot& s) { s.set_side_rad(kNan); }},
      {"shot.height_rad", [](v1::Shot& s) { s.set_height_rad(1.6); }},
      {"shot.height_rad", [=](v1::Shot& s) { s.set_height_rad(kNan); }},
      {"shot.orbit_radps", [](v1::Shot& s) { s.set_orbit_radps(4); }},
      {"shot.orbit_radps", [=](v1::Shot& s) { s.set_orbit_radps(kNan); }},
      {"shot.distance", [](v1::Shot& s) { s.set_distance(0); }},
      {"shot.distance", [](v1::Shot& s) { s.set_distance(1e9); }},
      {"shot.distance", [=](v1::Shot& s) { s.set_distance(kNan); }},
      {"shot.size", [](v1::Shot& s) { s.set_size(0.01); }},
      {"shot.size", [](v1::Shot& s) { s.set_size(1.5); }},
      {"shot.tolerance", [](v1::Shot& s) { s.set_tolerance(-1); }},
      {"shot.tolerance", [=](v1::Shot& s) { s.set_tolerance(kNan); }},
      {"shot.weight", [](v1::Shot& s) { s.set_weight(11); }},
      {"shot.blend_s", [](v1::Shot& s) { s.set_blend_s(61); }},
      {"shot.frame", [](v1::Shot& s) { s.set_frame(static_cast<v1::Shot::Frame>(9)); }},
      {"shot.line_to_id", [](v1::Shot& s) { s.set_line_to_id(0); }},
      {"shot.front", [](v1::Shot& s) { s.mutable_front()->set_y(1); }},
      {"shot.front", [](v1::Shot& s) { s.mutable_front(); }},
      {"shot.front.x", [=](v1::Shot& s) { s.mutable_front()->set_x(kNan); }},
      {"shot.places[0].x", [](v1::Shot& s) { s.mutable_places(0)->set_x(1); }},
      {"shot.places[0].y", [=](v1::Shot& s) { s.mutable_places(0)->set_y(kNan); }},
      {"shot.places[1].id", [](v1::Shot& s) { s.add_places()->set_id(8); }},
  };
  for (const auto& [field, change] : wrong) {
    v1::Shot shot = full_shot();
    change(shot);
    AskedShot read;
    const Status status = read_shot(shot, gltf_convention(), Lens{}.aspect, "shot", read);
    ASSERT_FALSE(status) << field;
    EXPECT_EQ(status.error().field, field) << status.error().message;
  }
  v1::Shot many = full_shot();
  for (uint64_t id = 10; id < 50; ++id) many.add_subject_ids(id);
  AskedShot read;
  EXPECT_EQ(read_shot(many, gltf_convention(), Lens{}.aspect, "shot", read).error().code,
            ErrorCode::kResourceExhausted);
}

TEST(ShotOnTheWire, RoundedRightAnglesAreRightAngles) {
  v1::Shot shot;
  shot.set_height_rad(1.5708), shot.set_side_rad(3.1416);
  AskedShot read;
  ASSERT_TRUE(read_shot(shot, gltf_convention(), Lens{}.aspect, "shot", read));
  EXPECT_EQ(read.height_rad, std::numbers::pi / 2);
}

v1::OpenSession one_target() {
  v1::OpenSession open;
  add_capsule(open, 1, 0, 0, 0);
  open.add_targets()->set_id(1);
  set(open.mutable_camera()->mutable_position(), 0, 0, 6);
  return open;
}

class ShotInAnOpening : public FromProto {};

TEST_F(ShotInAnOpening, WhatCannotBeIsWarnedOf) {
  v1::OpenSession open = one_target();
  (void)must_read(open);
  EXPECT_TRUE(warnings.empty());
  open.mutable_camera()->mutable_position()->set_z(45);
  (void)must_read(open);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(warnings[0].starts_with("open.camera: is 45 m from the targets")) << warnings[0];
  open.mutable_camera()->mutable_position()->set_z(6);
  warnings.clear();
  v1::Shot& shot = *open.mutable_shot();
  shot.set_distance(50), shot.set_height_rad(1.5), shot.add_subject_ids(99);
  (void)must_read(open);
  ASSERT_EQ(warnings.size(), 3u);
  EXPECT_TRUE(warnings[0].starts_with("open.shot.distance")) << warnings[0];
  EXPECT_TRUE(warnings[1].starts_with("open.shot.height_rad")) << warnings[1];
  EXPECT_TRUE(warnings[2].starts_with("open.shot.subject_ids")) << warnings[2];
}

TEST_F(ShotInAnOpening, AWrongOneIsNamedInOpeningsAndTicks) {
  v1::OpenSession open = one_target();
  open.mutable_shot()->set_size(5);
  EXPECT_EQ(read(open).error().field, "open.shot.size");
  v1::Tick tick;
  tick.mutable_shot()->set_size(5);
  EXPECT_EQ(read(tick).error().field, "tick.shot.size");
}

TEST_F(ShotInAnOpening, TheReplyReportsItInTheClientsUnits) {
  v1::OpenSession open = one_target();
  open.mutable_convention()->set_preset(v1::Convention::PRESET_UNREAL);
  auto& person = *open.mutable_instances(0)->mutable_shape()->mutable_capsule();
  person.set_radius(30), person.set_half_height(60);
  set(open.mutable_camera()->mutable_position(), -600, 0, 0);
  v1::Shot& shot = *open.mutable_shot();
  shot.set_side_rad(3.14159), shot.set_height_rad(0.3), shot.set_distance(500);
  auto options = must_read(open);
  const auto device = make_embree_sampler_device();
  auto session = Session::open(std::move(options), device->make_sampler(), nullptr);
  ASSERT_TRUE(session) << to_string(session.error());
  v1::CameraReply reply;
  for (uint64_t i = 1; i < 300; ++i) {
    v1::Tick tick;
    tick.set_sequence(i), tick.set_time_s(static_cast<double>(i) / 60);
    auto input = tick_from_proto(tick, **session, source);
    ASSERT_TRUE(input && (*session)->apply(*input));
    auto answer = (*session)->step();
    ASSERT_TRUE(answer);
    camera_reply_to_proto(*answer, **session, {}, reply);
  }
  ASSERT_TRUE(reply.has_shot());
  EXPECT_NEAR(reply.shot().distance().asked(), 500, 1e-6);
  EXPECT_NEAR(reply.shot().distance().now(), 500, 60);
  EXPECT_NEAR(reply.shot().height().asked(), 0.3, 1e-9);
  EXPECT_GT(reply.shot().worth(), 0.95);
  // Behind somebody who faces along +X is at -X.
  EXPECT_LT(reply.pose().position().x(), -300);
  EXPECT_TRUE(reply.shot().limits().empty());
}

}  // namespace
}  // namespace sightline::test
