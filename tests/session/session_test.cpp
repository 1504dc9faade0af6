#include "server/session/session.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "tests/session/game.h"

namespace sightline::test {
namespace {

void expect_near(const glm::dvec3& got, const glm::dvec3& expected, double tolerance = 1e-12) {
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(got[i], expected[i], tolerance) << "component " << i;
}

// ---- time and merging ----

TEST(SessionClock, TheFirstTickWithoutDtIsPaused) {
  Game game;
  TickMaker tick = game.tick();
  tick.time_s = 1234.5;
  tick.dt_s.reset();
  const SessionAnswer answer = game.play(tick);
  EXPECT_EQ(answer.step.reason, MoveReason::kPaused);
  EXPECT_EQ(answer.pose_time_s, 1234.5);
  expect_near(place_of(answer), {0, 1.6, 6});
}

TEST(SessionClock, WithoutDtTheTimeDifferenceIsTaken) {
  Game told, silent;
  told.play(told.tick());
  silent.play(silent.tick());
  for (int i = 0; i < 20; ++i) {
    TickMaker tick = silent.tick(1.0 / 32);
    tick.dt_s.reset();
    EXPECT_EQ(place_of(told.play(told.tick(1.0 / 32))), place_of(silent.play(tick)));
  }
}

TEST(SessionClock, ADtOfZeroIsPausedAndDefined) {
  Game game;
  for (int i = 0; i < 10; ++i) game.play(game.tick());
  const Pose before = game.session->carried().camera.pose;
  const SessionAnswer answer = game.play(game.tick(0.0));
  EXPECT_EQ(answer.step.status, TrackingStatus::kTracking) << "both are still seen";
  EXPECT_EQ(answer.step.reason, MoveReason::kPaused);
  EXPECT_EQ(answer.step.camera.pose.position_m, before.position_m);
  EXPECT_EQ(answer.step.targets.size(), 2u);
}

TEST(SessionClock, ADtTooShortToDivideByIsPaused) {
  Game game;
  game.play(game.tick());
  const SessionAnswer answer = game.play(game.tick(1e-300).move(kAnn, {-0.5, 1, 0}));
  EXPECT_EQ(answer.step.reason, MoveReason::kPaused);
  EXPECT_TRUE(is_finite(answer.step.camera.angular_velocity_radps));
}

TEST(SessionClock, AGapIsCappedAndFlagged) {
  Game game;
  game.play(game.tick());
  EXPECT_FALSE(game.play(game.tick(0.25)).step.flags.dt_capped);
  EXPECT_TRUE(game.play(game.tick(0.26)).step.flags.dt_capped);
  EXPECT_TRUE(game.play(game.tick(1e19)).step.flags.dt_capped);
}

TEST(SessionClock, TimesThatLieAsFarApartAsTheyMayStayFinite) {
  Game game;
  TickMaker early = game.tick(), late = game.tick();
  early.time_s = -kFarthestTimeS;
  late.time_s = kFarthestTimeS;
  late.dt_s.reset();
  game.play(early);
  const SessionAnswer answer = game.play(late);
  EXPECT_TRUE(answer.step.flags.dt_capped);
  EXPECT_TRUE(is_finite(place_of(answer)));
}

TEST(SessionClock, TheFirstSequenceMayBeAny) {
  for (const uint64_t first : {uint64_t{0}, uint64_t{77}, UINT64_MAX}) {
    Game game;
    TickMaker tick = game.tick();
    tick.sequence = first;
    EXPECT_EQ(game.play(tick).sequence, first);
  }
}

TEST(SessionMerge, MergedTicksKeepTheNewestStateAndSumTheirTime) {
  Game merged, single;
  merged.play(merged.tick());
  single.play(single.tick());
  for (int i = 1; i <= 5; ++i)
    merged.apply(merged.tick(1.0 / 64).move(kAnn, {-1 + 0.01 * i, 1, 0}).at_speed({0.64, 0, 0}));
  const SessionAnswer five = merged.answer();
  const SessionAnswer one = single.play(single.tick(5.0 / 64).move(kAnn, {-1 + 0.01 * 5, 1, 0}).at_speed({0.64, 0, 0}));

  EXPECT_EQ(five.merged_ticks, 4u);
  EXPECT_EQ(one.merged_ticks, 0u);
  EXPECT_EQ(five.sequence, 6u);
  EXPECT_EQ(five.time_s, one.time_s);
  EXPECT_EQ(five.hash, one.hash);
  EXPECT_EQ(place_of(five), place_of(one));
  EXPECT_EQ(five.step.camera.velocity_mps, one.step.camera.velocity_mps);
}

TEST(SessionMerge, AStepWithoutATickIsPaused) {
  Game game;
  game.play(game.tick());
  const SessionAnswer again = game.answer();
  EXPECT_EQ(again.step.reason, MoveReason::kPaused);
  EXPECT_EQ(again.merged_ticks, 0u);
  EXPECT_EQ(again.sequence, 1u);
}

// ---- velocities ----

TEST(SessionVelocity, IsDerivedFromSuccessivePositions) {
  Game game;
  game.apply(game.tick(0.5).move(kAnn, {-1, 1, 0}));
  EXPECT_EQ(game.instance(kAnn).velocity_mps, glm::dvec3(0.0));
  game.apply(game.tick(0.5).move(kAnn, {0.5, 1, -1}));
  expect_near(game.instance(kAnn).velocity_mps, {3, 0, -2});
}

TEST(SessionVelocity, SentVelocitiesAreTakenAsSent) {
  Game game;
  game.apply(game.tick(0.5).move(kAnn, {5, 1, 0}).at_speed({0, 0, 7}));
  EXPECT_EQ(game.instance(kAnn).velocity_mps, glm::dvec3(0, 0, 7));
  game.apply(game.tick(0.5));  // not named: it keeps its last velocity
  EXPECT_EQ(game.instance(kAnn).velocity_mps, glm::dvec3(0, 0, 7));
}

TEST(SessionVelocity, ATeleportHasNone) {
  Game game;
  game.apply(game.tick(0.1).move(kAnn, {-1 + 0.099 * kTeleportSpeedMps, 1, 0}));
  expect_near(game.instance(kAnn).velocity_mps, {0.99 * kTeleportSpeedMps, 0, 0}, 1e-9);
  game.apply(game.tick(0.1).move(kAnn, {500, 1, 0}));
  EXPECT_EQ(game.instance(kAnn).velocity_mps, glm::dvec3(0.0));
}

TEST(SessionVelocity, AnInstanceThatIsNoLongerNamedHasStopped) {
  Game game;
  game.apply(game.tick(0.5).move(kAnn, {0, 1, 0}).move(kBob, {2, 1, 0}));
  game.apply(game.tick(0.5).move(kBob, {3, 1, 0}));
  EXPECT_EQ(game.instance(kAnn).velocity_mps, glm::dvec3(0.0));
  expect_near(game.instance(kAnn).pose.position_m, {0, 1, 0});
  expect_near(game.instance(kBob).velocity_mps, {2, 0, 0});
  game.apply(game.tick(0.5));
  EXPECT_EQ(game.instance(kBob).velocity_mps, glm::dvec3(0.0));
}

TEST(SessionVelocity, NothingIsDerivedWhenNoTimePasses) {
  Game game;
  game.apply(game.tick(0.5).move(kAnn, {0, 1, 0}).move(kBob, {2, 1, 0}));
  game.apply(game.tick(0.0).move(kAnn, {0, 1, 0}).move(kBob, {4, 1, 0}));
  expect_near(game.instance(kAnn).velocity_mps, {2, 0, 0});      // stands where it stood
  EXPECT_EQ(game.instance(kBob).velocity_mps, glm::dvec3(0.0));  // jumped
  game.apply(game.tick(0.0));
  expect_near(game.instance(kAnn).velocity_mps, {2, 0, 0});
  game.apply(game.tick(0.5));
  EXPECT_EQ(game.instance(kAnn).velocity_mps, glm::dvec3(0.0));
}

TEST(SessionVelocity, ANewInstanceStandsStill) {
  Game game;
  TickMaker tick = game.tick(0.5);
  tick.delta.add = {game.make(20, SphereShape{0.2f}, {0, 0, 0})};
  game.apply(tick.move(20, {3, 0, 0}));
  EXPECT_EQ(game.instance(20).velocity_mps, glm::dvec3(0.0));
}

TEST(SessionRotation, StaysWhenNotSent) {
  Game game;
  TickMaker turned = game.tick();
  turned.move(kCrate, {0, 1, -4});
  turned.transforms.poses[0].rotation = glm::angleAxis(0.7, glm::dvec3(0, 1, 0));
  game.apply(turned);
  TickMaker moved = game.tick();
  moved.move(kCrate, {0, 2, -4}).keeps_rotations = true;
  game.apply(moved);
  EXPECT_NEAR(glm::angle(game.instance(kCrate).pose.rotation), 0.7, 1e-12);
  expect_near(game.instance(kCrate).pose.position_m, {0, 2, -4});
}

TEST(SessionRotation, OfAnAddedInstanceIsWhatItWasAddedWith) {
  Game game;
  TickMaker tick = game.tick();
  tick.delta.remove = {kCrate};
  tick.delta.add = {game.make(kCrate, SphereShape{0.2f}, {0, 0, 0})};
  tick.delta.add[0].pose.rotation = glm::angleAxis(0.4, glm::dvec3(1, 0, 0));
  tick.move(kCrate, {3, 0, 0}).keeps_rotations = true;
  game.apply(tick);
  EXPECT_NEAR(glm::angle(game.instance(kCrate).pose.rotation), 0.4, 1e-12);
}

// ---- the observed camera ----

TEST(SessionObserved, ACutIsReportedAndResetsTheWantedPosition) {
  Game game;
  for (int i = 0; i < 5; ++i) game.play(game.tick());
  const glm::dvec3 wanted = game.session->carried().shot.offset_m;
  TickMaker tick = game.tick();
  tick.observed_camera = seen_at({8, 2, 8}, true);
  const SessionAnswer answer = game.play(tick);
  EXPECT_TRUE(answer.cut);
  EXPECT_EQ(answer.step.reason, MoveReason::kObservedCut);
  EXPECT_LT(glm::distance(place_of(answer), glm::dvec3(8, 2, 8)), 0.01);
  EXPECT_GT(glm::distance(game.session->carried().shot.offset_m, wanted), 1.0);
  EXPECT_FALSE(game.play(game.tick()).cut);
}

TEST(SessionObserved, APushKeepsTheWantedPlace) {
  Game game;
  for (int i = 0; i < 5; ++i) game.play(game.tick());
  const glm::dvec3 wanted = game.session->carried().shot.offset_m;
  TickMaker tick = game.tick();
  tick.observed_camera = seen_at({1, 2, 7}, false);
  const SessionAnswer answer = game.play(tick);
  EXPECT_FALSE(answer.cut);
  EXPECT_LT(glm::distance(place_of(answer), glm::dvec3(1, 2, 7)), 0.01);
  EXPECT_EQ(game.session->carried().shot.offset_m, wanted);
}

TEST(SessionObserved, RestartsTheMergedTime) {
  Game merged, single;
  merged.play(merged.tick());
  single.play(single.tick());
  merged.apply(merged.tick(0.2));
  TickMaker late = merged.tick(1.0 / 64), only = single.tick(1.0 / 64);
  late.observed_camera = only.observed_camera = seen_at({2, 2, 7}, false);
  EXPECT_EQ(place_of(merged.play(late)), place_of(single.play(only)));
}

TEST(SessionObserved, ACutInAMergedTickIsNotLost) {
  Game game;
  game.play(game.tick());
  TickMaker cut = game.tick();
  cut.observed_camera = seen_at({8, 2, 8}, true);
  game.apply(cut);
  EXPECT_TRUE(game.play(game.tick()).cut);
}

// ---- targets, lens, relative pose ----

TEST(SessionTargets, AreReplacedWithTheTickThatRemovesOne) {
  Game game;
  TickMaker tick = game.tick();
  tick.delta.remove = {kBob};
  tick.targets = {Game::target(kAnn)};
  EXPECT_EQ(game.play(tick).step.targets.size(), 1u);
}

TEST(SessionTargets, MayNameWhatTheSameTickAdds) {
  Game game;
  TickMaker tick = game.tick();
  tick.delta.add = {game.make(20, SphereShape{0.2f}, {0, 1, 0})};
  tick.targets = {Game::target(20)};
  EXPECT_EQ(game.play(tick).step.targets[0].id, 20u);
}

TEST(SessionTargets, OneThatIsRemovedAndAddedAgainStays) {
  Game game;
  TickMaker tick = game.tick();
  tick.delta.remove = {kBob};
  tick.delta.add = {game.make(kBob, SphereShape{0.2f}, {1, 1, 0})};
  EXPECT_EQ(game.play(tick).step.targets.size(), 2u);
}

TEST(SessionTargets, NoneIsAnAnswerToo) {
  Game game;
  TickMaker tick = game.tick();
  tick.targets.emplace();
  const SessionAnswer answer = game.play(tick);
  EXPECT_EQ(answer.step.reason, MoveReason::kNoTargets);
  EXPECT_FALSE(answer.relative_target_id.has_value());
}

TEST(SessionTargets, AttachedInstancesMayBeRemovedLater) {
  Game game;
  TickMaker attach = game.tick(), remove = game.tick();
  attach.targets = {Game::target(kAnn)};
  attach.targets->front().attached_ids = {kCrate};
  remove.delta.remove = {kCrate};
  game.play(attach);
  game.play(remove);
}

TEST(SessionTargets, PartsMayBeRemovedLaterAndAddedAgain) {
  ExtentCache extents;
  Game game([&](SessionOptions& options) {
    options.settings.sample.points = 8;
    options.extents = &extents;
  });
  // The part stands beside a wall that hides the target.
  TickMaker begin = game.tick(), remove = game.tick(), again = game.tick();
  begin.delta.add = {game.make(20, BoxShape{{1, 2, 0.1f}}, {-1, 1, 3}),
                     game.make(21, CapsuleShape{0.3f, 0.6f}, {3, 1, 0})};
  begin.targets = {Game::target(kAnn)};
  begin.targets->front().part_ids = {21};
  EXPECT_NEAR(game.play(begin).step.targets[0].visible_share, 0.5, 0.13);
  remove.delta.remove = {21};
  EXPECT_EQ(game.play(remove).step.targets[0].visible_share, 0.0);
  again.delta.add = {game.make(21, SphereShape{0.8f}, {3, 1, 0})};
  EXPECT_GT(game.play(again).step.targets[0].visible_share, 0.5) << "the table of its new shape is used";
}

TEST(SessionTargets, TakeThe64PartsThatTheyPromise) {
  Game game([](SessionOptions& options) {
    for (uint64_t id = 100; id < 164; ++id) {
      options.instances.push_back(options.instances[0]);
      options.instances.back().id = id;
      options.targets[0].part_ids.push_back(id);
    }
  });
  EXPECT_EQ(game.play(game.tick()).step.targets.size(), 2u);
}

TEST(SessionRelative, IsSeenFromTheFirstRequiredTarget) {
  Game game;
  TickMaker tick = game.tick();
  tick.targets = {Game::target(kWall), Game::target(kCrate), Game::target(kBob), Game::target(kAnn)};
  (*tick.targets)[0].weight = 0;
  (*tick.targets)[1].required = false;
  tick.move(kBob, {1, 1, 0}).transforms.poses[0].rotation = glm::angleAxis(0.8, glm::dvec3(0, 1, 0));
  const SessionAnswer answer = game.play(tick);
  ASSERT_EQ(answer.relative_target_id, kBob);
  const Pose& bob = game.instance(kBob).pose;
  expect_near(transform_point(bob, answer.target_from_camera.position_m), place_of(answer), 1e-9);
  EXPECT_LT(angle_between(bob.rotation * answer.target_from_camera.rotation, answer.step.camera.pose.rotation), 1e-7);
}

// The camera stands still in the world: a turn of the target moves it in the frame that turns along, and in no other.
TEST(SessionRelative, WithoutTheRotationATurnOnTheSpotChangesNothing) {
  Game game;
  const auto facing = [&](double angle) {
    TickMaker tick = game.tick();
    tick.targets = {Game::target(kBob)};
    tick.dt_s = 0.0;
    tick.move(kBob, {0, 1, 0}).transforms.poses[0].rotation = glm::angleAxis(angle, glm::dvec3(0, 1, 0));
    return game.play(tick);
  };
  const SessionAnswer before = facing(0.0), after = facing(std::numbers::pi / 2);
  const glm::dvec3 was = before.target_from_camera.position_m, is = after.target_from_camera.position_m;
  expect_near(is, {-was.z, was.y, was.x}, 1e-9);
  EXPECT_GT(glm::distance(was, is), 1.0);
  expect_near(before.unrotated_from_camera.position_m, after.unrotated_from_camera.position_m, 1e-12);
  expect_near(glm::dvec3(0, 1, 0) + after.unrotated_from_camera.position_m, place_of(after), 1e-12);
  EXPECT_EQ(after.unrotated_from_camera.rotation, after.step.camera.pose.rotation);
}

TEST(SessionRelative, FallsBackToAnOptionalTarget) {
  Game game;
  TickMaker tick = game.tick();
  tick.targets = {Game::target(kAnn), Game::target(kBob)};
  (*tick.targets)[0].weight = 0;
  (*tick.targets)[1].required = false;
  EXPECT_EQ(game.play(tick).relative_target_id, kBob);
}

TEST(SessionLens, StaysUntilAnotherIsSent) {
  Game game;
  TickMaker tick = game.tick();
  tick.lens.emplace().vertical_fov_rad = 1.0;
  EXPECT_EQ(game.play(tick).lens.vertical_fov_rad, 1.0);
  EXPECT_EQ(game.play(game.tick()).lens.vertical_fov_rad, 1.0);
}

TEST(SessionOpen, TakesThe32TargetsThatItPromises) {
  Game game([](SessionOptions& o) {
    const NewInstance person = o.instances[0];
    for (uint64_t id = 100; o.targets.size() < kMaxTargets; ++id) {
      o.instances.push_back(person);
      o.instances.back().id = id;
      o.targets.push_back(Game::target(id));
    }
  });
  EXPECT_EQ(game.play(game.tick()).step.targets.size(), 32u);
}

TEST(SessionOpen, TheSceneIsOneRevision) {
  Game game;
  EXPECT_EQ(game.session->mirror().revision(), 1u);
  EXPECT_EQ(game.session->mirror().size(), 4u);
  EXPECT_GT(game.session->triangle_count(), 24u);
}

// ---- a device that fails ----

class FlakySampler : public Sampler {
 public:
  Status take(const SceneMirror&, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) override {
    if (fails) return fail(ErrorCode::kUnavailable, "", "the device was lost");
    maps.resize(requests.size());
    for (size_t i = 0; i < maps.size(); ++i) {
      const size_t texels = static_cast<size_t>(requests[i].view.width) * static_cast<size_t>(requests[i].view.height);
      maps[i] = {requests[i].view, std::vector<float>(texels, std::numeric_limits<float>::infinity()),
                 std::vector<uint32_t>(texels, kNoOccluder)};
    }
    return {};
  }
  bool fails = false;
};

TEST(SessionSampler, WhatAFailedStepMissedIsInTheNext) {
  Game game;
  auto made = std::make_unique<FlakySampler>();
  FlakySampler& sampler = *made;
  auto opened = Session::open(game.make_options(), std::move(made), nullptr);
  ASSERT_TRUE(opened.has_value());
  Session& session = **opened;
  TickMaker cut = game.tick();
  cut.observed_camera = seen_at({8, 2, 8}, true);
  sampler.fails = true;
  ASSERT_TRUE(session.apply(cut).has_value());
  const auto failed = session.step();
  ASSERT_FALSE(failed.has_value());
  EXPECT_EQ(failed.error().code, ErrorCode::kUnavailable);

  sampler.fails = false;
  ASSERT_TRUE(session.apply(game.tick()).has_value());
  const auto answer = session.step();
  ASSERT_TRUE(answer.has_value());
  EXPECT_EQ(answer->merged_ticks, 1u);
  EXPECT_TRUE(answer->cut);
}

TEST(SessionTimes, AreTakenFromTheClockThatIsGiven) {
  Game game;
  int64_t now_ns = 1000;
  auto opened = Session::open(game.make_options(), std::make_unique<FlakySampler>(), [&] { return now_ns += 10; });
  ASSERT_TRUE(opened.has_value());
  TickMaker tick = game.tick();
  tick.arrival_ns = now_ns - 500;
  ASSERT_TRUE((*opened)->apply(tick).has_value());
  const int64_t before_step_ns = now_ns;
  const auto answer = (*opened)->step();
  ASSERT_TRUE(answer.has_value());
  EXPECT_EQ(answer->scene_ns, 10);
  EXPECT_EQ(answer->queue_ns, before_step_ns + 10 - tick.arrival_ns);
}

}  // namespace
}  // namespace sightline::test
