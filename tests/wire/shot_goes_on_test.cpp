// A session without a Shot, and one with, goes on in another daemon: the client asks for what the report says.
#include <gtest/gtest.h>

#include <numbers>

#include "client/cpp/camera_snapshot.h"
#include "server/sample/embree_sampler.h"
#include "server/wire/to_proto.h"
#include "tests/wire/from_proto_fixture.h"

namespace sightline::test {
namespace {

class ShotGoesOn : public FromProto {
 protected:
  // Plays a second with the first person walking, and returns the last reply.
  v1::CameraReply play(Session& session) {
    v1::CameraReply reply;
    for (uint64_t i = 1; i <= 60; ++i) {
      v1::Tick tick;
      tick.set_sequence(i), tick.set_time_s(static_cast<double>(i) / 60);
      auto input = tick_from_proto(tick, session, source);
      EXPECT_TRUE(input && session.apply(*input));
      auto answer = session.step();
      EXPECT_TRUE(answer);
      camera_reply_to_proto(*answer, session, {}, reply);
    }
    return reply;
  }
  std::unique_ptr<Session> open(const v1::OpenSession& request) {
    auto session = Session::open(must_read(request), device->make_sampler(), nullptr);
    if (!session) throw std::runtime_error(to_string(session.error()));
    return std::move(*session);
  }
  static glm::dvec3 place_of_shot_m(const Session& session) { return session.carried().shot.asked_m; }

  std::unique_ptr<SamplerDevice> device = make_embree_sampler_device();
};

v1::OpenSession opening(v1::Convention::Preset preset) {
  v1::OpenSession open;
  v1::Convention& convention = *open.mutable_convention();
  convention.set_preset(preset);
  if (preset == v1::Convention::PRESET_CUSTOM) {
    // +Z is up, +Y ahead, in metres.
    v1::CustomConvention& custom = *convention.mutable_custom();
    custom.set_x(v1::CustomConvention::AXIS_PLUS_X), custom.set_y(v1::CustomConvention::AXIS_MINUS_Z),
        custom.set_z(v1::CustomConvention::AXIS_PLUS_Y);
    custom.set_metres_per_unit(1);
    custom.set_camera_forward(v1::CustomConvention::AXIS_PLUS_Y),
        custom.set_camera_up(v1::CustomConvention::AXIS_PLUS_Z);
  }
  const double unit = preset == v1::Convention::PRESET_UNREAL ? 100 : 1;
  add_capsule(open, 1, 0, 0, 0);
  auto& body = *open.mutable_instances(0)->mutable_shape()->mutable_capsule();
  body.set_radius(0.3 * unit), body.set_half_height(0.6 * unit);
  open.add_targets()->set_id(1);
  return open;
}

// The camera at `eye_m`, looking at `at_m`, canonical axes.
v1::OpenSession request_with_camera(v1::OpenSession request, const glm::dvec3& eye_m, const glm::dvec3& at_m,
                                    const Convention& convention) {
  const Pose pose = camera_to_client(convention, {eye_m, look_rotation(at_m - eye_m, {0, 1, 0}, {1, 0, 0})});
  set(request.mutable_camera()->mutable_position(), pose.position_m.x, pose.position_m.y, pose.position_m.z);
  v1::Quat& rotation = *request.mutable_camera()->mutable_rotation();
  rotation.set_x(pose.rotation.x), rotation.set_y(pose.rotation.y), rotation.set_z(pose.rotation.z),
      rotation.set_w(pose.rotation.w);
  return request;
}

TEST_F(ShotGoesOn, InEveryConvention) {
  for (const auto preset : {v1::Convention::PRESET_GLTF, v1::Convention::PRESET_GODOT, v1::Convention::PRESET_UNITY,
                            v1::Convention::PRESET_UNREAL, v1::Convention::PRESET_ROS, v1::Convention::PRESET_CUSTOM}) {
    v1::OpenSession request = opening(preset);
    request.mutable_camera();
    const Convention convention = must_read(request).convention;
    // Looking past the target, which so is aside in the first picture.
    request = request_with_camera(request, {3, 1.5, 4}, {1, 0, 0}, convention);
    const auto first = open(request);
    CameraSnapshot client(request);
    client.take_reply(play(*first));
    const v1::OpenSession again = client.opening();
    ASSERT_TRUE(again.has_shot()) << preset;
    const auto second = open(again);
    const v1::CameraReply reply = play(*second);
    EXPECT_LT(glm::distance(place_of_shot_m(*first), place_of_shot_m(*second)), 1e-3) << preset;
    EXPECT_NEAR(reply.shot().place().deviation(), 0, 1e-9) << "the target stays aside in the picture";
    ASSERT_EQ(again.shot().places_size(), 1) << preset;
    EXPECT_GT(std::abs(again.shot().places(0).x()), 0.15);
    // And once more, in a third daemon.
    client.take_reply(reply);
    const v1::OpenSession once_more = client.opening();
    ASSERT_EQ(once_more.shot().places_size(), 1) << preset;
    EXPECT_NEAR(once_more.shot().places(0).x(), again.shot().places(0).x(), 1e-9);
  }
}

// The first session took the left side. The second one begins with a camera that evades on the right, and keeps to the
// left.
TEST_F(ShotGoesOn, OnTheSideThatWasTaken) {
  v1::OpenSession request = opening(v1::Convention::PRESET_GLTF);
  add_capsule(request, 2, 2, 0, 0);
  v1::Shot& shot = *request.mutable_shot();
  shot.set_frame(v1::Shot::FRAME_LINE), shot.set_frame_id(1), shot.set_line_to_id(2);
  shot.set_side_rad(1.5), shot.set_height_rad(0.2), shot.set_distance(5), shot.set_either_side(true);
  request.mutable_camera();
  const Convention convention = must_read(request).convention;
  request = request_with_camera(request, {0, 1, -5}, {0, 0, 0}, convention);
  const auto first = open(request);
  CameraSnapshot client(request);
  const v1::CameraReply reply = play(*first);
  client.take_reply(reply);
  EXPECT_NEAR(reply.shot().side().asked(), -1.5, 1e-9);
  const v1::OpenSession again = request_with_camera(client.opening(), {0, 1, 5}, {0, 0, 0}, convention);
  EXPECT_NEAR(play(*open(again)).shot().side().asked(), -1.5, 1e-9);
}

}  // namespace
}  // namespace sightline::test
