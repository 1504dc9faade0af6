#include "server/wire/to_proto.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "server/sample/embree_sampler.h"
#include "server/step/quality_level.h"
#include "server/wire/from_proto.h"
#include "tests/wire/wire.h"

namespace sightline::test {
namespace {

glm::dvec3 vec(const v1::Vec3& v) {
  return {v.x(), v.y(), v.z()};
}
glm::dquat quat(const v1::Quat& q) {
  return {q.w(), q.x(), q.y(), q.z()};
}

void expect_near(const glm::dvec3& got, const glm::dvec3& expected, double tolerance = 1e-9) {
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(got[i], expected[i], tolerance) << "component " << i;
}

// From message to message, without a network.
class Wire {
 public:
  explicit Wire(const v1::OpenSession& open) {
    std::vector<std::string> warnings;
    auto options = session_options_from_proto(open, source_, warnings);
    if (!options) throw std::runtime_error(to_string(options.error()));
    auto opened = Session::open(std::move(*options), device_->make_sampler(), nullptr);
    if (!opened) throw std::runtime_error(to_string(opened.error()));
    session = std::move(*opened);
  }
  const v1::CameraReply& play(const v1::Tick& tick, const DiagnosticsWanted& wanted = {}) {
    auto input = tick_from_proto(tick, *session, source_);
    if (!input) throw std::runtime_error(to_string(input.error()));
    if (Status ok = session->apply(*input); !ok) throw std::runtime_error(to_string(ok.error()));
    auto answer = session->step();
    if (!answer) throw std::runtime_error(to_string(answer.error()));
    camera_reply_to_proto(*answer, *session, wanted, reply);
    return reply;
  }

  std::unique_ptr<Session> session;
  v1::CameraReply reply;

