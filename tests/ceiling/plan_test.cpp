// Whole plans on small scenes whose answer is known, judged as every other policy is.
#include "client/ceiling/plan.h"

#include <gtest/gtest.h>
#include <glm/gtc/quaternion.hpp>

#include "client/truth/coherence.h"
#include "client/truth/metrics.h"
#include "scenes/streets.h"
#include "tests/support/small_scenes.h"

namespace sightline {
namespace {

constexpr double kTickS = 1.0 / 30.0;
constexpr size_t kTicksPerPicture = 3;

PlanOptions quick_options() {
  PlanOptions options;
  options.reach_m = 6.0;
  options.beam.width = 60;
  options.beam.tried = 120;
  return options;
}

struct Played {
  CeilingPlan plan;
  std::vector<CameraFrame> frames;
  RunMetrics metrics;
  CoherenceMetrics coherence;
};

CeilingPlan plan_of(test::Place& place, double duration_s, const CameraLimits& limits = {},
                    PlanAim aim = PlanAim::kJoint) {
  const Timeline timeline = timeline_of(kTickS, static_cast<size_t>(std::lround(duration_s / kTickS)) + 1,
                                        kTicksPerPicture);
  const MoveSettings place_limits;
  PlanOptions options = quick_options();
  options.aim = aim;
  return *plan_ceiling(place.scenario, place.store, place.device, place.extents, timeline, limits, place_limits,
                       options);
}

Played played(const test::SmallScene& scene, double duration_s, const CameraLimits& limits = {},
              PlanAim aim = PlanAim::kJoint) {
  test::Place place(scene);
  Played run{.plan = plan_of(place, duration_s, limits, aim), .frames = {}, .metrics = {}, .coherence = {}};
  for (size_t tick = 0; tick < run.plan.path.size(); ++tick)
    run.frames.push_back({static_cast<double>(tick) * kTickS, run.plan.path[tick], place.scenario.lens(), false});
  JudgeOptions judging;
  judging.picture_every = kTicksPerPicture;
  const auto truths = judge(place.scenario, place.store, place.device, run.frames, judging);
  run.metrics = summarize(place.scenario, run.frames, *truths, limits);
  EXPECT_EQ(run.frames.size(), static_cast<size_t>(std::lround(duration_s / kTickS)) + 1);
  EXPECT_EQ(run.metrics.limit_violations, 0u);
  EXPECT_EQ(run.metrics.body_collisions, 0u);
  const auto world = place.world();
  std::vector<glm::dvec3> centers_m;
  for (const CameraFrame& frame : run.frames)
    world->set_time(frame.time_s), centers_m.push_back(world->targets_center_m());
  run.coherence = coherence_of(run.frames, shots_as_begun(run.frames, centers_m), *truths);
  const double reached = aim == PlanAim::kJoint ? run.metrics.joint_visible_share() : run.coherence.mean_worth;
  EXPECT_LE(reached, run.plan.most + (aim == PlanAim::kJoint ? 1e-9 : 0.03)) << "worth is estimated with few rays";
  return run;
}

// A figure that walks straight at a constant speed.
scenes::Motion straight(const glm::dvec3& from_m, const glm::dvec3& to_m, double duration_s) {
  scenes::Motion motion;
  for (double time_s : {0.0, duration_s}) motion.add(time_s, glm::mix(from_m, to_m, time_s / duration_s), {1, 0, 0, 0});
  return motion;
}

TEST(Ceiling, IsEveryPictureOnAnOpenPlane) {
  const Played run = played(test::SmallScene(3, {0, 2, 5})
                                .walker("anna", straight({-1.5, 0, 0}, {3, 0, 0}, 3))
                                .walker("ben", straight({0, 0, -1}, {4.5, 0, -1}, 3)),
                            3);
  EXPECT_EQ(run.metrics.joint_visible_share(), 1.0);
  EXPECT_EQ(run.plan.most, 1.0);
  EXPECT_EQ(run.plan.joint, 1.0);
}

TEST(Ceiling, IsNothingForATargetInAClosedBox) {
  const Played run = played(test::SmallScene(2, {0, 1.5, 5}).target("anna", {0, 0, 0}).closed_box(false), 2);
  EXPECT_EQ(run.metrics.joint_visible_share(), 0.0);
  EXPECT_EQ(run.plan.most, 0.0);
  EXPECT_EQ(run.plan.joint, 0.0);
}

TEST(Ceiling, OfACameraThatStartsInAWallIsToStayThere) {
  test::Place place(test::SmallScene(2, {0, 1.5, 5}).target("anna", {0, 0, 0}).box("wall", {20, 20, 1}, {0, 0, 5}));
  const CeilingPlan plan = plan_of(place, 2);
  ASSERT_EQ(plan.path.size(), static_cast<size_t>(std::lround(2 / kTickS)) + 1);
  for (const Pose& pose : plan.path) EXPECT_EQ(pose.position_m, glm::dvec3(0, 1.5, 5));
}

// The camera starts at rest. It sees past the wall's end no sooner than a straight way leads to where the line of sight
// is free.
TEST(Ceiling, OfATargetBehindAWallIsWhatIsLeftAfterTheWayRoundIt) {
  constexpr double kDurationS = 4.0, kHalfWallM = 2.0;
  const Played run = played(test::SmallScene(kDurationS, {0, 1, 3})
                                .target("anna", {0, 0, -1.5})
                                .box("wall", {2 * kHalfWallM, 9, 0.25}, {0, 0, 0}),
                            kDurationS);
  // Seen whole from beyond the line through the wall's end and the target's far side. The line's distance from the
  // start is the shortest way; half of it is sped up at 10 m/s^2 at best.
  const glm::dvec2 far_side(-0.3, -1.5), end(kHalfWallM, -0.125);
  const glm::dvec2 line = glm::normalize(end - far_side), start(0, 3);
  const double way_m = std::abs(line.x * (start.y - end.y) - line.y * (start.x - end.x));
  const double soonest_s = std::sqrt(2 * way_m / CameraLimits{}.max_acceleration_mps2);
  const double most = 1 - std::floor(soonest_s / 0.1) / 41;
  EXPECT_GT(way_m, 2);
  EXPECT_LE(run.metrics.joint_visible_share(), most);
  EXPECT_GE(run.metrics.joint_visible_share(), most - 0.1) << "at most 0.4 s later";
  EXPECT_GE(run.plan.most, most - 1e-9);
}

// A guide that is as slow as people would see no way to keep up.
TEST(Ceiling, KeepsUpWithACarInStreets) {
  constexpr double kDurationS = 15.0;
  test::Place place(scenes::make_street({.seed = 2, .duration_s = kDurationS}));
  CameraLimits limits;
  limits.max_speed_mps = 40.0, limits.max_acceleration_mps2 = 20.0;
  const CeilingPlan plan = plan_of(place, kDurationS, limits);
  EXPECT_GE(plan.joint, 0.9);
}

// The target waits in sight for 2 s and then walks behind the wall. A camera that knows has time to go round; one that
// waits has not.
TEST(Ceiling, IsRoundTheWallBeforeTheTargetIsBehindIt) {
  constexpr double kDurationS = 4.5;
  scenes::Motion walk;
  walk.add(0.0, {-4, 0, -1.5}, {1, 0, 0, 0});
  walk.add(2.0, {-4, 0, -1.5}, {1, 0, 0, 0});
  walk.add(4.0, {0, 0, -1.5}, {1, 0, 0, 0});
  walk.add(kDurationS, {0, 0, -1.5}, {1, 0, 0, 0});
  const auto scene = [&] {
    return test::SmallScene(kDurationS, {0, 1, 4}).walker("anna", walk).box("wall", {5, 9, 0.25}, {0, 0, 0});
  };
  EXPECT_GE(played(scene(), kDurationS).metrics.joint_visible_share(), 0.97);
  CameraLimits slow;
  slow.max_acceleration_mps2 = 0.5;
  slow.max_speed_mps = 0.5;
  EXPECT_LT(played(scene(), kDurationS, slow).metrics.joint_visible_share(), 0.8);
}

TEST(Ceiling, WaitsForADoorThatOpensLater) {
  constexpr double kDurationS = 5.0, kOpensS = 2.5;
  scenes::Motion door;
  const glm::dvec3 shut_m(0, 0, 2.125);
  door.add(0.0, shut_m, {1, 0, 0, 0});
  door.add(kOpensS, shut_m, {1, 0, 0, 0});
  door.add(kOpensS + 0.1, shut_m - glm::dvec3(0, 5, 0), {1, 0, 0, 0});
  door.add(kDurationS, shut_m - glm::dvec3(0, 5, 0), {1, 0, 0, 0});
  const Played run = played(test::SmallScene(kDurationS, {3, 1.5, 5}, {0, 1, 0})
                                .target("anna", {0, 0, -1})
                                .closed_box(true)
                                .mover("door", {1.5, 3, 0.25}, door),
                            kDurationS);
  const double left = 1 - kOpensS / kDurationS;
  EXPECT_LE(run.metrics.joint_visible_share(), left + 0.02);
  EXPECT_GE(run.metrics.joint_visible_share(), left - 0.06) << "the camera is there when the door opens";
  EXPECT_LE(run.plan.most, left + 0.02);
}

// The cart comes faster than the camera may go, and fills the corridor up to 2.5 m.
TEST(Ceiling, LeavesTheWayOfACartThatItSeesComing) {
  constexpr double kDurationS = 3.0;
  scenes::Motion cart;
  cart.add(0.0, {0, 0, 22}, {1, 0, 0, 0});
  cart.add(kDurationS, {0, 0, -14}, {1, 0, 0, 0});
  const Played run = played(
      test::SmallScene(kDurationS, {0, 1, 4}).target("anna", {0.5, 0, -1.5}).mover("cart", {1, 2.5, 2}, cart),
      kDurationS);
  EXPECT_GT(run.metrics.least_clearance_m, CameraLimits{}.body_radius_m);
}

// The bar sinks between the camera and the ground. All places that see the target are in the sphere round it, and most
// are free.
TEST(Ceiling, IsNotBarredBesideALongColliderThatMoves) {
  scenes::Motion bar;
  bar.add(0.0, {0, 0.4, 4}, {1, 0, 0, 0});
  bar.add(2.0, {0, 0.1, 4}, {1, 0, 0, 0});
  const Played run = played(test::SmallScene(2, {0, 2, 5}).target("anna", {0, 0, 0}).mover("bar", {0.1, 0.1, 24}, bar),
                            2);
  EXPECT_EQ(run.plan.most, 1.0);
  EXPECT_EQ(run.metrics.joint_visible_share(), 1.0);
}

TEST(Ceiling, OfWorthKeepsTheFirstPicturesShot) {
  const Played run = played(test::SmallScene(3, {0, 2, 7})
                                .walker("anna", straight({-1, 0, 0}, {3, 0, 0}, 3))
                                .walker("ben", straight({0, 0, -1}, {4, 0, -1}, 3)),
                            3, {}, PlanAim::kWorth);
  EXPECT_GE(run.coherence.mean_worth, 0.99);
  EXPECT_GE(run.coherence.as_asked_share, 0.9);
  EXPECT_GE(run.plan.most, 0.99);
}

// What a picture is worth by the judge's own functions, against the shot of the scenario's first picture.
double worth_of(const test::Place& place, const ScenarioWorld& world, const Pose& pose, int picture_size) {
  const Lens lens = place.scenario.lens();
  PictureTruth picture = measure_picture(world.occluders(), world.mirror(), world.targets(), pose, lens, picture_size);
  add_outlines(world.occluders(), world.mirror(), world.targets(), pose, lens, picture);
  const auto shot_of = [&](const Pose& camera) {
    return shot_properties({0.0, camera, lens}, world.targets_center_m());
  };
  return picture_worth(sight_loss(picture),
                       shot_loss(deviation_between(shot_of(place.scenario.camera()), shot_of(pose)), ShotWeights{}));
}

// A wall hides the lower part of the target from the first place. The best of all pictures is found by trying places
// all round.
TEST(Ceiling, OfWorthEndsWhereThePictureIsWorthMost) {
  constexpr double kDurationS = 5.0;
  const auto scene = [] {
    return test::SmallScene(kDurationS, {0, 1.2, 5}).target("anna", {0, 0, 0}).box("wall", {12, 1.2, 0.25}, {0, 0, 1});
  };
  test::Place place(scene());
  const auto world = place.world();
  const glm::dvec3 center_m = world->targets_center_m();
  double most = 0;
  for (double x_m = -6; x_m <= 6; x_m += 1)
    for (double y_m = 0.5; y_m <= 6; y_m += 0.5)
      for (double z_m = -6; z_m <= 6; z_m += 0.5) {
        const glm::dvec3 eye_m(x_m, y_m, z_m);
        if (glm::distance(eye_m, center_m) < 2) continue;
        most = std::max(most,
                        worth_of(place, *world,
                                 {eye_m, glm::quatLookAt(glm::normalize(center_m - eye_m), glm::dvec3(0, 1, 0))}, 64));
      }
  const double first = worth_of(place, *world, place.scenario.camera(), kTruthSize);
  ASSERT_GT(most, first + 0.1);
  const Played run = played(scene(), kDurationS, {}, PlanAim::kWorth);
  EXPECT_GE(worth_of(place, *world, run.plan.path.back(), kTruthSize), most - 0.05);
  EXPECT_GT(run.coherence.mean_worth, first);
}

TEST(Ceiling, IsTheSameOnEveryRun) {
  test::Place place(test::SmallScene(2, {0, 1, 3}).target("anna", {0, 0, -1.5}).box("wall", {4, 9, 0.25}, {0, 0, 0}));
  const CeilingPlan one = plan_of(place, 2), two = plan_of(place, 2);
  ASSERT_EQ(one.path.size(), two.path.size());
  for (size_t k = 0; k < one.path.size(); ++k) {
    EXPECT_EQ(one.path[k].position_m, two.path[k].position_m);
    EXPECT_EQ(one.path[k].rotation, two.path[k].rotation);
  }
  EXPECT_EQ(one.joint, two.joint);
  EXPECT_EQ(one.most, two.most);
}

TEST(Ceiling, HasAStageAtEveryPicture) {
  for (const size_t every : {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 15, 20, 30}) {
    const Timeline timeline = timeline_of(1.0 / 60, 100, every);
    EXPECT_TRUE(every % timeline.ticks_per_stage == 0 || timeline.ticks_per_stage % every == 0) << every;
  }
  for (const double rate_hz : {5.0, 30.0, 60.0, 125.0})
    for (size_t every = 1; every <= 40; ++every) {
      const Timeline timeline = timeline_of(1 / rate_hz, 100, every);
      EXPECT_GE(timeline.ticks_per_stage, 1u);
      EXPECT_TRUE(timeline.stage_s() <= 0.125 || timeline.ticks_per_stage == 1);
      EXPECT_GE(timeline.stage_s(), 0.05);
    }
  EXPECT_EQ(timeline_of(1.0 / 60, 100, 6).ticks_per_stage, 6u);
  EXPECT_EQ(timeline_of(1.0 / 60, 100, 10).ticks_per_stage, 5u);
}

}  // namespace
}  // namespace sightline
