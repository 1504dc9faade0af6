// A client whose world gets a new origin now and then gets the same pictures as one whose world stays.
#include <gtest/gtest.h>

#include <cmath>

#include "client/cpp/camera_snapshot.h"
#include "server/sample/embree_sampler.h"
#include "server/wire/from_proto_values.h"
#include "server/wire/to_proto.h"
#include "tests/wire/from_proto_fixture.h"

namespace sightline::test {
namespace {

constexpr double kShiftM = -1000.0, kShiftEveryS = 5.0, kTick = 1.0 / 60;

glm::dvec3 vec(const v1::Vec3& v) {
  return {v.x(), v.y(), v.z()};
}

class WorldShift : public FromProto, public testing::WithParamInterface<v1::Convention::Preset> {
 protected:
  // The client's unit, and what is said in canonical axes.
  double unit() const { return GetParam() == v1::Convention::PRESET_UNREAL ? 100.0 : 1.0; }
  glm::dvec3 told(const glm::dvec3& canonical_m) const { return vector_to_client(convention_, canonical_m); }
  static void put(const glm::dvec3& value, v1::Vec3& out) { set(&out, value.x, value.y, value.z); }

  // Two people before the triangles of a file; a third one stands behind a box that the client never moves.
  v1::OpenSession opening() {
    v1::OpenSession open;
    open.mutable_convention()->set_preset(GetParam());
    EXPECT_TRUE(read_convention(open.convention(), "", convention_));
    open.mutable_scene()->set_name("town.glb");
    const auto add = [&](uint64_t id, const glm::dvec3& at_m) {
      v1::NewInstance& instance = *open.add_instances();
      instance.set_id(id);
      instance.mutable_shape()->mutable_capsule()->set_radius(0.3 * unit());
      instance.mutable_shape()->mutable_capsule()->set_half_height(0.6 * unit());
      put(told(at_m), *instance.mutable_pose()->mutable_position());
      return &instance;
    };
    add(1, {0, 1, 0}), add(2, {1.5, 1, 0});
    put(glm::abs(told({2, 2, 0.2})), *add(3, {3, 1, 3})->mutable_shape()->mutable_box()->mutable_half_extent());
    open.add_targets()->set_id(1), open.add_targets()->set_id(2);
    const Pose camera = camera_to_client(convention_, {{0, 2, 7}, glm::dquat(1, 0, 0, 0)});
    put(camera.position_m, *open.mutable_camera()->mutable_position());
    v1::Quat& rotation = *open.mutable_camera()->mutable_rotation();
    rotation.set_x(camera.rotation.x), rotation.set_y(camera.rotation.y), rotation.set_z(camera.rotation.z),
        rotation.set_w(camera.rotation.w);
    return open;
  }
  std::unique_ptr<Session> open(const v1::OpenSession& request) {
    auto session = Session::open(must_read(request), device_->make_sampler(), nullptr);
    if (!session) throw std::runtime_error(to_string(session.error()));
    return std::move(*session);
  }
  // Tick k of a walk; only the first person is named in every tick. `shifted`: by how much the world has been shifted
  // so far.
  v1::Tick walk(uint64_t k, const glm::dvec3& shifted) const {
    const double time_s = static_cast<double>(k) * kTick;
    v1::Tick tick;
    tick.set_sequence(k + 1), tick.set_time_s(time_s);
    const auto move = [&](uint64_t id, const glm::dvec3& at_m) {
      tick.mutable_transforms()->add_ids(id);
      const glm::dvec3 at = told(at_m) + shifted;
      for (int axis = 0; axis < 3; ++axis) tick.mutable_transforms()->add_positions(at[axis]);
    };
    move(1, {4 * std::sin(0.35 * time_s), 1, 2 * std::sin(0.5 * time_s)});
    if (k % 200 < 100) move(2, {1.5 + 3 * std::sin(0.2 * time_s), 1, -1});
    return tick;
  }
  bool apply(Session& session, const v1::Tick& tick) {
    auto input = tick_from_proto(tick, session, source);
    EXPECT_TRUE(input) << to_string(input.error());
    return input && session.apply(*input);
  }
  v1::CameraReply reply(Session& session) {
    auto answer = session.step();
    if (!answer) throw std::runtime_error(to_string(answer.error()));
    v1::CameraReply out;
    camera_reply_to_proto(*answer, session, {}, out);
    return out;
  }

