// What replies say of a camera's reasons, held against a plain recount of what its step knew. Two people walk among
// boxes in random worlds.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <deque>
#include <map>
#include <numbers>
#include <set>

#include "server/base/random.h"
#include "tests/support/filming.h"

namespace sightline::test {
namespace {

constexpr double kTick = 1.0 / 60;
constexpr int kWorlds = 24, kTicks = 300;
constexpr int kHeldTicks = 18;  // 0.3 s: a plan's reason says what has held for so long

struct Block {
  uint64_t id = 0;
  glm::dvec3 at_m{0.0}, half_m{0.0};
};

// True if the line from a to b passes through an upright box.
bool crosses(const Block& block, const glm::dvec3& a_m, const glm::dvec3& b_m) {
  double enters = 0, leaves = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const double step = b_m[axis] - a_m[axis], low = block.at_m[axis] - block.half_m[axis] - a_m[axis],
                 high = block.at_m[axis] + block.half_m[axis] - a_m[axis];
    if (std::abs(step) < 1e-12) {
      if (low > 0 || high < 0) return false;
      continue;
    }
    enters = std::max(enters, std::min(low / step, high / step)),
    leaves = std::min(leaves, std::max(low / step, high / step));
  }
  return enters <= leaves;
}

class RandomWalk {
 public:
  explicit RandomWalk(uint64_t seed)
      : random_(seed, 0, RandomPurpose::kTest), world_({random_.next_in(-3, 3), random_.next_in(1.5, 3), 7}) {
    world_.seed = seed;
    world_.add_target(2, {1.2, 1, 0});
    for (uint64_t i = 0; i < 14; ++i) {
      const Block block{10 + i,
                        {random_.next_in(-12, 12), 1.5, random_.next_in(-12, 12)},
                        {random_.next_in(0.2, 2.5), 1.5, random_.next_in(0.2, 2.5)}};
      if (std::abs(block.at_m.x) < 4 && std::abs(block.at_m.z - 4) < 6) continue;
      world_.add_box(block.id, block.at_m, glm::vec3(block.half_m));
      blocks_.push_back(block);
    }
    heading_rad_ = random_.next_in(-3, 3);
  }

  const StepResult& step() {
    heading_rad_ += random_.next_in(-0.08, 0.08);
    const glm::dvec3 velocity_mps = 1.6 * glm::dvec3(std::cos(heading_rad_), 0, std::sin(heading_rad_));
    at_m_ += velocity_mps * kTick;
    world_.move(1, at_m_ + glm::dvec3(0, 1, 0), velocity_mps);
    world_.move(2, at_m_ + glm::dvec3(1.2, 1, 0), velocity_mps);
    result_ = world_.step(kTick);
    remember_hiders();
    return result_;
  }

  // Recounts from the candidates of the step.
  bool some_candidate_sees_all() const {
    const auto seen = world_.dump().sights.candidates.filtered();
    return std::ranges::any_of(seen, [&](uint32_t mask) { return (mask & 0b11u) == 0b11u; });
  }
  uint32_t seen_from_chosen() const {
    return world_.dump().sights.candidates.filtered()[static_cast<size_t>(result_.chosen_candidate)] & 0b11u;
  }
  // Whether an instance hid a point of a target from the place of the shot in the last 4 s.
  bool hid_lately(uint64_t id, uint64_t target) const {
    return std::ranges::any_of(hiders_, [&](const auto& at) { return at.contains({id, target}); });
  }
  // Whether a picture from the goal has side, height and distance of the shot within the free bands of the contract: 30
  // degrees, 10 degrees, a factor of 1.19.
  bool goal_keeps_shot() const {
    constexpr double kDegree = std::numbers::pi / 180;
    const auto& plan_m = world_.dump().decision.plan_m;
    const double arrives_s = plan_m.empty() ? 0.0 : plan_m[plan_m.size() - 1].at_s;
    const glm::dvec3 goal_m = world_.dump().sights.position_m[static_cast<size_t>(result_.chosen_candidate)];
    glm::dvec3 center_m(0.0), velocity_mps(0.0);
    for (const TrackedTarget& target : world_.dump().targets.tracked_targets)
      center_m += target.aim_m / 2.0, velocity_mps += target.velocity_mps / 2.0;
    const glm::dvec3 asked_m = world_.stepper.carried().shot.asked_offset_m,
                     now_m = goal_m - center_m - velocity_mps * arrives_s;
    const auto height = [](const glm::dvec3& m) { return std::atan2(m.y, std::hypot(m.x, m.z)); };
    const double side = std::remainder(std::atan2(now_m.x, now_m.z) - std::atan2(asked_m.x, asked_m.z),
                                       2 * std::numbers::pi);
    const double size = std::log2(glm::length(now_m) / glm::length(asked_m));
    return std::abs(side) <= 30 * kDegree && std::abs(height(now_m) - height(asked_m)) <= 10 * kDegree &&
           std::abs(size) <= 0.25;
  }
  const World& world() const { return world_; }

 private:
  void remember_hiders() {
    const glm::dvec3 eye_m = place_of_shot_m();
    std::set<std::pair<uint64_t, uint64_t>> now;
    for (const uint64_t target : {1u, 2u})
      for (int i = 0; i < 40; ++i) {
        const glm::dvec3 point_m = at_m_ + glm::dvec3((target - 1) * 1.2 + random_.next_in(-0.3, 0.3),
                                                      random_.next_in(0.1, 1.9), random_.next_in(-0.3, 0.3));
        for (const Block& block : blocks_)
          if (crosses(block, eye_m, point_m)) now.emplace(block.id, target);
        // The other person, as a box.
        const uint64_t other = 3 - target;
        if (crosses({other, at_m_ + glm::dvec3((other - 1) * 1.2, 1, 0), {0.3, 0.9, 0.3}}, eye_m, point_m))
          now.emplace(other, target);
      }
    hiders_.push_back(std::move(now));
    if (hiders_.size() > 240) hiders_.pop_front();
  }