 private:
  GeometryStore store_;
  SceneLibrary library_{"", GltfLimits{}, store_};
  SceneSource source_{library_, store_};
  std::unique_ptr<SamplerDevice> device_ = make_embree_sampler_device();
};

// The same world as a Unity client sends it: x is mirrored, and a camera along +Z is turned to look back.
v1::OpenSession unity_open() {
  v1::OpenSession open = make_open();
  open.mutable_convention()->set_preset(v1::Convention::PRESET_UNITY);
  for (v1::NewInstance& instance : *open.mutable_instances())
    instance.mutable_pose()->mutable_position()->set_x(-instance.pose().position().x());
  open.mutable_camera()->mutable_rotation()->set_y(1);  // half a turn
  return open;
}
v1::Tick unity_tick(uint64_t sequence) {
  v1::Tick tick = make_tick(sequence);
  v1::Transforms& t = *tick.mutable_transforms();
  for (int i = 0; i < t.ids_size(); ++i) {
    t.set_positions(3 * i, -t.positions(3 * i));
    t.set_velocities(3 * i, -t.velocities(3 * i));
  }
  return tick;
}

TEST(ToProto, AReplySaysWhatWasAsked) {
  Wire wire(make_open());
  wire.play(make_tick(1));
  const v1::CameraReply& reply = wire.play(make_tick(2));
  EXPECT_EQ(reply.sequence(), 2u);
  EXPECT_EQ(reply.time_s(), 2.0 / 64);
  EXPECT_EQ(reply.pose_time_s(), 2.0 / 64);
  EXPECT_EQ(reply.status(), v1::TRACKING_STATUS_TRACKING);
  EXPECT_NE(reply.reason(), v1::MOVE_REASON_UNSPECIFIED);
  EXPECT_FALSE(reply.reason_text().empty());
  EXPECT_NEAR(reply.field_of_view(), Lens{}.vertical_fov_rad, 1e-12);
  ASSERT_EQ(reply.targets_size(), 2);
  EXPECT_EQ(reply.targets(0).id(), 1u);
  EXPECT_EQ(reply.targets(0).state(), v1::TARGET_STATE_VISIBLE);
  EXPECT_EQ(reply.targets(0).visible_share(), 1.0);
  EXPECT_NEAR(reply.targets(0).distance(), glm::distance(vec(reply.pose().position()), glm::dvec3(-1, 1, 0)), 1e-6);
  EXPECT_GT(reply.candidate_counts().total(), 0u);
  EXPECT_EQ(reply.candidate_counts().target_visible_counts_size(), 2);
  EXPECT_EQ(reply.volume_used(), v1::VOLUME_USED_LATTICE);
  EXPECT_EQ(reply.pair_fallback(), v1::PAIR_FALLBACK_UNSPECIFIED);
  EXPECT_EQ(reply.mirror_revision(), 1u);
  EXPECT_EQ(reply.mirror_hash(), wire.session->mirror().hash());
  EXPECT_FALSE(reply.has_candidates());
  EXPECT_EQ(reply.depth_maps_size(), 0);
}

TEST(ToProto, ThePlaceOfTheShotIsInTheClientsConvention) {
  v1::OpenSession open = make_open(), mirrored_open = unity_open();
  open.mutable_camera()->mutable_position()->set_x(1), mirrored_open.mutable_camera()->mutable_position()->set_x(-1);
  Wire wire(open), unity(mirrored_open);
  for (uint64_t i = 1; i < 4; ++i) wire.play(make_tick(i)), unity.play(unity_tick(i));
  const glm::dvec3 place = vec(wire.reply.shot().position()), mirrored = vec(unity.reply.shot().position());
  expect_near(place, vec(wire.reply.pose().position()), 0.5);  // the session began there
  expect_near(mirrored, {-place.x, place.y, place.z}, 1e-6);
  EXPECT_GT(place.x, 0.5);
  ASSERT_TRUE(wire.reply.has_courses());
  EXPECT_NE(wire.reply.courses().taken(), v1::COURSE_UNSPECIFIED);
  EXPECT_TRUE(wire.reply.courses().has_plan_loss());
}

TEST(ToProto, ADegradedReplySaysWhatWasUsed) {
  Wire wire(make_open());
  const v1::CameraReply& whole = wire.play(make_tick(1));
  EXPECT_FALSE(whole.flags().degraded());
  EXPECT_FALSE(whole.has_degradation());
  for (int level = 1; level <= kLowestQualityLevel; ++level) {
    const auto answer = wire.session->step(level);
    ASSERT_TRUE(answer);
    v1::CameraReply reply;
    camera_reply_to_proto(*answer, *wire.session, {}, reply);
    EXPECT_TRUE(reply.flags().degraded());
    const StepSettings used = degrade(wire.session->settings(), level);
    EXPECT_EQ(reply.degradation().quality_level(), static_cast<uint32_t>(level));
    EXPECT_EQ(reply.degradation().map_resolution(), static_cast<uint32_t>(used.sample.resolution));
    EXPECT_EQ(reply.degradation().sample_points(), static_cast<uint32_t>(used.sample.points));
    EXPECT_EQ(reply.degradation().candidates(), static_cast<uint32_t>(used.aggregate.candidates));
    EXPECT_EQ(reply.degradation().search_resolution(), static_cast<uint32_t>(used.move.viewpoint_search.resolution));
    EXPECT_EQ(reply.degradation().predicted_turns(), used.move.turn_probability > 0);
    EXPECT_EQ(reply.degradation().predicted_motion(), used.move.prediction_s > 0);
  }
}

TEST(ToProto, AUnityClientGetsTheMirroredAnswer) {
  Wire gltf(make_open()), unity(unity_open());
  for (uint64_t i = 1; i <= 30; ++i) {
    const v1::CameraReply a = gltf.play(make_tick(i));
    const v1::CameraReply b = unity.play(unity_tick(i));
    expect_near(vec(b.pose().position()), vec(a.pose().position()) * glm::dvec3(-1, 1, 1));
    expect_near(vec(b.velocity()), vec(a.velocity()) * glm::dvec3(-1, 1, 1), 1e-6);
    expect_near(vec(b.angular_velocity()), vec(a.angular_velocity()) * glm::dvec3(1, -1, -1), 1e-6);
    expect_near(quat(b.pose().rotation()) * glm::dvec3(0, 0, 1),
                quat(a.pose().rotation()) * glm::dvec3(0, 0, -1) * glm::dvec3(-1, 1, 1));
    EXPECT_NEAR(b.field_of_view(), 40, 1e-9);
    EXPECT_NEAR(b.targets(0).distance(), a.targets(0).distance(), 1e-9);
  }
}

// A client whose unit is the centimetre sees and says everything in it. Its axes are glTF's, so only the unit differs.
TEST(ToProto, LengthsAreInTheClientsUnit) {
  const auto in_centimetres = [](v1::Vec3* v) { set(v, 100 * v->x(), 100 * v->y(), 100 * v->z()); };
  v1::OpenSession open = make_open();
  open.mutable_convention()->set_preset(v1::Convention::PRESET_CUSTOM);
  v1::CustomConvention& custom = *open.mutable_convention()->mutable_custom();
  custom.set_x(v1::CustomConvention::AXIS_PLUS_X);
  custom.set_y(v1::CustomConvention::AXIS_PLUS_Y);
  custom.set_z(v1::CustomConvention::AXIS_PLUS_Z);
  custom.set_camera_forward(v1::CustomConvention::AXIS_MINUS_Z);
  custom.set_camera_up(v1::CustomConvention::AXIS_PLUS_Y);
  custom.set_metres_per_unit(0.01);
  in_centimetres(open.mutable_camera()->mutable_position());
  for (v1::NewInstance& instance : *open.mutable_instances()) {
    in_centimetres(instance.mutable_pose()->mutable_position());
    instance.mutable_shape()->mutable_capsule()->set_radius(30);
    instance.mutable_shape()->mutable_capsule()->set_half_height(60);
  }
  Wire metres(make_open()), centimetres(open);
  for (uint64_t i = 1; i <= 20; ++i) {
    v1::Tick a = make_tick(i), b = a;
    for (double& p : *b.mutable_transforms()->mutable_positions()) p *= 100;
    for (float& v : *b.mutable_transforms()->mutable_velocities()) v *= 100;
    if (i == 10) {
      for (v1::Tick* tick : {&a, &b}) {
        v1::ObservedCamera& observed = *tick->mutable_observed_camera();
        set(observed.mutable_pose()->mutable_position(), 0.5, 1.7, 6);
        observed.mutable_pose()->mutable_rotation()->set_w(1);
        set(observed.mutable_velocity(), 1, 0, 0.5);
        if (tick == &b)
          in_centimetres(observed.mutable_pose()->mutable_position()), in_centimetres(observed.mutable_velocity());
      }
    }
    const v1::CameraReply x = metres.play(a), y = centimetres.play(b);
    expect_near(vec(y.pose().position()), 100.0 * vec(x.pose().position()), 1e-3);
    expect_near(vec(y.velocity()), 100.0 * vec(x.velocity()), 1e-3);
    for (int t = 0; t < 2; ++t) EXPECT_NEAR(y.targets(t).distance(), 100 * x.targets(t).distance(), 1e-3);
    EXPECT_GT(x.targets(0).distance(), 3);
  }
}

TEST(ToProto, TheRelativePoseComposesInTheClientsUnits) {
  Wire wire(unity_open());
  v1::Tick tick = unity_tick(1);
  tick.mutable_transforms()->set_rotations(1, 0.6f);
  tick.mutable_transforms()->set_rotations(3, 0.8f);
  const v1::CameraReply& reply = wire.play(tick);
  ASSERT_EQ(reply.relative_pose().target_id(), 1u);
  const glm::dquat turned = glm::normalize(glm::dquat(0.8f, 0, 0.6f, 0));
  expect_near(glm::dvec3(1, 1, 0) + turned * vec(reply.relative_pose().pose().position()),
              vec(reply.pose().position()));
  EXPECT_LT(angle_between(turned * quat(reply.relative_pose().pose().rotation()), quat(reply.pose().rotation())), 1e-7);
  expect_near(glm::dvec3(1, 1, 0) + vec(reply.relative_pose().unrotated_pose().position()),
              vec(reply.pose().position()));
  EXPECT_LT(angle_between(quat(reply.relative_pose().unrotated_pose().rotation()), quat(reply.pose().rotation())),
            1e-7);
}

TEST(ToProto, AHiddenTargetNamesItsOccluder) {
  v1::OpenSession open = make_open();
  v1::NewInstance& wall = *open.add_instances();
  wall.set_id(9);
  set(wall.mutable_shape()->mutable_box()->mutable_half_extent(), 20, 20, 0.1);
  set(wall.mutable_pose()->mutable_position(), 0, 0, 3);
  Wire wire(open);
  const v1::TargetVisibility& target = wire.play(make_tick(1)).targets(0);
  EXPECT_EQ(target.state(), v1::TARGET_STATE_OCCLUDED);
  ASSERT_EQ(target.occluders_size(), 1);
  EXPECT_EQ(target.occluders(0).id(), 9u);
  EXPECT_EQ(target.occluders(0).share(), 1.0);
}

TEST(ToProto, AStateSumsUpTheSharesOfTheWholeTarget) {
  Wire wire(make_open());
  wire.play(make_tick(1));
  auto answer = wire.session->step();
  ASSERT_TRUE(answer);
  const auto state_of = [&](double filtered_share, double picture_share) {
    TargetSight& sight = answer->step.targets[0];
    sight.visible_share = 1.0;  // of this step alone; it does not count
    sight.filtered_share = filtered_share, sight.picture_share = picture_share;
    v1::CameraReply reply;
    camera_reply_to_proto(*answer, *wire.session, {}, reply);
    EXPECT_EQ(reply.targets(0).picture_share(), picture_share);
    return reply.targets(0).state();
  };
  EXPECT_EQ(state_of(1.0, 1.0), v1::TARGET_STATE_VISIBLE);
  EXPECT_EQ(state_of(0.96, 1.0), v1::TARGET_STATE_VISIBLE);
  EXPECT_EQ(state_of(0.9, 1.0), v1::TARGET_STATE_PARTIAL);
  EXPECT_EQ(state_of(1.0, 0.9), v1::TARGET_STATE_PARTIAL) << "a part of it is off screen";
  EXPECT_EQ(state_of(0.01, 0.01), v1::TARGET_STATE_PARTIAL);
  EXPECT_EQ(state_of(0.0, 0.5), v1::TARGET_STATE_OCCLUDED);
  EXPECT_EQ(state_of(1.0, 0.0), v1::TARGET_STATE_OFF_SCREEN);
  EXPECT_EQ(state_of(0.0, 0.0), v1::TARGET_STATE_OFF_SCREEN);
}

TEST(ToProto, TheStatusTheForecastTheOccludersAndTheFlagsAreSent) {
  Wire wire(make_open());
  const v1::CameraReply& first = wire.play(make_tick(1));
  EXPECT_FALSE(first.has_view_s());
  EXPECT_EQ(first.blocked_by(), 0u);
  EXPECT_FALSE(first.targets(0).has_forecast()) << "nothing is known of its motion yet";
  auto answer = wire.session->step();
  ASSERT_TRUE(answer);
  StepResult& step = answer->step;
  step.view_s = 1.25, step.blocked_by = 77;
  step.flags = {.dt_capped = false,
                .used_cube_map = false,
                .body_overlap = false,
                .evading = true,
                .deflected = true,
                .new_shot = true};
  step.targets[0].forecast = SightForecast{0.5, 0.25, 0.75, 0.375};
  step.targets[1].forecast = SightForecast{0.5, 1.0, 0.5, std::nullopt};
  step.targets[0].occlusions.push_back({9, 0.5}), step.targets[0].occlusions.push_back({8, 0.125});
  const std::pair<TrackingStatus, v1::TrackingStatus> statuses[] = {
      {TrackingStatus::kTracking, v1::TRACKING_STATUS_TRACKING},
      {TrackingStatus::kPartialView, v1::TRACKING_STATUS_PARTIAL_VIEW},
      {TrackingStatus::kSeeking, v1::TRACKING_STATUS_SEEKING},
      {TrackingStatus::kBlocked, v1::TRACKING_STATUS_BLOCKED},
      {TrackingStatus::kWaiting, v1::TRACKING_STATUS_WAITING},
      {TrackingStatus::kLost, v1::TRACKING_STATUS_LOST},
      {TrackingStatus::kHolding, v1::TRACKING_STATUS_HOLDING}};
  v1::CameraReply reply;
  for (const auto& [status, sent] : statuses) {
    step.status = status;
    camera_reply_to_proto(*answer, *wire.session, {}, reply);
    EXPECT_EQ(reply.status(), sent);
  }
  EXPECT_EQ(reply.view_s(), 1.25);
  EXPECT_EQ(reply.blocked_by(), 77u);
  EXPECT_TRUE(reply.flags().evading() && reply.flags().deflected() && reply.flags().new_shot());
  const v1::SightForecast& forecast = reply.targets(0).forecast();
  EXPECT_EQ(forecast.ahead_s(), 0.5);
  EXPECT_EQ(forecast.share(), 0.25);
  EXPECT_EQ(forecast.confidence(), 0.75);
  EXPECT_EQ(forecast.loss_s(), 0.375);
  EXPECT_TRUE(reply.targets(1).has_forecast());
  EXPECT_FALSE(reply.targets(1).forecast().has_loss_s());
  ASSERT_EQ(reply.targets(0).occluders_size(), 2);
  EXPECT_EQ(reply.targets(0).occluders(0).id(), 9u);
  EXPECT_EQ(reply.targets(0).occluders(0).share(), 0.5);
  EXPECT_EQ(reply.targets(0).occluders(1).id(), 8u);
  EXPECT_EQ(reply.targets(0).occluders(1).share(), 0.125);
}

// Each flag by itself, so that none is sent as another.
TEST(ToProto, EveryFlagIsSentAsItself) {
  Wire wire(make_open());
  wire.play(make_tick(1));
  auto answer = wire.session->step();
  ASSERT_TRUE(answer);
  const auto sent = [&](StepFlags flags) {
    answer->step.flags = flags;
    v1::CameraReply reply;
    camera_reply_to_proto(*answer, *wire.session, {}, reply);
    return reply.flags().ShortDebugString();
  };
  EXPECT_EQ(sent({}), "");
  EXPECT_EQ(sent({.dt_capped = true}), "dt_capped: true");
  EXPECT_EQ(sent({.used_cube_map = true}), "used_cube_map: true");
  EXPECT_EQ(sent({.body_overlap = true}), "body_overlap: true");
  EXPECT_EQ(sent({.evading = true}), "evading: true");
  EXPECT_EQ(sent({.deflected = true}), "deflected: true");
  EXPECT_EQ(sent({.new_shot = true}), "new_shot: true");
  EXPECT_EQ(sent({.distance_given_up = true}), "distance_given_up: true");
  EXPECT_EQ(sent({.elevation_given_up = true}), "elevation_given_up: true");
}

TEST(ToProto, TheTimesOfTheStagesAreInMicroseconds) {
  Wire wire(make_open());
  wire.play(make_tick(1));
  auto answer = wire.session->step();
  ASSERT_TRUE(answer);
  answer->queue_ns = 1'500, answer->scene_ns = 2'000;
  answer->step.stage_ns = {4'000, 8'000, 16'000, 32'000};
  v1::CameraReply reply;
  camera_reply_to_proto(*answer, *wire.session, {}, reply);
  const v1::StageTimes& times = reply.stage_times();
  EXPECT_EQ(times.queue_us(), 1.5f);
  EXPECT_EQ(times.scene_us(), 2.0f);
  EXPECT_EQ(times.bound_us(), 4.0f);
  EXPECT_EQ(times.sample_us(), 8.0f);
  EXPECT_EQ(times.aggregate_us(), 16.0f);
  EXPECT_EQ(times.move_us(), 32.0f);
  EXPECT_EQ(times.total_us(), 62.0f) << "without the time in the queue";
}

TEST(ToProto, ReasonsAndWhatATargetIsLikeAreSent) {
  Wire wire(make_open());
  wire.play(make_tick(1));
  auto answer = wire.session->step();
  ASSERT_TRUE(answer);
  v1::CameraReply reply;
  const std::pair<MoveReason, v1::MoveReason> reasons[] = {
      {MoveReason::kAtDesiredPlace, v1::MOVE_REASON_AT_DESIRED_PLACE},
      {MoveReason::kNearestAllVisible, v1::MOVE_REASON_NEAREST_ALL_VISIBLE},
      {MoveReason::kBestAllVisible, v1::MOVE_REASON_BEST_ALL_VISIBLE},
      {MoveReason::kBestPartial, v1::MOVE_REASON_BEST_PARTIAL},
      {MoveReason::kHorizonGrown, v1::MOVE_REASON_HORIZON_GROWN},
      {MoveReason::kNoTargets, v1::MOVE_REASON_NO_TARGETS},
      {MoveReason::kPaused, v1::MOVE_REASON_PAUSED},
      {MoveReason::kBlockedByGeometry, v1::MOVE_REASON_BLOCKED_BY_GEOMETRY},
      {MoveReason::kBodyOverlap, v1::MOVE_REASON_BODY_OVERLAP},
      {MoveReason::kObservedCut, v1::MOVE_REASON_OBSERVED_CUT},
      {MoveReason::kCut, v1::MOVE_REASON_CUT},
      {MoveReason::kFarViewpoint, v1::MOVE_REASON_FAR_VIEWPOINT},
      {MoveReason::kOtherShot, v1::MOVE_REASON_OTHER_SHOT},
      {MoveReason::kBestSoon, v1::MOVE_REASON_BEST_SOON},
      {MoveReason::kStays, v1::MOVE_REASON_STAYS},
      {MoveReason::kNearestView, v1::MOVE_REASON_NEAREST_VIEW},
      {MoveReason::kFarWay, v1::MOVE_REASON_FAR_WAY}};
  for (const auto& [reason, expected] : reasons) {
    answer->step.reason = reason;
    camera_reply_to_proto(*answer, *wire.session, {}, reply);
    EXPECT_EQ(reply.reason(), expected);
    EXPECT_EQ(reply.reason_text(), explain(reason));
  }
  for (const bool yes : {false, true}) {
    answer->cut = yes, answer->merged_ticks = yes ? 3 : 0;
    answer->step.targets[0].in_picture = yes, answer->step.targets[0].given_up = !yes;
    answer->step.targets[0].visible_share = yes ? 0.25 : 0.75;
    camera_reply_to_proto(*answer, *wire.session, {}, reply);
    EXPECT_EQ(reply.cut(), yes);
    EXPECT_EQ(reply.merged_ticks(), yes ? 3u : 0u);
    EXPECT_EQ(reply.targets(0).in_picture(), yes);
    EXPECT_EQ(reply.targets(0).given_up(), !yes);
    EXPECT_EQ(reply.targets(0).visible_share(), yes ? 0.25 : 0.75);
  }
}

TEST(ToProto, ATargetBehindTheCameraIsOffScreen) {
  v1::OpenSession open = make_open();
  open.mutable_camera()->mutable_rotation()->set_y(1);  // looks away
  Wire wire(open);
  EXPECT_EQ(wire.play(make_tick(1)).targets(0).state(), v1::TARGET_STATE_OFF_SCREEN);
}

TEST(ToProto, DiagnosticsComeWhenAskedForAndGoAgain) {
  Wire wire(unity_open());
  const v1::CameraReply full = wire.play(unity_tick(1), {true, true});
  const int n = full.candidates().visible_masks_size();
  EXPECT_GT(n, 27);
  EXPECT_EQ(full.candidates().positions_size(), 3 * n);
  ASSERT_EQ(full.depth_maps_size(), 2);
  const v1::DepthMap& map = full.depth_maps(0);
  EXPECT_EQ(map.target_id(), 1u);
  EXPECT_EQ(map.distances_m_size(), static_cast<int>(map.width() * map.height()));
  EXPECT_EQ(map.occluder_ids_size(), map.distances_m_size());
  expect_near(vec(map.view().position()), {1, 1, 0}, 1e-6);
  // The map looks from the target towards the camera, along its own -Z.
  const glm::dvec3 towards = glm::normalize(glm::dvec3(0, 1.6, 6) - glm::dvec3(1, 1, 0));
  EXPECT_GT(glm::dot(quat(map.view().rotation()) * glm::dvec3(0, 0, -1), towards), 0.9);
  const v1::CameraReply& lean = wire.play(unity_tick(2));
  EXPECT_FALSE(lean.has_candidates());
  EXPECT_EQ(lean.depth_maps_size(), 0);
}

void add_box(v1::OpenSession& open, uint64_t id, const glm::dvec3& center, const glm::dvec3& half_extent) {
  v1::NewInstance& instance = *open.add_instances();
  instance.set_id(id);
  set(instance.mutable_shape()->mutable_box()->mutable_half_extent(), half_extent.x, half_extent.y, half_extent.z);
  set(instance.mutable_pose()->mutable_position(), center.x, center.y, center.z);
}

// A wall of four boxes between the people and the camera. Its near side is at z = 1.9, and the boxes meet at x = 0, y
// = 1.2.
v1::OpenSession open_with_quartered_wall() {
  v1::OpenSession open = make_open();
  for (const int right : {0, 1})
    for (const int above : {0, 1})
      add_box(open, static_cast<uint64_t>(701 + right + 2 * above), {right ? 10 : -10, above ? 11.2 : -8.8, 2},
              {10, 10, 0.1});
  return open;
}

// The distances from the eye of a map to the plane z = 1.9 along the four corners of a texel, and the boxes that these
// corners show. The ray of the texel is somewhere between them.
struct TexelOnWall {
  TexelOnWall(const v1::DepthMap& map, int index) {
    const int x = index % static_cast<int>(map.width()), y = index / static_cast<int>(map.width());
    for (const int right : {0, 1})
      for (const int above : {0, 1}) {
        const glm::dvec3 in_view(map.left() + (x + right) * (map.right() - map.left()) / map.width(),
                                 map.bottom() + (y + above) * (map.top() - map.bottom()) / map.height(), -1);
        const glm::dvec3 ray = glm::normalize(quat(map.view().rotation()) * in_view);
        const double distance_m = (1.9 - map.view().position().z()) / ray.z;
        const glm::dvec3 hit = vec(map.view().position()) + ray * distance_m;
        least_m = std::min(least_m, distance_m), most_m = std::max(most_m, distance_m);
        towards_wall = towards_wall && ray.z > 0.2;
        boxes.insert(static_cast<uint64_t>(701 + (hit.x > 0) + 2 * (hit.y > 1.2)));
      }
  }
  double least_m = 1e9, most_m = 0;
  bool towards_wall = true;
  std::set<uint64_t> boxes;
};

TEST(ToProto, ADepthMapHasTheDistanceAndTheIdOfEachTexelsOccluder) {
  Wire wire(open_with_quartered_wall());
  const v1::CameraReply& reply = wire.play(make_tick(1), {true, true});
  std::map<uint64_t, int> texels_of;
  for (const v1::DepthMap& map : reply.depth_maps())
    for (int i = 0; i < map.distances_m_size(); ++i) {
      EXPECT_EQ(map.occluder_ids(i) == 0, std::isinf(map.distances_m(i)));
      const TexelOnWall texel(map, i);
      // a person may stand before the wall
      if (!texel.towards_wall || map.occluder_ids(i) == 1 || map.occluder_ids(i) == 2) continue;
      EXPECT_GT(map.distances_m(i), texel.least_m - 0.02);
      EXPECT_LT(map.distances_m(i), texel.most_m + 0.02);
      EXPECT_TRUE(texel.boxes.contains(map.occluder_ids(i))) << map.occluder_ids(i);
      texels_of[map.occluder_ids(i)] += texel.boxes.size() == 1;
    }
  for (const uint64_t id : {701, 702, 703, 704}) EXPECT_GT(texels_of[id], 0) << id;
}

TEST(ToProto, DepthMapsThatNothingHidesHaveNoOccluder) {
  Wire wire(make_open());
  int free_texels = 0;
  for (const v1::DepthMap& map : wire.play(make_tick(1), {true, true}).depth_maps())
    for (int i = 0; i < map.occluder_ids_size(); ++i) {
      EXPECT_TRUE(map.occluder_ids(i) <= 2);
      free_texels += map.occluder_ids(i) == 0 && std::isinf(map.distances_m(i));
    }
  EXPECT_GT(free_texels, 0);
}

// The camera goes to a candidate when it sees more from there. With the default settings it flies to places of its plan
// instead.
TEST(ToProto, TheChosenCandidateIsToldWhereOneIsChosen) {
  v1::OpenSession open = make_open();
  open.mutable_settings()->set_preset(v1::Settings::PRESET_PAPER);
  Wire wire(open);
  int chosen_times = 0;
  for (uint64_t sequence = 1; sequence <= 40; ++sequence) {
    v1::Tick tick = make_tick(sequence);
    for (int i = 0; i < tick.transforms().ids_size(); ++i)
      if (tick.transforms().ids(i) == 1)
        tick.mutable_transforms()->set_positions(3 * i + 2, -0.3 * static_cast<double>(sequence));
    const int chosen = wire.play(tick, {true, true}).candidates().chosen_index();
    EXPECT_EQ(chosen, wire.session->dump().decision.chosen_candidate);
    chosen_times += chosen >= 0;
  }
  EXPECT_GT(chosen_times, 0);
}

TEST(ToProto, ThePairVolumeSaysWhyItWasNotUsed) {
  v1::OpenSession open = make_open();
  open.mutable_tuning()->mutable_aggregate()->set_volume(tuning::v1alpha1::VOLUME_PAIR);
  open.mutable_targets()->RemoveLast();
  Wire wire(open);
  const v1::CameraReply& reply = wire.play(make_tick(1));
  EXPECT_EQ(reply.volume_used(), v1::VOLUME_USED_LATTICE);
  EXPECT_EQ(reply.pair_fallback(), v1::PAIR_FALLBACK_NEEDS_TWO_TARGETS);
}

TEST(ToProto, EveryReasonAgainstThePairVolumeIsTold) {
  Wire wire(make_open());
  wire.play(make_tick(1));
  auto answer = wire.session->step();
  ASSERT_TRUE(answer);
  StepResult& step = answer->step;
  const auto told = [&] {
    v1::CameraReply reply;
    camera_reply_to_proto(*answer, *wire.session, {}, reply);
    return std::pair(reply.volume_used(), reply.pair_fallback());
  };
  step.volume = Volume::kLattice, step.pair_asked = true, step.pair_needs_two = false;
  const std::pair<PairGap, v1::PairFallback> gaps[] = {{PairGap::kNone, v1::PAIR_FALLBACK_UNSPECIFIED},
                                                       {PairGap::kTargetInBound, v1::PAIR_FALLBACK_TARGET_IN_BOUND},
                                                       {PairGap::kOnLine, v1::PAIR_FALLBACK_ON_LINE},
                                                       {PairGap::kTooClose, v1::PAIR_FALLBACK_TOO_CLOSE}};
  for (const auto& [gap, expected] : gaps) {
    step.pair_gap = gap;
    EXPECT_EQ(told(), std::pair(v1::VOLUME_USED_LATTICE, expected));
  }
  step.pair_needs_lattice = true;
  EXPECT_EQ(told(), std::pair(v1::VOLUME_USED_LATTICE, v1::PAIR_FALLBACK_NEEDS_LATTICE));
  step.pair_asked = step.pair_needs_lattice = false;
  EXPECT_EQ(told(), std::pair(v1::VOLUME_USED_LATTICE, v1::PAIR_FALLBACK_UNSPECIFIED)) << "not asked for";
  step.pair_asked = true, step.volume = Volume::kPair;
  EXPECT_EQ(told(), std::pair(v1::VOLUME_USED_PAIR, v1::PAIR_FALLBACK_UNSPECIFIED)) << "used";
}

TEST(ToProto, AnOpenedSessionTellsItsMirror) {
  Wire wire(make_open());
  v1::SessionOpened opened;
  opened_to_proto(*wire.session, opened);
  EXPECT_EQ(opened.mirror_revision(), 1u);
  EXPECT_EQ(opened.mirror_hash(), wire.session->mirror().hash());
  EXPECT_EQ(opened.instance_count(), 2u);
  EXPECT_GT(opened.triangle_count(), 100u);
}

}  // namespace
}  // namespace sightline::test
