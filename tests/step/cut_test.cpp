// Cuts: when they are allowed, where they lead, and that they never lead into geometry.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/base/random.h"
#include "server/sample/embree_scene.h"
#include "tests/support/filming.h"

namespace sightline::test {
namespace {

constexpr double kTickS = 1.0 / 60;

// A floor and one target, filmed from 6 m.
struct Stage : OneFilmed {
  Stage() {
    add_box(100, {0, -0.1, 0}, {200, 0.1, 200});
    settings.move.cut_after_s = 0.5;
  }
  // Plays and returns the number of cuts.
  int play(double seconds) {
    int cuts = 0;
    for (int i = 0; i < std::lround(seconds / kTickS); ++i) {
      last = step(kTickS);
      cuts += last.cut;
    }
    return cuts;
  }
  // A closed room with walls 0.2 m thick round `at`.
  void add_room(uint64_t id, const glm::dvec3& at, const glm::dvec3& half) {
    for (int axis = 0; axis < 3; ++axis)
      for (const double side : {-1.0, 1.0}) {
        glm::dvec3 middle = at, size = half + 0.1;
        middle[axis] += side * half[axis], size[axis] = 0.1;
        add_box(id++, middle, glm::vec3(size));
      }
  }
  StepResult last;
};

TEST(Cut, NeverWithoutLeave) {
  Stage stage;
  stage.settings.move.cut_after_s = 0;
  EXPECT_EQ(stage.play(3.0), 0);
  stage.move(1, {20, 1, 0});
  EXPECT_EQ(stage.play(3.0), 0);
}

TEST(Cut, FollowsATargetThatJumpsInTheSameStep) {
  Stage stage;
  EXPECT_EQ(stage.play(3.0), 0) << "a target in sight is no cause";
  const glm::dvec3 offset_m = stage.camera().pose.position_m - glm::dvec3(0, 1, 0);
  stage.move(1, {20, 1, 5});
  EXPECT_EQ(stage.play(kTickS), 1);
  EXPECT_EQ(stage.last.reason, MoveReason::kCut);
  EXPECT_EQ(stage.last.status, TrackingStatus::kTracking);
  EXPECT_LT(glm::distance(stage.camera().pose.position_m, glm::dvec3(20, 1, 5) + offset_m), 1.0) << "it keeps the shot";
  EXPECT_TRUE(stage.last.targets[0].in_picture);
  EXPECT_EQ(stage.last.targets[0].visible_share, 1.0);
  EXPECT_EQ(stage.last.targets[0].filtered_share, 1.0);
  EXPECT_EQ(stage.play(1.5), 0);
}

TEST(Cut, ComesAtLeastTwoSecondsAfterTheLast) {
  Stage stage;
  stage.play(0.5);
  for (const double x_m : {20.0, 60.0, 20.0}) {  // the opening counts as a cut
    stage.move(1, {x_m, 1, 0});
    int waited = 0;
    while (stage.play(kTickS) == 0 && waited < 300) ++waited;
    EXPECT_NEAR(waited * kTickS, x_m == 20 && stage.tick < 200 ? 1.5 : 2.0, 0.1)
        << "the jump is not forgotten meanwhile";
    EXPECT_LT(glm::distance(stage.camera().pose.position_m, glm::dvec3(x_m, 1, 0)), 10.0);
  }
}

// A target that jumps away and comes back by itself, or that the camera has reached meanwhile, is no cause.
TEST(Cut, AJumpIsForgottenWhenTheCameraIsThere) {
  Stage stage;
  stage.play(0.5);
  stage.move(1, {20, 1, 0});
  EXPECT_EQ(stage.play(0.5), 0);
  stage.move(1, {0, 1, 0});
  EXPECT_EQ(stage.play(4.0), 0);
}

TEST(Cut, DoesNotFollowAShortJump) {
  Stage stage;
  stage.play(3.0);
  stage.move(1, {6, 1, 0});
  EXPECT_EQ(stage.play(3.0), 0);
}

// The target is in a closed room, and the camera outside.
TEST(Cut, LeadsIntoAClosedRoomAfterTheTime) {
  for (const double after_s : {0.5, 3.5}) {
    Stage stage;
    stage.settings.move.cut_after_s = after_s;
    const glm::dvec3 half(4.5, 1.6, 4.5);
    stage.add_room(200, {0, 1.7, 0}, half);
    stage.place({0, 1.6, 8}, {0, 1, 0});
    double cut_s = 0;
    for (int i = 1; i <= 420 && cut_s == 0; ++i)
      if (stage.play(kTickS) > 0) cut_s = i * kTickS;
    ASSERT_GT(cut_s, std::max(2.0, after_s) - 2 * kTickS) << after_s;
    EXPECT_LT(cut_s, std::max(2.0, after_s) + 1.0) << after_s;
    const glm::dvec3 in_room = glm::abs(stage.camera().pose.position_m - glm::dvec3(0, 1.7, 0));
    for (int axis = 0; axis < 3; ++axis) EXPECT_LT(in_room[axis], half[axis] - 0.1 - stage.limits.body_radius_m + 1e-6);
    EXPECT_TRUE(stage.last.targets[0].in_picture);
    EXPECT_GT(stage.last.targets[0].visible_share, 0.5);
    EXPECT_EQ(stage.play(3.0), 0) << "it stays where the target is seen";
    EXPECT_GT(stage.last.targets[0].visible_share, 0.5);
  }
}

// A wall hides the target. The camera knows a way round it of a few metres.
TEST(Cut, DoesNotReplaceAShortWay) {
  for (const double beyond_m : {30.0, 0.0}) {
    Stage stage;
    stage.settings.move.cut_after_s = 0.1;
    stage.settings.move.cut_beyond_m = beyond_m;
    stage.play(2.5);
    stage.add_box(300, {0, 1.5, 3}, {2.5f, 1.5f, 0.1f});
    EXPECT_EQ(stage.play(2.5) > 0, beyond_m == 0) << beyond_m;
  }
}

// Two required targets in two closed rooms: no place sees both.
TEST(Cut, SeesTheHeaviestTargetsWhereNotAllCanBeSeen) {
  Stage stage;
  stage.add_target(2, {6, 1, 0}, true, 3.0);
  stage.settings.move.cut_after_s = 0.5;
  stage.add_room(200, {-1.5, 1.7, 0}, {4.0, 1.6, 6});
  stage.add_room(210, {7.0, 1.7, 0}, {4.0, 1.6, 6});
  stage.place({3, 9, 14}, {3, 1, 0});
  int cuts = 0;
  for (int i = 0; i < 600 && cuts == 0; ++i) cuts += stage.play(kTickS);
  ASSERT_EQ(cuts, 1);
  EXPECT_EQ(stage.last.status, TrackingStatus::kPartialView);
  EXPECT_GT(stage.last.targets[1].visible_share, 0.5);
}

// At first no target can be seen from any place. Then one of the two, which has a small weight, can be seen.
TEST(Cut, TakesAViewOfALightTargetAfterRoundsThatFoundNothing) {
  Stage stage;
  stage.add_target(2, {6, 1, 0}, true, 0.5);
  stage.add_box(300, {0, 1, 0}, {1, 1.5, 1});
  stage.add_box(310, {6, 1, 0}, {1, 1.5, 1});
  stage.add_room(200, {3, 1.7, 14}, {2, 1.6, 2});
  stage.place({3, 1.6, 14}, {3, 1, 0});
  EXPECT_EQ(stage.play(6.0), 0);
  stage.move(310, {6, -20, 0});
  EXPECT_EQ(stage.play(3.0), 1);
  EXPECT_GT(stage.last.targets[1].visible_share, 0.5);
}

// Targets that jump about among many blocks. Embree says whether the camera's body is free and the target is seen.
TEST(Cut, NeverLeadsIntoGeometryAndSeesTheTarget) {
  EmbreeDevice device;
  int cuts = 0;
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    CounterRandom random(seed, 0, RandomPurpose::kTest);
    Stage stage;
    std::vector<glm::dvec3> open;
    for (int i = 0; i < 60; ++i) {
      const glm::dvec3 at(random.next_in(-30, 30), 1.5, random.next_in(-30, 30));
      const glm::vec3 half(random.next_in(0.1, 3), random.next_in(1, 3), random.next_in(0.1, 3));
      if (glm::length(glm::dvec2(at.x, at.z)) < 9) continue;
      stage.add_box(500 + static_cast<uint64_t>(i), at, half);
    }
    EmbreeScene reference(device, EmbreeScene::Content::kColliders);
    CameraState before = stage.camera();
    for (int tick = 0; tick < 1500; ++tick) {
      if (tick % 150 == 149) {
        glm::dvec3 to;
        ClearanceField field;
        do {
          to = {random.next_in(-30, 30), 1, random.next_in(-30, 30)};
          field.gather(stage.mirror, to, 3.0, {});
        } while (field.clearance_m(to + glm::dvec3(0, 1.5, 0), 1.0) < 0.8 || field.is_inside(to));
        stage.move(1, to);
      }
      const StepResult result = stage.step(kTickS);
      const glm::dvec3 at_m = result.camera.pose.position_m;
      reference.take_in(stage.mirror);
      ASSERT_GE(reference.nearest_surface_m(at_m, 5.0f), stage.limits.body_radius_m - 1e-4) << "tick " << tick;
      if (!result.cut) {
        const glm::dvec3 velocity_mps = (at_m - before.pose.position_m) / kTickS;
        ASSERT_LE(glm::length(velocity_mps - before.velocity_mps),
                  stage.limits.max_acceleration_mps2 * kTickS * (1 + 1e-6) + 1e-9);
      } else {
        ++cuts;
        ClearanceField field;
        field.gather(stage.mirror, at_m, 3.0, {});
        EXPECT_FALSE(field.is_inside(at_m));
        EXPECT_FALSE(result.flags.distance_given_up || result.flags.elevation_given_up);
        EXPECT_TRUE(result.targets[0].in_picture);
        EXPECT_GE(result.targets[0].visible_share, 0.5);
        // Some part of the person's axis is seen.
        bool seen = false;
        const glm::dvec3 person_m = stage.mirror.find(1)->pose.position_m;
        for (double y = -0.8; y <= 0.8; y += 0.1) {
          const glm::dvec3 ray = person_m + glm::dvec3(0, y, 0) - at_m;
          seen |= reference.trace(at_m, glm::vec3(ray), 0.0f, 2.0f).slot == *stage.mirror.slot_of(1);
        }
        EXPECT_TRUE(seen) << "tick " << tick;
      }
      before = result.camera;
    }
  }
  EXPECT_GT(cuts, 5);
}

}  // namespace
}  // namespace sightline::test
