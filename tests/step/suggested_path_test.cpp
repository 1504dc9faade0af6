#include "server/step/suggested_path.h"

#include <gtest/gtest.h>

namespace sightline {
namespace {

constexpr double kTickS = 1.0 / 32;
using Positions = RecentTrack<glm::dvec3>;
using Rotations = RecentTrack<glm::dquat>;

// A way with a corner: 4 m along x, then 4 m along y.
Positions corner() {
  Positions track;
  track.start({0, 0, 0});
  track.pass({4, 0, 0}, kTickS);
  track.pass({4, 4, 0}, kTickS);
  return track;
}

void expect_away(const glm::dvec3& position_m, const glm::dvec3& away_m) {
  EXPECT_LT(glm::distance(away_from(corner(), position_m), away_m), 1e-12)
      << position_m.x << " " << position_m.y << " " << position_m.z;
}

TEST(SuggestedPath, TheNearestPointMayLieOnEveryPartOfTheTrack) {
  expect_away({1, -2, 0}, {0, -2, 0});     // beside the first part
  expect_away({5, 1, 0}, {1, 0, 0});       // beside the second one
  expect_away({-3, 0, 1}, {-3, 0, 1});     // before the start
  expect_away({4, 6, 0}, {0, 2, 0});       // beyond the end
  expect_away({5, -1, 0}, {1, -1, 0});     // at the corner
  expect_away({3.5, 1, 0}, {-0.5, 0, 0});  // nearer to the second than to the first
}

TEST(SuggestedPath, OneValueIsATrackToo) {
  Positions track;
  track.start({1, 2, 3});
  EXPECT_EQ(away_from(track, {1, 2, 5}), glm::dvec3(0, 0, 2));
}

TEST(SuggestedPath, BeginsAgainWithAStart) {
  Positions track = corner();
  track.start({9, 0, 0});
  EXPECT_EQ(track.count(), 1u);
  EXPECT_EQ(away_from(track, {0, 0, 0}), glm::dvec3(-9, 0, 0));
}

TEST(SuggestedPath, KeepsHalfASecondAndOneOlderValue) {
  Positions track;
  track.start({0, 0, 0});
  for (int i = 1; i <= 100; ++i) track.pass({static_cast<double>(i), 0, 0}, kTickS);
  EXPECT_EQ(track[track.count() - 1].x, 100);
  EXPECT_EQ(track[0].x, 100 - Positions::kKeptS / kTickS);
}

TEST(SuggestedPath, ValuesCloseInTimeReplaceEachOtherAndTheNewestStays) {
  Positions track;
  track.start({0, 0, 0});
  for (int i = 1; i <= 1000; ++i) {
    track.pass({static_cast<double>(i), 0, 0}, 1.0 / 1024);
    EXPECT_EQ(track[track.count() - 1].x, i);
    EXPECT_LE(track.count(), 40u);
  }
  EXPECT_LE(track[0].x, 1000 - 512) << "the track covers the whole half second";
  EXPECT_GE(track[0].x, 1000 - 512 - 64);
}

TEST(SuggestedPath, AValueWithoutALapseOfTimeIsLeftOut) {
  Positions track = corner();
  track.pass({100, 0, 0}, 0.0);
  EXPECT_EQ(track.count(), 3u);
  EXPECT_EQ(track[2], glm::dvec3(4, 4, 0));
}

glm::dquat about_y(double angle_rad) {
  return glm::angleAxis(angle_rad, glm::dvec3(0, 1, 0));
}
glm::dquat about_x(double angle_rad) {
  return glm::angleAxis(angle_rad, glm::dvec3(1, 0, 0));
}

TEST(SuggestedPath, TheNearestRotationMayLieBetweenAnyTwo) {
  Rotations track;
  track.start(about_y(0.0));
  track.pass(about_y(0.6), kTickS);
  track.pass(about_y(1.2), kTickS);
  for (const double angle_rad : {0.0, 0.25, 0.6, 0.95, 1.2})
    EXPECT_NEAR(angle_from(track, about_y(angle_rad)), 0.0, 1e-7) << angle_rad;
  EXPECT_NEAR(angle_from(track, about_y(1.5)), 0.3, 1e-7);
  EXPECT_NEAR(angle_from(track, about_y(-0.2)), 0.2, 1e-7);
  EXPECT_NEAR(angle_from(track, about_y(0.3) * about_x(0.1)), 0.1, 2e-3);
  EXPECT_NEAR(angle_from(track, about_y(0.9) * about_x(-0.1)), 0.1, 2e-3);
}

TEST(SuggestedPath, TheSignOfAQuaternionDoesNotMatter) {
  Rotations track;
  track.start(about_y(0.0));
  track.pass(-about_y(1.0), kTickS);
  EXPECT_NEAR(angle_from(track, about_y(0.5)), 0.0, 1e-7);
  EXPECT_NEAR(angle_from(track, -about_y(0.5)), 0.0, 1e-7);
}

}  // namespace
}  // namespace sightline
