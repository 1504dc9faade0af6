// How soon a camera answers when its targets turn, on paths whose answers are known.
#include "client/truth/turns.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

namespace sightline {
namespace {

constexpr double kTick = 1.0 / 60;

using Course = std::function<glm::dvec3(double)>;  // position by time

// At 1.5 m/s along x until 3 s, then `turn_deg` to the left.
Course corner(double turn_deg) {
  return [turn_deg](double t) {
    const double turn_rad = turn_deg * std::numbers::pi / 180;
    return 1.5 * std::min(t, 3.0) * glm::dvec3(1, 0, 0) +
           1.5 * std::max(0.0, t - 3.0) * glm::dvec3(std::cos(turn_rad), 0, -std::sin(turn_rad));
  };
}

Course late(const Course& course, double by_s) {
  return [course, by_s](double t) { return course(t - by_s) + glm::dvec3(0, 3, 6); };
}

struct Walk {
  std::vector<CameraFrame> frames;
  std::vector<glm::dvec3> centers_m;
};

Walk walk(const Course& targets, const Course& camera, double length_s = 8.0) {
  Walk walk;
  for (int k = 0; k * kTick <= length_s + 1e-9; ++k) {
    CameraFrame& frame = walk.frames.emplace_back();
    frame.time_s = k * kTick;
    frame.camera.position_m = camera(frame.time_s);
    walk.centers_m.push_back(targets(frame.time_s));
  }
  return walk;
}

TurnMetrics measure(const Walk& walk) {
  return answers_to_turns(walk.frames, walk.centers_m);
}

TEST(Turns, ACameraThatFollowsLateAnswersAsMuchLater) {
  for (const double late_s : {0.0, 0.1, 0.5, 1.5}) {
    const TurnMetrics metrics = measure(walk(corner(90), late(corner(90), late_s)));
    EXPECT_EQ(metrics.turns, 1u);
    EXPECT_NEAR(metrics.mean_answer_s, late_s, kTick) << late_s;
    EXPECT_EQ(metrics.unanswered, 0u);
  }
}

TEST(Turns, ACameraThatGoesStraightOnDoesNotAnswer) {
  const TurnMetrics metrics = measure(walk(corner(90), late(corner(0), 0.0)));
  EXPECT_EQ(metrics.turns, 1u);
  EXPECT_EQ(metrics.unanswered, 1u);
  EXPECT_NEAR(metrics.mean_answer_s, kLongestAnswerS, 1e-9);
}

TEST(Turns, TremblingAloneIsNoAnswer) {
  // To and fro by 2 cm from tick to tick, at 1.2 m/s.
  const Course straight = late(corner(0), 0.0);
  const Course trembling = [straight](double t) {
    return straight(t) + glm::dvec3(0, 0, std::lround(t / kTick) % 2 == 0 ? 0.0 : 0.02);
  };
  EXPECT_EQ(measure(walk(corner(90), trembling)).unanswered, 1u);
}

TEST(Turns, AreSharperThanSixtyDegreesAndOfMovingTargets) {
  EXPECT_EQ(measure(walk(corner(55), late(corner(55), 0))).turns, 0u);
  EXPECT_EQ(measure(walk(corner(65), late(corner(65), 0))).turns, 1u);
  EXPECT_EQ(measure(walk(corner(180), late(corner(180), 0))).turns, 1u) << "on the heel";
  const Course creeping = [](double t) { return corner(90)(t) * 0.3; };
  EXPECT_EQ(measure(walk(creeping, creeping)).turns, 0u) << "0.45 m/s";
}

TEST(Turns, EveryCornerOfASquareCounts) {
  // Sides of 3 m at 1.5 m/s; the camera is 0.2 s late. Corners at 2, 4, ... 14 s.
  const Course square = [](double t) {
    const double side = std::fmod(std::max(0.0, t) / 2, 4), along = 3 * (side - std::floor(side));
    const glm::dvec3 corners[] = {{0, 0, 0}, {3, 0, 0}, {3, 0, 3}, {0, 0, 3}, {0, 0, 0}};
    const auto k = static_cast<size_t>(side);
    return corners[k] + along / 3 * (corners[k + 1] - corners[k]);
  };
  const TurnMetrics metrics = measure(walk(square, late(square, 0.2), 15.0));
  EXPECT_EQ(metrics.turns, 7u);
  EXPECT_NEAR(metrics.mean_answer_s, 0.2, kTick);
}

TEST(Turns, OnesThatTheEndOrAJumpCutsShortAreLeftOut) {
  EXPECT_EQ(measure(walk(corner(90), late(corner(0), 0.0), 4.5)).turns, 0u);
  EXPECT_EQ(measure(walk(corner(90), late(corner(90), 0.5), 4.5)).turns, 1u) << "answered before the end";
  Walk cut = walk(corner(90), late(corner(90), 0.5));
  cut.frames[190].jump = true;
  EXPECT_EQ(measure(cut).turns, 0u);
  EXPECT_EQ(measure({}).turns, 0u);
}

}  // namespace
}  // namespace sightline
