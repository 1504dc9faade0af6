// How calm a camera is, on paths whose figures are known.
#include "client/truth/motion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "client/truth/metrics.h"

namespace sightline {
namespace {

constexpr double kTick = 1.0 / 60;

// The camera's path over `ticks` ticks, by its position at each time.
std::vector<CameraFrame> path_of(int ticks, const std::function<glm::dvec3(double)>& position_at) {
  std::vector<CameraFrame> frames;
  for (int k = 0; k <= ticks; ++k) {
    CameraFrame& frame = frames.emplace_back();
    frame.time_s = k * kTick;
    frame.camera.position_m = position_at(frame.time_s);
  }
  return frames;
}

RunMetrics metrics_of(const std::vector<CameraFrame>& frames) {
  return summarize(std::vector<TargetMetrics>{}, frames, {}, CameraLimits{});
}

// ---- turning back ----

TEST(Reversals, AStraightPathAndAWideCurveHaveNone) {
  EXPECT_EQ(direction_reversals(path_of(600, [](double t) { return glm::dvec3(3 * t, 0, 0); })), 0u);
  // A circle at 4 m/s and 5 m radius turns by 46 degrees a second.
  EXPECT_EQ(direction_reversals(
                path_of(600, [](double t) { return 5.0 * glm::dvec3(std::cos(0.8 * t), 0, std::sin(0.8 * t)); })),
            0u);
}

TEST(Reversals, ASwingTurnsBackTwiceAPeriod) {
  // 10 s of a swing with a period of 1 s: the velocity changes its sign at 0.25 s, 0.75 s, ...
  const auto swing = path_of(600, [](double t) { return glm::dvec3(0.5 * std::sin(2 * std::numbers::pi * t), 0, 0); });
  EXPECT_EQ(direction_reversals(swing), 20u);
  EXPECT_NEAR(metrics_of(swing).reversals_per_s, 2.0, 1e-9);
}

TEST(Reversals, AZigzagOfRightAnglesHasNoneAndASharperOneHasOneACorner) {
  // The direction changes every 20 ticks by `turn_rad`, to one side and to the other in turns.
  const auto zigzag = [](double turn_rad) {
    glm::dvec3 at(0.0);
    std::vector<CameraFrame> frames = path_of(0, [](double) { return glm::dvec3(0.0); });
    for (int k = 1; k <= 200; ++k) {
      const double heading = ((k - 1) / 20) % 2 == 0 ? 0.0 : turn_rad;
      at += 0.05 * glm::dvec3(std::cos(heading), 0, std::sin(heading));
      frames.push_back({k * kTick, {at, glm::dquat(1, 0, 0, 0)}, Lens{}, false});
    }
    return frames;
  };
  EXPECT_EQ(direction_reversals(zigzag(89 * std::numbers::pi / 180)), 0u);
  EXPECT_EQ(direction_reversals(zigzag(91 * std::numbers::pi / 180)), 9u) << "ten legs have nine corners";
}

TEST(Reversals, ATightCurveTurnsBackAtEveryQuarter) {
  // At 5 rad/s, the velocity turns by more than 90 degrees in 19 ticks; frame 1 has the first velocity.
  const auto circle = path_of(600, [](double t) { return 0.3 * glm::dvec3(std::cos(5 * t), 0, std::sin(5 * t)); });
  EXPECT_EQ(direction_reversals(circle), 599u / 19);
}

TEST(Reversals, AStopOnTheWayBackCountsOnlyWhenItIsShort) {
  // There at 1 m/s for a second, a stop, and back.
  const auto there_and_back = [](double stop_s) {
    return path_of(240,
                   [stop_s](double t) { return glm::dvec3(std::min(t, 1.0) - std::max(0.0, t - 1.0 - stop_s), 0, 0); });
  };
  EXPECT_EQ(direction_reversals(there_and_back(0.4)), 1u);
  EXPECT_EQ(direction_reversals(there_and_back(0.6)), 0u);
}

TEST(Reversals, SlowTremblingAndDeclaredJumpsAreNone) {
  // 0.19 m/s to and fro, by 3 mm.
  auto trembling = path_of(
      600, [](double t) { return glm::dvec3(std::lround(t / kTick) % 2 == 0 ? 0.0 : 0.19 * kTick, 0, 0); });
  EXPECT_EQ(direction_reversals(trembling), 0u);
  auto leap = path_of(120, [](double t) { return glm::dvec3(t < 1 ? t : t < 1 + kTick / 2 ? -5 : -4 - t, 0, 0); });
  EXPECT_GT(direction_reversals(leap), 0u);
  for (CameraFrame& frame : leap) frame.jump = std::abs(frame.time_s - 1.0) < kTick / 2;
  EXPECT_EQ(direction_reversals(leap), 0u);
}

// ---- limits and jerk ----

TEST(AtLimits, SharesAreOfTheFramesThatUseTheWholeLimit) {
  const CameraLimits limits;  // 10 m/s and 10 m/s^2
  // From rest at the full acceleration for 1 s, then at the full speed for 3 s.
  std::vector<CameraFrame> frames;
  double speed_mps = 0, x_m = 0;
  for (int k = 0; k <= 240; ++k) {
    if (k > 0) x_m += speed_mps * kTick;
    frames.push_back({k * kTick, {{x_m, 0, 0}, glm::dquat(1, 0, 0, 0)}, Lens{}, false});
    speed_mps = std::min(limits.max_speed_mps, speed_mps + limits.max_acceleration_mps2 * kTick);
  }
  const RunMetrics metrics = metrics_of(frames);
  // Frames 1 to 60 accelerate; frames 60 to 240 have the full speed.
  EXPECT_NEAR(metrics.acceleration_limit_share, 60.0 / 240, 1e-9);
  EXPECT_NEAR(metrics.speed_limit_share, 181.0 / 240, 1e-9);
  EXPECT_EQ(metrics.limit_violations, 0u);
}

TEST(AtLimits, NinetyEightPercentIsBelow) {
  const auto almost = path_of(60, [](double t) { return glm::dvec3(9.8 * t, 0, 0); });
  EXPECT_EQ(metrics_of(almost).speed_limit_share, 0.0);
  const auto nearly = path_of(60, [](double t) { return glm::dvec3(9.91 * t, 0, 0); });
  EXPECT_EQ(metrics_of(nearly).speed_limit_share, 1.0);
}

TEST(Jerk, TheNinetyNinthPercentilePassesOverTheRarestFrames) {
  // The speed steps by 0.01 m/s at one frame of 200: jerk there and at the next frame is 0.01 / tick^2.
  const auto stepping = [](int every) {
    std::vector<CameraFrame> frames;
    double speed_mps = 0, x_m = 0;
    for (int k = 0; k <= 400; ++k) {
      if (k > 0 && k % every == 0) speed_mps += 0.01;
      if (k > 0) x_m += speed_mps * kTick;
      frames.push_back({k * kTick, {{x_m, 0, 0}, glm::dquat(1, 0, 0, 0)}, Lens{}, false});
    }
    return frames;
  };
  EXPECT_NEAR(metrics_of(stepping(300)).p99_jerk_mps3, 0.0, 1e-6) << "two of 400 frames";
  EXPECT_NEAR(metrics_of(stepping(100)).p99_jerk_mps3, 36.0, 1e-6) << "seven of 400 frames";
}

// ---- the goal ----

std::vector<GoalSample> goals(int ticks, const std::function<glm::dvec3(int)>& goal_at, double targets_mps) {
  std::vector<GoalSample> samples;
  for (int k = 0; k <= ticks; ++k)
    samples.push_back({k * kTick, goal_at(k), glm::dvec3(targets_mps * k * kTick, 0, 0), false});
  return samples;
}

TEST(GoalJumps, AreCountedRelativeToTheTargets) {
  // 40 m/s is 0.67 m a tick.
  const auto runs_along = [](int k) { return glm::dvec3(40.0 * k * kTick, 2, 0); };
  const auto stands = [](int) { return glm::dvec3(0, 2, 0); };
  EXPECT_EQ(goals_of(goals(60, runs_along, 40.0)).jumps, 0u);
  EXPECT_EQ(goals_of(goals(60, runs_along, 0.0)).jumps, 60u);
  EXPECT_EQ(goals_of(goals(60, stands, 40.0)).jumps, 60u);
}

TEST(GoalJumps, ASecondHasAsManyAsTheGoalChangesBeyondHalfAMetre) {
  const auto every = [](int n, double step_m) {
    return [n, step_m](int k) { return glm::dvec3(0, (k / n) % 2 * step_m, 0); };
  };
  EXPECT_NEAR(goals_of(goals(600, every(6, 0.51), 1.5)).jumps_per_s, 10.0, 1e-9);
  EXPECT_EQ(goals_of(goals(600, every(6, 0.49), 1.5)).jumps, 0u);
}

// The goal goes 0.9 m to and fro, five changes a second, in one tick or in as many as last 1/30 s.
TEST(GoalJumps, AreTheSameAtEveryRateOfTheTicks) {
  for (const int rate : {15, 30, 60, 90, 120}) {
    for (const int ticks : {1, std::max(1, rate / 30)}) {
      std::vector<GoalSample> samples;
      double y_m = 0;
      for (int k = 0; k <= 10 * rate; ++k) {
        const double part = std::min(1.0, (k % (rate / 5) + 1.0) / ticks);
        y_m = k / (rate / 5) % 2 == 0 ? 0.9 * part : 0.9 * (1 - part);
        samples.push_back({k / double(rate), glm::dvec3(0, y_m, 0), glm::dvec3(0.0), false});
      }
      EXPECT_NEAR(goals_of(samples).jumps_per_s, 5.0, 0.11) << rate << " ticks a second, " << ticks << " a change";
    }
  }
}

TEST(GoalJumps, AGoalThatFlickersAtEveryTickIsSeen) {
  const auto flickers = [](int k) { return glm::dvec3(0, k % 2 * 0.6, 0); };
  EXPECT_EQ(goals_of(goals(60, flickers, 0.0)).jumps, 60u);
}

TEST(GoalJumps, TimeWithoutAGoalAndDeclaredCutsAreLeftOut) {
  auto samples = goals(
      120, [](int k) { return glm::dvec3(k < 60 ? 0 : 9, 0, 0); }, 0.0);
  EXPECT_EQ(goals_of(samples).jumps, 1u);
  EXPECT_NEAR(goals_of(samples).watched_s, 2.0, 1e-9);
  samples[60].jump = true;
  EXPECT_EQ(goals_of(samples).jumps, 0u);
  for (int k = 40; k < 70; ++k) samples[k].goal_m.reset();
  EXPECT_EQ(goals_of(samples).jumps, 0u);
  EXPECT_NEAR(goals_of(samples).watched_s, (39 + 50) * kTick, 1e-9);
  EXPECT_EQ(goals_of({}).jumps_per_s, 0.0);
}

TEST(GoalJumps, EqualAPlainCountOnRandomGoals) {
  std::mt19937_64 random(8);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<GoalSample> samples;
  std::vector<double> x_m, center_m;
  for (int k = 0; k < 500; ++k) {
    x_m.push_back(2 * unit(random)), center_m.push_back(unit(random));
    samples.push_back({k * 0.1, glm::dvec3(x_m[k], 0, 0), glm::dvec3(center_m[k], 0, 0), false});
  }
  size_t plain = 0;
  for (int k = 1; k < 500; ++k) plain += std::abs((x_m[k] - center_m[k]) - (x_m[k - 1] - center_m[k - 1])) > 0.5;
  EXPECT_EQ(goals_of(samples).jumps, plain);
  EXPECT_GT(plain, 50u);
}

}  // namespace
}  // namespace sightline
