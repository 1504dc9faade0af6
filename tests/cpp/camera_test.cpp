// The camera of the C++ client, whose session survives its daemon. tests/conformance checks what the next daemon is
// told.
#include "client/cpp/camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <thread>

#include "client/cpp/live_camera.h"
#include "tests/support/daemon_process.h"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using test::DaemonProcess;
using ::testing::HasSubstr;

v1::OpenSession one_capsule() {
  v1::OpenSession open;
  v1::NewInstance& instance = *open.add_instances();
  instance.set_id(1);
  instance.mutable_shape()->mutable_capsule()->set_radius(0.3);
  instance.mutable_shape()->mutable_capsule()->set_half_height(0.6);
  open.add_targets()->set_id(1);
  open.mutable_camera()->mutable_position()->set_z(6);
  return open;
}

v1::Tick tick(int frame, uint64_t id = 1) {
  v1::Tick message;
  message.set_time_s(frame / 60.0);
  message.mutable_transforms()->add_ids(id);
  for (const double value : {2 * std::sin(frame / 60.0), 0.9, 0.0}) message.mutable_transforms()->add_positions(value);
  return message;
}

// The last of n replies.
v1::CameraReply play(Camera& camera, int first, int n) {
  v1::CameraReply last;
  for (int frame = first; frame < first + n; ++frame) {
    auto answer = camera.tick(tick(frame));
    if (!answer || !std::holds_alternative<v1::CameraReply>(*answer)) {
      ADD_FAILURE() << "no reply to frame " << frame << (answer ? "" : ": " + to_string(answer.error()));
      return {};
    }
    last = std::get<v1::CameraReply>(*answer);
  }
  return last;
}

double apart(const v1::CameraReply& a, const v1::CameraReply& b) {
  const v1::Vec3 &p = a.pose().position(), &q = b.pose().position();
  return std::hypot(p.x() - q.x(), p.y() - q.y(), p.z() - q.z());
}

TEST(CameraTest, ASceneFileThatIsMissingIsAnError) {
  LiveOptions options;
  options.camera.scene_file = "no/such.glb";
  options.wait = 5s;
  const auto camera = Camera::open({"127.0.0.1:1"}, one_capsule(), options.camera);
  ASSERT_FALSE(camera);
  EXPECT_EQ(camera.error().field, "scene_file");
  const auto view = LiveCamera::open({"127.0.0.1:1"}, one_capsule(), options).tick(tick(0));
  ASSERT_FALSE(view);
  EXPECT_EQ(view.error().field, "scene_file");
}

TEST(CameraTest, TheSessionGoesOnInTheDaemonAtTheNextAddress) {
  DaemonProcess first, second, third;
  std::vector<std::string> reasons;
  CameraOptions options;
  options.on_resync = [&](const std::string& reason) { reasons.push_back(reason); };
  auto camera = Camera::open({first.address(), second.address(), third.address()}, one_capsule(), options);
  ASSERT_TRUE(camera) << to_string(camera.error());
  const v1::CameraReply before = play(*camera, 0, 30);
  EXPECT_EQ(first.stop(), 0);
  const v1::CameraReply resumed = play(*camera, 30, 1);
  EXPECT_EQ(resumed.sequence(), 31u);
  EXPECT_LT(apart(before, resumed), 0.2);
  const v1::CameraReply later = play(*camera, 31, 30);
  second.kill_now();
  EXPECT_LT(apart(later, play(*camera, 61, 1)), 0.2);
  EXPECT_EQ(camera->resyncs(), reasons.size());
  EXPECT_EQ(camera->resyncs(), 2u);
  EXPECT_TRUE(camera->close());
}

TEST(CameraTest, ADaemonThatHangsIsLeft) {
  DaemonProcess first, second;
  CameraOptions options;
  options.reply_timeout = 2s;
  auto camera = Camera::open({first.address(), second.address()}, one_capsule(), options);
  ASSERT_TRUE(camera) << to_string(camera.error());
  play(*camera, 0, 5);
  first.hold();
  EXPECT_EQ(play(*camera, 5, 5).sequence(), 10u);
  first.go_on();
  EXPECT_EQ(camera->resyncs(), 1u);
}

TEST(CameraTest, ACameraGivesUpInTime) {
  DaemonProcess daemon;
  CameraOptions options;
  options.give_up_after = 0ms;
  auto camera = Camera::open({daemon.address()}, one_capsule(), options);
  ASSERT_TRUE(camera) << to_string(camera.error());
  play(*camera, 0, 5);
  daemon.kill_now();
  for (int frame = 5; frame < 8; ++frame) {  // after an error, the next tick tries again
    const auto answer = camera->tick(tick(frame));
    ASSERT_FALSE(answer);
    EXPECT_EQ(answer.error().code, ErrorCode::kUnavailable);
  }
}

TEST(CameraTest, TheSessionGoesOnInTheSameDaemonWhereTheStreamIsLost) {
  DaemonProcess daemon;
  CameraOptions options;
  options.reply_timeout = 300ms;
  auto camera = Camera::open({daemon.address()}, one_capsule(), options);
  ASSERT_TRUE(camera) << to_string(camera.error());
  const v1::CameraReply before = play(*camera, 0, 30);
  daemon.hold();
  std::jthread waker([&] {
    std::this_thread::sleep_for(600ms);
    daemon.go_on();
  });
  const v1::CameraReply after = play(*camera, 30, 1);
  EXPECT_EQ(after.sequence(), 31u);
  EXPECT_LT(apart(before, after), 0.2);
  EXPECT_EQ(play(*camera, 31, 3).sequence(), 34u);
  EXPECT_EQ(camera->resyncs(), 0u) << "the daemon has kept the session";
  EXPECT_EQ(camera->resumes(), 1u);
}

TEST(CameraTest, ErrorsNameTheField) {
  DaemonProcess daemon;
  v1::OpenSession wrong = one_capsule();
  wrong.mutable_targets(0)->set_id(99);
  const auto refused = Camera::open({daemon.address()}, wrong);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(refused.error().field, "open.targets[0].id");

  auto camera = Camera::open({daemon.address()}, one_capsule());
  ASSERT_TRUE(camera) << to_string(camera.error());
  const auto answer = camera->tick(tick(0, 99));
  ASSERT_TRUE(answer) << to_string(answer.error());
  ASSERT_TRUE(std::holds_alternative<v1::TickError>(*answer));
  EXPECT_THAT(std::get<v1::TickError>(*answer).message(), HasSubstr("tick.transforms.ids[0]"));
  EXPECT_EQ(play(*camera, 1, 1).sequence(), 2u);

  v1::Tick merging;
  merging.mutable_step_control()->set_merge_into_next(true);
  const auto invalid = camera->tick(merging);
  ASSERT_FALSE(invalid);
  EXPECT_EQ(invalid.error().field, "tick.step_control.merge_into_next");
}

}  // namespace
}  // namespace sightline
