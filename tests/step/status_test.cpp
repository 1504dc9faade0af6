// The status of a step and its flags: they say what is so, by plain recomputation from the scene and from what happens
// next.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "server/base/random.h"
#include "server/step/report.h"
#include "tests/support/filming.h"

namespace sightline::test {
namespace {

constexpr double kTick = 1.0 / 60;
// The default of Tuning.aggregate.visibility_threshold.
constexpr double kSeenShare = 0.75;

struct Box {
  glm::dvec3 at, half;
};

bool crosses(const glm::dvec3& from, const glm::dvec3& to, const Box& box) {
  double first = 0, last = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const double way = to[axis] - from[axis];
    double a = (box.at[axis] - box.half[axis] - from[axis]) / way,
           b = (box.at[axis] + box.half[axis] - from[axis]) / way;
    if (a > b) std::swap(a, b);
    first = std::max(first, a), last = std::min(last, b);
  }
  return first < last;
}

// The share of a dense set of points on a standing person (a capsule 1.8 m high) that can be seen from a position.
double true_share(const glm::dvec3& person, const glm::dvec3& eye, const std::vector<Box>& boxes) {
  int seen = 0, all = 0;
  for (int up = -8; up <= 8; ++up)
    for (int side = -2; side <= 2; ++side, ++all) {
      const glm::dvec3 out = glm::normalize(glm::cross(eye - person, glm::dvec3(0, 1, 0)));
      const glm::dvec3 point = person + glm::dvec3(0, 0.1 * up, 0) + out * (0.12 * side);
      seen += std::none_of(boxes.begin(), boxes.end(), [&](const Box& box) { return crosses(point, eye, box); });
    }
  return static_cast<double>(seen) / all;
}

bool is_seen(const TargetSight& sight) {
  return sight.in_picture && sight.filtered_share >= kSeenShare;
}

// Two people walk among pillars; the third, optional one stays behind.
struct Walk : Filming {
  explicit Walk(uint64_t field) {
    CounterRandom random(field, 0, RandomPurpose::kTest);
    for (uint64_t k = 0; k < 40; ++k) {
      const glm::dvec3 middle(random.next_in(-10, 10), 1.5, random.next_in(-10, 10));
      const glm::vec3 half(random.next_in(0.2, 0.9), 1.5, random.next_in(0.2, 0.9));
      if (std::abs(middle.z) < 1.8 || glm::distance(middle, glm::dvec3(0, 1.5, 5)) < 2) continue;
      add_box(10 + k, middle, half);
      boxes.push_back({middle, glm::dvec3(half)});
    }
    add_target(1, {-1, 0.9, 0}), add_target(2, {1, 0.9, 0}), add_target(3, {0, 0.9, -1.2}, false);
    place({0, 1.6, 5}, {0, 1, 0});
    limits.max_speed_mps = 1.8;  // slower than they walk at times
  }
  void walk(double time) {
    at[0] = {-1 + 6 * std::sin(0.4 * time), 0.9, 0.6 * std::sin(time)};
    at[1] = {1 + 6 * std::sin(0.4 * time), 0.9, 0};
    move(1, at[0], {2.4 * std::cos(0.4 * time), 0, 0.6 * std::cos(time)});
    move(2, at[1], {2.4 * std::cos(0.4 * time), 0, 0});
  }
  std::vector<Box> boxes;
  glm::dvec3 at[2];
};

TEST(Status, SaysWhatTheSharesOfTheReplySay) {
  Walk world(5);
  world.settings.move.keep_shot = 0;
  int steps_with[7] = {};
  for (int i = 0; i < 700; ++i) {
    world.walk(i * kTick);
    const StepResult r = world.step(kTick);
    ++steps_with[static_cast<size_t>(r.status)];
    const bool all_required = is_seen(r.targets[0]) && is_seen(r.targets[1]);
    const bool any_part = std::any_of(r.targets.begin(), r.targets.end(), [](const TargetSight& sight) {
      return sight.picture_share > 0 && sight.filtered_share > 0;
    });
    EXPECT_EQ(r.status == TrackingStatus::kTracking, all_required) << i;
    EXPECT_EQ(r.status == TrackingStatus::kPartialView, !all_required && any_part) << i;
    EXPECT_EQ(r.view_s.has_value(), r.status == TrackingStatus::kSeeking) << i;
    if (r.status == TrackingStatus::kTracking) {
      // The filtered share lags by a few hundredths of a second, so a target that was hidden just now may still count
      // as seen.
      const double share = std::max(true_share(world.at[0], r.camera.pose.position_m, world.boxes),
                                    true_share(world.at[1], r.camera.pose.position_m, world.boxes));
      EXPECT_GT(share, 0.0) << i << ": tracking, but nobody is in sight";
    }
  }
  EXPECT_GT(steps_with[static_cast<size_t>(TrackingStatus::kTracking)], 300);
  EXPECT_GT(steps_with[static_cast<size_t>(TrackingStatus::kPartialView)], 0);
}

TEST(Status, WithoutARequiredTargetAllCount) {
  Filming world;
  world.add_target(1, {0, 1, 0}, false);
  world.add_target(2, {1, 1, 0}, false);
  world.add_box(10, {0.5, 1, 3}, {0.2, 3, 0.05});
  world.limits.max_acceleration_mps2 = 1e-6;
  world.place({0, 1, 6}, {0.5, 1, 0});
  for (int i = 0; i < 20; ++i) world.step(kTick);
  const StepResult r = world.step(kTick);
  EXPECT_EQ(r.targets[0].filtered_share, 1.0);
  EXPECT_LT(r.targets[1].filtered_share, 0.5);
  EXPECT_EQ(r.status, TrackingStatus::kPartialView);
  world.targets[0].required = true;
  EXPECT_EQ(world.step(kTick).status, TrackingStatus::kTracking) << "the hidden one is optional now";
}

// A closed box round the target, so narrow that no candidate is in it: there is nothing to see from anywhere.
TEST(Status, IsLostWhileNoPositionIsKnown) {
  OneFilmed world;
  world.settings.bound.max_horizon_s = world.settings.bound.horizon_s;
  world.add_box(10, {0, 1, 0}, {0.7, 1.1, 0.7});
  for (int i = 0; i < 60; ++i) EXPECT_EQ(world.step(kTick).status, TrackingStatus::kLost) << i;
  world.mirror.apply({.base_revision = {}, .remove = {10}, .add = {}, .change = {}}, {});
  for (int i = 0; i < 10; ++i) world.step(kTick);
  EXPECT_EQ(world.step(kTick).status, TrackingStatus::kTracking);
}

// The expected time is the least that the limits allow, so the camera comes into view no sooner, and not much later.
TEST(Status, IsSeekingOnTheWayRoundAPillarAndSaysHowLong) {
  OneFilmed world({0, 1.4, 4.6});
  world.add_box(10, {0, 1.5, 2.6}, {1.1, 6, 0.8});
  std::vector<std::pair<int, double>> expected;  // step, seconds
  int i = 0;
  for (; i < 300; ++i) {
    const StepResult r = world.step(kTick);
    if (r.targets[0].picture_share > 0 && r.targets[0].filtered_share > 0) break;
    if (r.status == TrackingStatus::kSeeking) expected.emplace_back(i, *r.view_s);
  }
  ASSERT_LT(i, 300);
  EXPECT_GT(expected.size(), 0.7 * i) << "it was seeking for most of the time";
  for (const auto& [step, seconds] : expected) {
    const double until_seen = (i - step) * kTick;
    EXPECT_LT(seconds, until_seen + 0.35) << "step " << step << " of " << i;
    EXPECT_GT(seconds, 0.25 * until_seen - 0.1) << "step " << step << " of " << i;
  }
}

TEST(Status, IsSeekingWhileItTurnsToATargetBehindIt) {
  OneFilmed world;
  world.place({0, 1.6, 6}, {0, 1.6, 12});
  std::vector<double> expected;
  StepResult r = world.step(kTick);
  for (; r.targets[0].picture_share == 0 && expected.size() < 300; r = world.step(kTick)) {
    EXPECT_EQ(r.status, TrackingStatus::kSeeking);
    expected.push_back(r.view_s.value_or(-1));
  }
  ASSERT_GT(expected.size(), 20u);
  for (size_t i = 0; i < expected.size(); ++i) {
    const double until_seen = static_cast<double>(expected.size() - i) * kTick;
    EXPECT_NEAR(expected[i], until_seen, 0.25) << i;
  }
}

// The camera sits in a room of glass. Beside the wall that hides the target, there is a view of it, outside the glass.
TEST(Status, IsBlockedByTheInstanceInTheWay) {
  OneFilmed world({0, 1, 6});
  const InstanceAttributes glass{.opacity = 0.1f};
  world.add_box(10, {0, 1, 3}, {1.5, 1.2, 0.05});
  world.add_box(20, {-0.8, 1, 6}, {0.02, 0.8, 0.8}, glass), world.add_box(21, {0.8, 1, 6}, {0.02, 0.8, 0.8}, glass);
  world.add_box(22, {0, 1, 5.2}, {0.8, 0.8, 0.02}, glass), world.add_box(23, {0, 1, 6.8}, {0.8, 0.8, 0.02}, glass);
  world.add_box(24, {0, 0.2, 6}, {0.8, 0.02, 0.8}, glass), world.add_box(25, {0, 1.8, 6}, {0.8, 0.02, 0.8}, glass);
  int blocked = 0;
  for (int i = 0; i < 120; ++i) {
    const StepResult r = world.step(kTick);
    if (r.status != TrackingStatus::kBlocked) {
      EXPECT_EQ(r.blocked_by, 0u);
      continue;
    }
    ++blocked;
    EXPECT_GE(r.blocked_by, 20u) << i;
    EXPECT_LE(r.blocked_by, 25u) << i;
  }
  EXPECT_GT(blocked, 60);
}

// Some candidates are inside the closed box with the target. The bound reaches them only when it has grown.
TEST(Status, IsBlockedByTheBoxThatTheTargetIsIn) {
  OneFilmed world;
  world.add_box(10, {0, 1, 0}, {2.5, 2.5, 2.5});
  for (int i = 0; i < 30; ++i) world.step(kTick);
  for (int i = 0; i < 210; ++i) {
    const StepResult r = world.step(kTick);
    ASSERT_EQ(r.status, TrackingStatus::kBlocked) << i;
    ASSERT_EQ(r.blocked_by, 10u) << i;
  }
}

// As the stage reports it when a collider stops a camera that knows where to go.
TEST(Status, IsBlockedWhenTheWayIsKnownButTheBodyIsStopped) {
  OneFilmed world({0, 1, 6});
  world.add_box(10, {0, 1, 3}, {1.5, 6, 0.05});
  world.add_box(11, {1.0, 1, 6}, {0.1, 3, 3});
  StepResult r = world.step(kTick);
  ASSERT_EQ(r.targets[0].visible_share, 0.0);
  StepDump dump = world.dump();
  const StepInput input{world.mirror, world.targets, world.limits, world.settings, world.lens, 1, 1, kTick, {}};
  const TakenMaps taken{dump.plan, dump.maps, world.settings.aggregate};
  const auto status_of = [&](const glm::dvec3& velocity_mps, bool deflected) {
    dump.decision.view_way_m = 4.0;
    dump.decision.wanted_mps = {2, 0, 0};
    dump.decision.camera.velocity_mps = velocity_mps;
    dump.decision.deflected = deflected;
    r.blocked_by = 0;
    set_tracking_status({input, dump, taken, world.stepper.carried().pasts, {}}, world.lens, r);
    return r.status;
  };
  EXPECT_EQ(status_of({2, 0, 0}, false), TrackingStatus::kSeeking);
  EXPECT_EQ(status_of({0, 0, 1.5}, true), TrackingStatus::kBlocked) << "it slides along, and comes no nearer";
  EXPECT_EQ(r.blocked_by, 11u);
  EXPECT_EQ(status_of({1, 0, 1}, true), TrackingStatus::kSeeking) << "it comes nearer";
}

// A cart passes before a camera that always keeps its shot.
TEST(Status, IsWaitingWhileSomethingPassesByAndTheCameraStays) {
  OneFilmed world({0, 1, 6});
  world.settings.move.cost.occlusion = 0;
  world.settings.move.search_viewpoints = false;
  world.add_box(10, {-6, 1, 4}, {0.35, 2.5, 0.3}, {.collides = false});
  int hidden = 0, waiting = 0, lost = 0;
  for (int i = 0; i < 240; ++i) {
    world.move(10, {-6 + 3 * i * kTick, 1, 4}, {3, 0, 0});
    const StepResult r = world.step(kTick);
    if (r.targets[0].filtered_share > 0) continue;
    ++hidden;
    waiting += r.status == TrackingStatus::kWaiting, lost += r.status == TrackingStatus::kLost;
  }
  EXPECT_GT(hidden, 0);
  EXPECT_EQ(waiting, hidden);
  EXPECT_EQ(lost, 0) << "the view is expected to return";
}

TEST(Status, APausedCameraThatSeesNobodyWaits) {
  OneFilmed world;
  world.add_box(10, {0, 1, 0}, {1, 1.5, 1});
  for (int i = 0; i < 10; ++i) world.step(kTick);
  EXPECT_EQ(world.step(0.0).status, TrackingStatus::kWaiting);
}

// ---- flags ----

TEST(Flags, DeflectedWhereTheVelocityIsNotTheWantedOne) {
  Walk world(2);
  int deflected = 0;
  for (int i = 0; i < 600; ++i) {
    world.walk(i * kTick);
    const StepResult r = world.step(kTick);
    const bool as_wanted = glm::distance(r.camera.velocity_mps, world.dump().decision.wanted_mps) < 1e-6;
    EXPECT_EQ(r.flags.deflected || r.flags.evading, !as_wanted) << i;
    deflected += r.flags.deflected;
  }
  OneFilmed free;
  for (int i = 0; i < 120; ++i) {
    free.move(1, {0.03 * i, 1, 0}, {1.8, 0, 0});
    const StepResult r = free.step(kTick);
    EXPECT_FALSE(r.flags.deflected || r.flags.evading) << "nothing is there";
  }
}

// The camera is placed in flight towards a wall that only collides, and too fast to turn away without touching it.
TEST(Flags, DeflectedAtAWall) {
  OneFilmed world;
  world.add_box(10, {4, 1, 6}, {0.2, 4, 6}, {.occludes = false});
  world.stepper.place_camera(world.camera().pose, {8.2, 0, 0});
  int deflected = 0;
  for (int i = 0; i < 60; ++i) deflected += world.step(kTick).flags.deflected;
  EXPECT_GT(deflected, 0);
}

TEST(Flags, EvadingWhileABoxComesAtTheCamera) {
  OneFilmed world;
  world.add_box(9, {4, 1.6, 6}, {0.3, 0.9, 0.3});
  int evading = 0;
  for (int i = 0; i < 120; ++i) {
    const double x = 4 - 3.0 * i * kTick;
    world.move(9, {x, 1.6, 6}, {-3, 0, 0});
    const StepResult r = world.step(kTick);
    evading += r.flags.evading;
    EXPECT_TRUE(!r.flags.evading || std::abs(x - r.camera.pose.position_m.x) < 3.0) << "it is near";
  }
  EXPECT_GT(evading, 0);
}

TEST(Flags, NewShotWhereTheSearchChangedItsMind) {
  OneFilmed world({0, 1.6, 5});
  const InstanceAttributes screen{.collides = false};
  world.add_box(10, {0, 1, 0.65}, {0.65, 1.5, 0.05}, screen);
  world.add_box(11, {0.65, 1, 0}, {0.05, 1.5, 0.65}, screen);
  world.add_box(12, {-0.65, 1, 0}, {0.05, 1.5, 0.65}, screen);
  world.add_box(13, {0, 2.5, 0}, {0.65, 0.05, 0.65}, screen);
  int changes = 0;
  glm::dvec3 shot_m = world.camera().pose.position_m - glm::dvec3(0, 1, 0);
  for (int i = 0; i < 600; ++i) {
    const StepResult r = world.step(kTick);
    const glm::dvec3 now_m = world.stepper.carried().shot.offset_m;
    const bool changed = glm::distance(now_m, shot_m) > 0.05 * glm::length(shot_m);
    EXPECT_EQ(r.flags.new_shot, changed) << i;
    changes += changed;
    shot_m = now_m;
  }
  EXPECT_GT(changes, 0);
}

}  // namespace
}  // namespace sightline::test
