// How well a camera keeps its shot, on paths whose deviations are known.
#include "client/truth/coherence.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace sightline {
namespace {

constexpr double kTick = 1.0 / 60;

double rad(double degrees) {
  return degrees * std::numbers::pi / 180;
}

// A camera that looks at the centre from a side, a height and a distance.
CameraFrame looks(const glm::dvec3& center_m, double side_deg, double height_deg, double distance_m,
                  double time_s = 0) {
  const glm::dvec3 outwards(std::cos(rad(height_deg)) * std::sin(rad(side_deg)), std::sin(rad(height_deg)),
                            std::cos(rad(height_deg)) * std::cos(rad(side_deg)));
  CameraFrame frame;
  frame.time_s = time_s;
  frame.camera = {center_m + outwards * distance_m, look_rotation(-outwards, {0, 1, 0}, {1, 0, 0})};
  return frame;
}

ShotDeviation deviation(const CameraFrame& asked, const CameraFrame& now, const glm::dvec3& center_m = {3, 1, -2}) {
  return up_to_limits(deviation_between(shot_properties(asked, center_m), shot_properties(now, center_m)));
}

TEST(Coherence, EachPropertyDeviatesFromItsBandToItsLimit) {
  const glm::dvec3 center_m(3, 1, -2);
  const CameraFrame asked = looks(center_m, 170, 10, 6);
  struct Case {
    double side, height, distance;
    ShotDeviation expected;
  };
  const Case cases[] = {
      {170, 10, 6, {}},
      {170 + 29, 10 + 9, 6 * 1.18, {}},  // all within their bands
      {170 + 75, 10, 6, {.side = 0.5}},  // across the seam at 180 degrees
      {170 - 75, 10, 6, {.side = 0.5}},
      {170 + 150, 10, 6, {.side = 1.0}},
      {170, 10 + 27.5, 6, {.height = 0.5}},
      {170, 80, 6, {.height = 1.0}},
      {170, 10, 6 * std::exp2(0.875), {.size = 0.5}},
      {170, 10, 6 / std::exp2(2.0), {.size = 1.0}},
  };
  for (const Case& c : cases) {
    const ShotDeviation found = deviation(asked, looks(center_m, c.side, c.height, c.distance));
    EXPECT_NEAR(found.side, c.expected.side, 1e-9) << c.side;
    EXPECT_NEAR(found.height, c.expected.height, 1e-9) << c.height;
    EXPECT_NEAR(found.size, c.expected.size, 1e-9) << c.distance;
    EXPECT_NEAR(found.place, 0, 1e-9);
  }
}

TEST(Coherence, HeightsAreToldBesideTheAskedOne) {
  std::vector<CameraFrame> frames;
  const std::vector<glm::dvec3> centers_m(5, glm::dvec3(3, 1, -2));
  for (const double height_deg : {10.0, 20.0, 59.0, 61.0, 80.0})
    frames.push_back(looks(centers_m[0], 0, height_deg, 6, 0.1 * static_cast<double>(frames.size())));
  const CoherenceMetrics metrics = coherence_of(frames, shots_as_begun(frames, centers_m), {});
  EXPECT_NEAR(metrics.asked_height_rad, rad(10), 1e-9);
  EXPECT_NEAR(metrics.median_height_rad, rad(59), 1e-9);
  EXPECT_DOUBLE_EQ(metrics.high_share, 0.4);
}

TEST(Coherence, ALongerLensMakesTheSameSizeFromFartherAway) {
  CameraFrame asked = looks({3, 1, -2}, 0, 0, 5), far = looks({3, 1, -2}, 0, 0, 10);
  far.lens.vertical_fov_rad = 2 * std::atan(std::tan(asked.lens.vertical_fov_rad / 2) / 2);
  EXPECT_NEAR(deviation(asked, far).size, 0, 1e-9);
}

TEST(Coherence, ThePlaceIsOfTheCentreInThePicture) {
  const glm::dvec3 center_m(3, 1, -2);
  const CameraFrame asked = looks(center_m, 0, 0, 5);
  CameraFrame turned = asked;
  const auto turn = [&](double share_of_half) {  // to the right, so that the centre is to the left by this share
    const double angle = std::atan(share_of_half * std::tan(asked.lens.vertical_fov_rad / 2) * asked.lens.aspect);
    turned.camera.rotation = asked.camera.rotation * glm::angleAxis(-angle, glm::dvec3(0, 1, 0));
    return deviation(asked, turned).place;
  };
  EXPECT_NEAR(turn(0.1), 0, 1e-9);
  EXPECT_NEAR(turn(0.575), 0.5, 1e-9);
  EXPECT_NEAR(turn(3.0), 1, 1e-9);
  turned.camera.rotation = asked.camera.rotation * glm::angleAxis(std::numbers::pi, glm::dvec3(0, 1, 0));
  EXPECT_EQ(deviation(asked, turned).place, 1) << "behind the camera";
}

TEST(Coherence, ACameraThatMovesWithItsTargetsKeepsTheShot) {
  std::vector<CameraFrame> frames;
  std::vector<glm::dvec3> centers_m;
  for (int i = 0; i < 120; ++i) {
    centers_m.push_back({2.0 * i * kTick, 1, 0});
    frames.push_back(looks(centers_m.back(), 30, 10, 6, i * kTick));
  }
  const CoherenceMetrics kept = coherence_of(frames, shots_as_begun(frames, centers_m), {});
  EXPECT_EQ(kept.kept_share, 1.0);
  EXPECT_NEAR(mean_of(kept.mean), 0, 1e-12);
  // From rest to 2 m/s in the first tick, and no change after it.
  EXPECT_NEAR(kept.mean_acceleration_mps2, 2.0 / (119 * kTick), 1e-6);
}

TEST(Coherence, HalfARunFromAboveIsHalfKept) {
  std::vector<CameraFrame> frames;
  std::vector<glm::dvec3> centers_m(100, glm::dvec3(0));
  for (int i = 0; i < 100; ++i) {
    frames.push_back(looks({}, 0, i < 50 ? 10 : 70, 6, i * kTick));
    frames.back().jump = i == 50;
  }
  const CoherenceMetrics metrics = coherence_of(frames, shots_as_begun(frames, centers_m), {});
  EXPECT_NEAR(metrics.kept_share, 0.5, 1e-12);
  EXPECT_NEAR(metrics.mean.height, 0.5, 1e-12);
  EXPECT_NEAR(mean_of(metrics.mean), 0.125, 1e-12);
  EXPECT_EQ(metrics.mean_acceleration_mps2, 0) << "a cut is no acceleration";
}

// Four pictures: the asked one, one that shows half of a body, one from above, and one of nobody.
TEST(Coherence, APictureIsWorthWhatItShowsAndHowItKeepsTheShot) {
  std::vector<CameraFrame> frames;
  std::vector<FrameTruth> truths(5);
  const std::vector<glm::dvec3> centers_m(5, glm::dvec3(0));
  const double heights_deg[] = {10, 10, 80, 10, 10}, inside[] = {1, 0.475, 1, 0, 0};
  for (size_t i = 0; i < 5; ++i) {
    frames.push_back(looks({}, 0, heights_deg[i], 6, kTick * static_cast<double>(i)));
    if (i == 4) continue;  // not judged
    PictureTruth& picture = truths[i].picture.emplace();
    picture.targets.push_back(
        {.id = 1, .alone_pixels = 100, .visible_pixels = 100, .outline = {.in_picture_share = inside[i]}});
  }
  const CoherenceMetrics metrics = coherence_of(frames, shots_as_begun(frames, centers_m), truths);
  EXPECT_NEAR(metrics.mean_worth, (1 + 0.5 + (1 - ShotWeights{}.height) + 0) / 4, 1e-9);
  EXPECT_NEAR(metrics.mean_sight_loss, (0 + 0.5 + 0 + 1) / 4, 1e-9);
  EXPECT_NEAR(metrics.as_asked_share, 0.25, 1e-9);
}

TEST(Coherence, NothingWithoutFrames) {
  EXPECT_EQ(coherence_of({}, {}, {}).kept_share, 0);
}

}  // namespace
}  // namespace sightline
