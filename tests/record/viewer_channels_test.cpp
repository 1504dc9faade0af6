// Messages for viewers of a session whose own messages are inconsistent.
#include "server/record/viewer_channels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "foxglove/camera.pb.h"
#include "foxglove/frames.pb.h"
#include "foxglove/scene.pb.h"
#include "server/scene/geometry.h"
#include "server/scene/mirror.h"

namespace sightline {
namespace {

TEST(ViewerChannels, ALensThatNoSessionTakesChangesNoPicture) {
  std::vector<uint32_t> heights;
  const auto emit = [&](RecordTopic topic, const google::protobuf::MessageLite& made) {
    if (topic == RecordTopic::kCalibration)
      heights.push_back(dynamic_cast<const foxglove::CameraCalibration&>(made).height());
  };
  SessionSnapshot session;
  ViewerChannels viewers(session);
  session.take_open({});
  viewers.take_open({});
  v1::CameraReply reply;
  for (const double aspect : {0.0, 2.0, 1e-300, -1.0, std::nan(""), 1e300, 0.0}) {
    v1::Tick tick;
    tick.set_sequence(reply.sequence() + 1);
    reply.set_sequence(tick.sequence());
    tick.mutable_lens()->set_aspect(aspect);
    session.take_tick(tick, {});
    session.take_reply(reply);
    viewers.take_reply(reply, 1, emit);
  }
  EXPECT_THAT(heights, ::testing::ElementsAre(720, 640, 640, 640, 640, 640, 720));
}

// A pinhole camera whose picture is 1280 pixels wide: its focal length in pixels is half the height by the tangent of
// half the vertical angle.
TEST(ViewerChannels, TheCalibrationIsThatOfTheLens) {
  foxglove::CameraCalibration shown;
  const auto emit = [&](RecordTopic topic, const google::protobuf::MessageLite& made) {
    if (topic == RecordTopic::kCalibration) shown = dynamic_cast<const foxglove::CameraCalibration&>(made);
  };
  v1::OpenSession open;
  open.mutable_lens()->set_aspect(2.0);
  SessionSnapshot session;
  ViewerChannels viewers(session);
  session.take_open(open);
  viewers.take_open(open);
  v1::CameraReply reply;
  reply.set_field_of_view(2 * std::atan(0.5));
  viewers.take_reply(reply, 3'000'000'004, emit);
  EXPECT_EQ(shown.timestamp().seconds(), 3);
  EXPECT_EQ(shown.timestamp().nanos(), 4);
  EXPECT_EQ(shown.frame_id(), "camera_optical");
  EXPECT_EQ(shown.width(), 1280u);
  EXPECT_EQ(shown.height(), 640u);
  const double focal_px = 320 / 0.5;
  const auto near = [](std::vector<double> values) {
    std::vector<::testing::Matcher<double>> all;
    for (const double value : values) all.push_back(::testing::DoubleNear(value, 1e-9));
    return all;
  };
  EXPECT_THAT(shown.k(), ::testing::ElementsAreArray(near({focal_px, 0, 640, 0, focal_px, 320, 0, 0, 1})));
  EXPECT_THAT(shown.r(), ::testing::ElementsAreArray(near({1, 0, 0, 0, 1, 0, 0, 0, 1})));
  EXPECT_THAT(shown.p(), ::testing::ElementsAreArray(near({focal_px, 0, 640, 0, 0, focal_px, 320, 0, 0, 0, 1, 0})));
}

// The log has a line for each change, and for what was refused, failed or lost.
TEST(ViewerChannels, TheLogTellsChangesAndTroubles) {
  std::vector<std::string> lines;
  const auto emit = [&](RecordTopic topic, const google::protobuf::MessageLite& made) {
    if (topic != RecordTopic::kLog) return;
    const auto& line = dynamic_cast<const foxglove::Log&>(made);
    EXPECT_EQ(line.timestamp().seconds(), 2);
    EXPECT_EQ(line.timestamp().nanos(), 5);
    lines.push_back(foxglove::Log::Level_Name(line.level()) + " " + line.name() + ": " + line.message());
  };
  constexpr uint64_t kAtNs = 2'000'000'005;
  SessionSnapshot session;
  ViewerChannels viewers(session);
  session.take_open({});
  viewers.take_open({});
  const auto reply = [&](v1::TrackingStatus status, v1::MoveReason reason, const char* text) {
    v1::CameraReply message;
    message.set_status(status);
    message.set_reason(reason);
    message.set_reason_text(text);
    viewers.take_reply(message, kAtNs, emit);
  };
  reply(v1::TRACKING_STATUS_TRACKING, v1::MOVE_REASON_AT_DESIRED_PLACE, "one");
  reply(v1::TRACKING_STATUS_TRACKING, v1::MOVE_REASON_AT_DESIRED_PLACE, "two");
  reply(v1::TRACKING_STATUS_TRACKING, v1::MOVE_REASON_NEAREST_ALL_VISIBLE, "three");
  reply(v1::TRACKING_STATUS_HOLDING, v1::MOVE_REASON_NEAREST_ALL_VISIBLE, "four");
  reply(v1::TRACKING_STATUS_HOLDING, v1::MOVE_REASON_NEAREST_ALL_VISIBLE, "five");
  v1::TickError refused;
  refused.set_sequence(8), refused.set_message("no such instance");
  viewers.take_rejection(refused, kAtNs, emit);
  v1::Fault fault;
  fault.set_stage("sample"), fault.set_message("it failed");
  viewers.take_fault(fault, kAtNs, emit);
  v1::Gap gap;
  gap.set_messages(6), gap.set_text("the queue was full");
  viewers.take_gap(gap, kAtNs, emit);
  EXPECT_THAT(lines, ::testing::ElementsAre("INFO camera: TRACKING: one", "INFO camera: TRACKING: three",
                                            "INFO camera: HOLDING: four",
                                            "WARNING tick: tick 8 refused: no such instance", "ERROR sample: it failed",
                                            "WARNING record: 6 messages are missing: the queue was full"));
}

// The viewer's frame is ROS's: glTF's (x, y, z) is at (z, x, y).
TEST(ViewerChannels, ACompoundIsShownPartByPart) {
  v1::OpenSession open;
  v1::NewInstance& instance = *open.add_instances();
  instance.set_id(1);
  v1::Shape& body = *instance.mutable_shape();
  body.mutable_offset()->set_y(1.0);
  v1::Shape::Part &ball = *body.mutable_compound()->add_parts(), &arm = *body.mutable_compound()->add_parts();
  ball.mutable_shape()->mutable_sphere()->set_radius(0.5);
  ball.mutable_shape()->mutable_offset()->set_x(2.0);
  arm.mutable_shape()->mutable_capsule()->set_radius(0.1);
  arm.mutable_shape()->mutable_capsule()->set_half_height(0.4);
  // A quarter turn about glTF's z: the capsule's upper end points along -x.
  arm.mutable_rotation()->set_z(std::sqrt(0.5)), arm.mutable_rotation()->set_w(std::sqrt(0.5));
  foxglove::SceneEntity shown;
  const auto emit = [&](RecordTopic topic, const google::protobuf::MessageLite& made) {
    if (topic == RecordTopic::kShapes) shown = dynamic_cast<const foxglove::SceneUpdate&>(made).entities(0);
  };
  SessionSnapshot session;
  ViewerChannels viewers(session);
  session.take_open(open);
  viewers.take_open(open);
  viewers.emit_still(1, emit);
  ASSERT_EQ(shown.spheres_size(), 3);
  ASSERT_EQ(shown.cylinders_size(), 1);
  const auto near = [](const auto& p, double x, double y, double z) {
    EXPECT_NEAR(p.x(), x, 1e-9);
    EXPECT_NEAR(p.y(), y, 1e-9);
    EXPECT_NEAR(p.z(), z, 1e-9);
  };
  near(shown.spheres(0).pose().position(), 0, 2, 1);
  near(shown.spheres(1).pose().position(), 0, -0.4, 1);
  near(shown.spheres(2).pose().position(), 0, 0.4, 1);
  near(shown.cylinders(0).pose().position(), 0, 0, 1);
}

TEST(ViewerChannels, AnInstanceThatTurnsIsShownTurned) {
  std::vector<foxglove::Quaternion> shown;
  const auto emit = [&](RecordTopic topic, const google::protobuf::MessageLite& made) {
    if (topic != RecordTopic::kFrames) return;
    for (const auto& frame : dynamic_cast<const foxglove::FrameTransforms&>(made).transforms())
      shown.push_back(frame.rotation());
  };
  v1::OpenSession open;
  v1::NewInstance& instance = *open.add_instances();
  instance.set_id(1);
  instance.mutable_shape()->mutable_sphere()->set_radius(1.0);
  SessionSnapshot session;
  ViewerChannels viewers(session);
  session.take_open(open);
  viewers.take_open(open);
  const glm::dquat turned = glm::normalize(glm::dquat(0.8, 0.1, 0.3, -0.5));
  v1::Tick tick;
  tick.set_sequence(1);
  tick.mutable_transforms()->add_ids(1);
  for (int axis = 0; axis < 3; ++axis) tick.mutable_transforms()->add_positions(1.0);
  for (const double value : {turned.x, turned.y, turned.z, turned.w})
    tick.mutable_transforms()->add_rotations(static_cast<float>(value));
  session.take_tick(tick, {});
  v1::CameraReply reply;
  reply.set_sequence(1);
  session.take_reply(reply);
  viewers.take_reply(reply, 1, emit);
  EXPECT_TRUE(std::any_of(shown.begin(), shown.end(), [&](const foxglove::Quaternion& q) {
    return glm::length(glm::dquat(q.w(), q.x(), q.y(), q.z()) - glm::dquat(turned.w, turned.z, turned.x, turned.y)) <
           1e-6;
  })) << "the axis is permuted as every vector is";
}

TEST(ViewerChannels, WhatARefusedTickAddsIsNeverShown) {
  std::vector<size_t> shapes, frames;
  const auto emit = [&](RecordTopic topic, const google::protobuf::MessageLite& made) {
    if (topic == RecordTopic::kShapes)
      shapes.push_back(static_cast<size_t>(dynamic_cast<const foxglove::SceneUpdate&>(made).entities_size()));
    if (topic == RecordTopic::kFrames)
      frames.push_back(static_cast<size_t>(dynamic_cast<const foxglove::FrameTransforms&>(made).transforms_size()));
  };
  SessionSnapshot session;
  ViewerChannels viewers(session);
  session.take_open({});
  viewers.take_open({});
  viewers.emit_still(1, emit);
  const auto tell = [&](uint64_t sequence, uint64_t id) {
    v1::Tick tick;
    tick.set_sequence(sequence);
    v1::NewInstance& added = *tick.mutable_delta()->add_added_instances();
    added.set_id(id);
    added.mutable_shape()->mutable_sphere()->set_radius(1.0);
    tick.mutable_transforms()->add_ids(id);
    for (int axis = 0; axis < 3; ++axis) tick.mutable_transforms()->add_positions(1.0);
    session.take_tick(tick, {});
  };
  const auto refuse = [&](uint64_t sequence, const char* field) {
    v1::TickError rejection;
    rejection.set_sequence(sequence);
    rejection.add_field_violations()->set_field(field);
    session.take_rejection(rejection);
    viewers.take_rejection(rejection, 1, emit);
  };
  const auto reply = [&](uint64_t sequence) {
    v1::CameraReply message;
    message.set_sequence(sequence);
    session.take_reply(message);
    viewers.take_reply(message, 1, emit);
  };
  tell(1, 11), tell(2, 12), refuse(2, "tick.delta.added_instances[0].id"), tell(3, 13), tell(3, 14),
      refuse(3, "tick.sequence");
  tell(4, 15);  // of the next step
  EXPECT_THAT(shapes, ::testing::ElementsAre(0));
  reply(3);
  EXPECT_THAT(shapes, ::testing::ElementsAre(0, 2)) << "once for all that changed";
  reply(4), reply(5);
  EXPECT_THAT(shapes, ::testing::ElementsAre(0, 2, 3));
  EXPECT_THAT(frames, ::testing::ElementsAre(1 + 2, 1 + 3, 1 + 3)) << "the camera's, and of what moves";
}

// What the viewers see of one target: where its sight line ends, and what stands there.
struct SeenTarget {
  glm::dvec3 end_m{0.0};
  std::string text;
};

SeenTarget seen_target(const v1::OpenSession& open, const LevelView* level) {
  SeenTarget seen;
  const auto emit = [&](RecordTopic topic, const google::protobuf::MessageLite& made) {
    if (topic != RecordTopic::kSight) return;
    const auto& lines = dynamic_cast<const foxglove::SceneUpdate&>(made).entities(1);
    const foxglove::Point3& end = lines.lines(0).points(1);
    seen.end_m = {end.x(), end.y(), end.z()};
    seen.text = lines.texts(0).text();
  };
  SessionSnapshot session;
  ViewerChannels viewers(session);
  session.take_open(open);
  viewers.take_open(open, level);
  v1::CameraReply reply;
  reply.add_targets()->set_id(7);
  reply.mutable_targets(0)->set_filtered_share(0.5f);
  viewers.take_reply(reply, 1, emit);
  return seen;
}

TEST(ViewerChannels, SightLinesEndAtTheAimPoint) {
  v1::OpenSession open;
  v1::NewInstance& person = *open.add_instances();
  person.set_id(7);
  person.mutable_shape()->mutable_sphere()->set_radius(1.0);
  person.mutable_pose()->mutable_position()->set_x(10.0);
  person.mutable_scale()->set_x(1.0), person.mutable_scale()->set_y(3.0), person.mutable_scale()->set_z(1.0);
  v1::Target& target = *open.add_targets();
  target.set_id(7);
  EXPECT_EQ(seen_target(open, nullptr).end_m, glm::dvec3(0, 10, 0)) << "x of glTF is y of the viewer";
  target.mutable_aim_offset()->set_y(0.5);
  EXPECT_EQ(seen_target(open, nullptr).end_m, glm::dvec3(0, 10, 1.5)) << "the offset is scaled with the instance";
  EXPECT_EQ(seen_target(open, nullptr).text, "target 7: 50 %");
}

TEST(ViewerChannels, ATargetOfTheSceneFileHasItsPlaceAndName) {
  v1::OpenSession open;
  v1::NodeBinding& binding = *open.mutable_scene()->add_bindings();
  binding.set_node("Anna");
  binding.set_id(7);
  open.add_targets()->set_id(7);
  LevelView level;
  LevelNode& anna = level.nodes[7];
  anna.rest.position_m = {1, 2, 3};
  anna.centre_m = {0, 0.9, 0};
  anna.name = "Anna";
  const SeenTarget seen = seen_target(open, &level);
  EXPECT_EQ(seen.end_m, glm::dvec3(1, 2, 3.9));
  EXPECT_EQ(seen.text, "Anna: 50 %");
}

TEST(ViewerChannels, TheLevelIsThereAsTriangles) {
  GeometryStore store;
  MeshData triangle{.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, .indices = {0, 1, 2}};
  SceneMirror mirror;
  SceneDelta delta;
  delta.asset_ids_allowed = true;
  for (const uint64_t id : {kAssetIdBit, kAssetIdBit | 1}) {
    const auto geometry = store.intern(triangle);
    ASSERT_TRUE(geometry.has_value());
    NewInstance& added = delta.add.emplace_back();
    added.id = id;
    added.geometry = *geometry;
    added.pose.position_m.x = static_cast<double>(id & 1);
  }
  ASSERT_TRUE(mirror.apply(delta, {}).has_value());
  Convention convention = gltf_convention();
  convention.origin_m = {100, 0, 0};
  const LevelView level = level_view_of(mirror, convention, {}, 5);
  EXPECT_EQ(level.triangles, 2u);
  ASSERT_EQ(level.shapes.entities_size(), 2);
  const foxglove::TriangleListPrimitive& drawn = level.shapes.entities(0).triangles(0);
  EXPECT_EQ(drawn.indices_size(), 3);
  EXPECT_EQ(drawn.points_size(), 3);
  EXPECT_EQ(level.nodes.at(kAssetIdBit | 1).rest.position_m, glm::dvec3(0, 101, 0)) << "absolute, in the viewers' axes";

  std::vector<std::string> frames;
  int levels = 0;
  const auto emit = [&](RecordTopic topic, const google::protobuf::MessageLite& made) {
    levels += topic == RecordTopic::kLevel;
    if (topic != RecordTopic::kStaticFrames) return;
    for (const auto& frame : dynamic_cast<const foxglove::FrameTransforms&>(made).transforms())
      frames.push_back(frame.child_frame_id());
  };
  SessionSnapshot session;
  ViewerChannels viewers(session);
  viewers.take_open({}, &level);
  viewers.emit_still(1, emit);
  viewers.emit_level(1, emit);
  EXPECT_EQ(levels, 1);
  EXPECT_THAT(frames, ::testing::IsSupersetOf({viewer_frame_of(kAssetIdBit), viewer_frame_of(kAssetIdBit | 1)}));
}

}  // namespace
}  // namespace sightline
