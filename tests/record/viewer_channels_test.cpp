// Messages for viewers of a session whose own messages are inconsistent.
#include "server/record/viewer_channels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "foxglove/camera.pb.h"
#include "foxglove/frames.pb.h"
#include "foxglove/scene.pb.h"

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

TEST(ViewerChannels, WhatARefusedTickAddsIsNeverShown) {
  std::vector<size_t> shapes, frames;
  const auto emit = [&](RecordTopic topic, const google::protobuf::MessageLite& made) {
    if (topic == RecordTopic::kShapes)
      shapes.push_back(static_cast<size_t>(dynamic_cast<const foxglove::SceneUpdate&>(made).entities_size()));
    if (topic == RecordTopic::kFrames)
      frames.push_back(
          static_cast<size_t>(dynamic_cast<const foxglove::FrameTransforms&>(made).transforms_size()));
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

}  // namespace
}  // namespace sightline
