// What viewers are shown of a session whose messages are not sound.
#include "server/record/viewer_channels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "foxglove/camera.pb.h"

namespace sightline {
namespace {

TEST(ViewerChannels, ALensThatNoSessionTakesChangesNoPicture) {
  std::vector<uint32_t> heights;
  const auto emit = [&](RecordTopic topic, const google::protobuf::MessageLite& made) {
    if (topic == RecordTopic::kCalibration)
      heights.push_back(dynamic_cast<const foxglove::CameraCalibration&>(made).height());
  };
  ViewerChannels viewers;
  viewers.take_open({}, 1, emit);
  for (const double aspect : {0.0, 2.0, 1e-300, -1.0, std::nan(""), 1e300, 0.0}) {
    v1::Tick tick;
    tick.mutable_lens()->set_aspect(aspect);
    viewers.take_tick(tick, 1, emit);
    viewers.take_reply({}, 1, emit);
  }
  EXPECT_THAT(heights, ::testing::ElementsAre(720, 640, 640, 640, 640, 640, 720));
}

}  // namespace
}  // namespace sightline