  Convention convention_;
  std::unique_ptr<SamplerDevice> device_ = make_embree_sampler_device();
};
INSTANTIATE_TEST_SUITE_P(Conventions, WorldShift,
                         testing::Values(v1::Convention::PRESET_GLTF, v1::Convention::PRESET_UNITY,
                                         v1::Convention::PRESET_UNREAL));

TEST_P(WorldShift, TheCameraGoesOnAsIfNothingHadHappened) {
  const v1::OpenSession request = opening();
  const auto still = open(request), shifting = open(request);
  const glm::dvec3 by = told({kShiftM, 0, -kShiftM / 2});
  glm::dvec3 shifted(0.0);
  v1::CameraReply last;
  for (uint64_t k = 0; k < 60 * 60; ++k) {
    const bool shifts = k > 0 && k % static_cast<uint64_t>(kShiftEveryS / kTick) == 0;
    if (shifts) shifted += by;
    v1::Tick tick = walk(k, shifted);
    if (shifts) put(by, *tick.mutable_world_shift());
    // For half of the time the client sends back where its camera is, in the world as it is now.
    if (k > 1800) {
      *tick.mutable_observed_camera()->mutable_pose() = last.pose();
      put(vec(last.pose().position()) + (shifts ? by : glm::dvec3(0.0)),
          *tick.mutable_observed_camera()->mutable_pose()->mutable_position());
    }
    ASSERT_TRUE(apply(*still, walk(k, glm::dvec3(0.0))));
    ASSERT_TRUE(apply(*shifting, tick));
    const v1::CameraReply a = reply(*still);
    last = reply(*shifting);
    ASSERT_LT(glm::distance(vec(last.pose().position()) - shifted, vec(a.pose().position())), 1e-6 * unit()) << k;
    ASSERT_LT(glm::distance(vec(last.velocity()), vec(a.velocity())), 1e-5 * unit()) << k;
    ASSERT_EQ(last.cut(), a.cut());
    ASSERT_EQ(last.reason(), a.reason()) << k;
    ASSERT_EQ(last.targets(0).visible_share(), a.targets(0).visible_share()) << k;
  }
  EXPECT_NEAR(glm::length(shifted), 11 * glm::length(by), 1e-3 * unit());
}

TEST_P(WorldShift, GoesOnInAnotherDaemonWhereItWas) {
  const v1::OpenSession request = opening();
  const auto first = open(request);
  CameraSnapshot client(request);
  const glm::dvec3 by = told({700, 30, -200});
  v1::CameraReply last;
  for (uint64_t k = 0; k < 90; ++k) {
    v1::Tick tick = walk(k, k < 30 ? glm::dvec3(0.0) : k < 60 ? by : 2.0 * by);
    if (k == 30 || k == 60) put(by, *tick.mutable_world_shift());
    if (k == 20 || k == 50) {  // one before and one after the first shift
      v1::NewInstance& added = *tick.mutable_delta()->add_added_instances();
      added.set_id(k), added.mutable_shape()->mutable_sphere()->set_radius(unit());
      if (k == 50) put(told({5, 1, 5}) + by, *added.mutable_pose()->mutable_position());
    }
    ASSERT_TRUE(apply(*first, tick));
    client.apply(tick);
    client.take_reply(last = reply(*first));
  }
  const auto second = open(client.opening());
  for (const v1::Tick& tick : client.ticks(90)) ASSERT_TRUE(apply(*second, tick));
  for (const Instance& was : first->mirror().instances()) {
    if (!was.geometry) continue;
    const Instance* is = second->mirror().find(was.id);
    ASSERT_TRUE(is) << was.id;
    const glm::dvec3 then = position_to_client(first->convention(), was.pose.position_m),
                     now = position_to_client(second->convention(), is->pose.position_m);
    EXPECT_LT(glm::distance(then, now), 1e-6 * unit()) << was.id;
  }
  EXPECT_LT(glm::distance(vec(reply(*second).pose().position()), vec(last.pose().position())), 0.2 * unit());
}

TEST_P(WorldShift, IsRefusedWholeWhenItLeadsTooFar) {
  const auto session = open(opening());
  v1::Tick tick = walk(0, glm::dvec3(0.0));
  tick.mutable_world_shift()->set_x(1e18);
  const auto input = tick_from_proto(tick, *session, source);
  ASSERT_FALSE(input);
  EXPECT_EQ(input.error().field, "tick.world_shift");
  // A tick that is refused for something else shifts nothing.
  tick.mutable_world_shift()->set_x(5 * unit());
  tick.mutable_transforms()->set_ids(0, 99);
  auto refused = tick_from_proto(tick, *session, source);
  ASSERT_TRUE(refused);
  EXPECT_FALSE(session->apply(*refused));
  EXPECT_EQ(session->convention().origin_m, glm::dvec3(0.0));
}

TEST_P(WorldShift, ALevelIsWhereItsReferencePutsIt) {
  v1::OpenSession request = opening();
  const auto plain = open(request);
  put(told({40, 0, -5}), *request.mutable_scene()->mutable_position());
  const auto placed = open(request);
  size_t nodes = 0;
  for (const Instance& node : plain->mirror().instances()) {
    if ((node.id & kAssetIdBit) == 0) continue;
    ++nodes;
    EXPECT_LT(
        glm::distance(placed->mirror().find(node.id)->pose.position_m, node.pose.position_m + glm::dvec3(40, 0, -5)),
        1e-9);
  }
  EXPECT_EQ(nodes, 2u);
}

}  // namespace
}  // namespace sightline::test