  // The place of the shot, from where all of both people fits the picture.
  glm::dvec3 place_of_shot_m() const {
    const WantedShot& shot = world_.stepper.carried().shot;
    return desired_place_m(world_.dump().targets.tracked_targets, shot.asked_offset_m, world_.lens,
                           world_.settings.framing.framing_margin, world_.settings.move);
  }

  CounterRandom random_;
  OneFilmed world_;
  std::vector<Block> blocks_;
  glm::dvec3 at_m_{0.0};
  double heading_rad_ = 0;
  StepResult result_;
  std::deque<std::set<std::pair<uint64_t, uint64_t>>> hiders_;
};

TEST(Reasons, WhatIsSaidOfSightFromTheGoalIsSo) {
  std::map<MoveReason, int> given;
  int named = 0, gives_up = 0, compared = 0, decisions = 0, planned_all = 0, planned_keeps = 0;
  for (uint64_t seed = 1; seed <= kWorlds; ++seed) {
    RandomWalk walk(seed);
    int all_ticks = 0, keeps_ticks = 0, last_decision = -1;
    for (int i = 0; i < kTicks; ++i) {
      const StepResult& result = walk.step();
      const WantedShot& shot = walk.world().stepper.carried().shot;
      const bool other = shot.other_viewpoint() || shot.in_line_m;
      const std::string where = "seed " + std::to_string(seed) + ", tick " + std::to_string(i);
      ++given[result.reason];
      if (!walk.world().dump().decided) continue;  // what was said at the last decision
      const ComparedCourses& courses = result.courses;
      ASSERT_TRUE(courses.taken) << where;
      if (*courses.taken != FlightCourse::kApproach) {
        ASSERT_EQ(*courses.taken == FlightCourse::kFollow, walk.world().dump().decision.follows) << where;
      }
      if (courses.plan_loss && courses.taken == FlightCourse::kStay) {
        ASSERT_LE(*courses.stay_loss, *courses.plan_loss) << where;
      }
      if (courses.plan_loss && courses.taken == FlightCourse::kPlan) {
        ASSERT_LT(*courses.plan_loss, *courses.stay_loss) << where;
      }
      const int ticks = i - last_decision;
      last_decision = i;
      all_ticks = walk.seen_from_chosen() == 0b11u ? all_ticks + ticks : 0;
      keeps_ticks = walk.goal_keeps_shot() ? keeps_ticks + ticks : 0;
      if (courses.taken == FlightCourse::kPlan) {
        ASSERT_EQ(all_ticks >= kHeldTicks,
                  result.reason == MoveReason::kBestAllVisible || result.reason == MoveReason::kAtDesiredPlace)
            << where;
        ASSERT_EQ(all_ticks >= kHeldTicks && keeps_ticks >= kHeldTicks, result.reason == MoveReason::kAtDesiredPlace)
            << where;
        planned_all += all_ticks >= kHeldTicks, planned_keeps += result.reason == MoveReason::kAtDesiredPlace;
      }
      compared += courses.follow_loss && courses.plan_loss, ++decisions;
      switch (result.reason) {
        case MoveReason::kAtDesiredPlace:
          ASSERT_EQ(walk.seen_from_chosen(), 0b11u) << where;
          ASSERT_TRUE(result.courses.taken == FlightCourse::kFollow ? !other : walk.goal_keeps_shot()) << where;
          break;
        case MoveReason::kOtherShot:
          ASSERT_EQ(walk.seen_from_chosen(), 0b11u) << where;
          ASSERT_TRUE(other) << where;
          break;
        case MoveReason::kBestAllVisible:
          ASSERT_EQ(walk.seen_from_chosen(), 0b11u) << where;
          break;
        case MoveReason::kBestPartial:
          ASSERT_FALSE(walk.some_candidate_sees_all()) << where;
          ASSERT_NE(walk.seen_from_chosen(), 0u) << where;
          break;
        case MoveReason::kStays:
          ASSERT_LT(glm::distance(*walk.world().stepper.carried().goal_m,
                                  walk.world().dump().sights.position_m[walk.world().dump().sights.own_candidate]),
                    1e-9)
              << where;
          break;
        default:
          break;
      }
      if (!result.shot || result.shot->hidden_by == 0) continue;
      ++named,
          gives_up += result.shot->deviation.side + result.shot->deviation.height + result.shot->deviation.size > 0;
      ASSERT_TRUE(walk.hid_lately(result.shot->hidden_by, result.shot->hidden_target))
          << where << ": " << result.shot->hidden_by;
    }
  }
  for (const MoveReason reason :
       {MoveReason::kAtDesiredPlace, MoveReason::kOtherShot, MoveReason::kBestAllVisible, MoveReason::kStays})
    EXPECT_GT(given[reason], 10) << to_string(reason);
  EXPECT_GT(compared, decisions / 2);
  EXPECT_GT(planned_keeps, 50);
  EXPECT_GT(planned_all - planned_keeps, 50);
  EXPECT_GT(named, 500);
  EXPECT_GT(gives_up, 200);
}

}  // namespace
}  // namespace sightline::test
