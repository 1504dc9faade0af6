// The step's report of each target: its occluders, the part of it inside the picture, and the forecast.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <vector>

#include "server/base/random.h"
#include "tests/support/filming.h"

namespace sightline::test {
namespace {

constexpr double kTick = 1.0 / 60;
// The default of Tuning.aggregate.visibility_threshold.
constexpr double kSeenShare = 0.75;

// A camera that cannot move or turn.
struct Still : Filming {
  explicit Still(const glm::dvec3& target = {0, 1, 0}) {
    add_target(1, target);
    place({0, 1, 6}, {0, 1, 0});
    limits.max_acceleration_mps2 = limits.max_angular_acceleration_radps2 = 1e-6;
  }
};

// ---- occluders ----

// A thin board across the view.
struct Board {
  uint64_t id;
  glm::dvec2 low, high;  // x, y
  double z;
};
bool hides(const Board& board, const glm::dvec3& point, const glm::dvec3& eye) {
  const double t = (board.z - point.z) / (eye.z - point.z);
  if (t <= 0 || t >= 1) return false;
  const glm::dvec2 at = glm::dvec2(point) + t * (glm::dvec2(eye) - glm::dvec2(point));
  return glm::all(glm::greaterThan(at, board.low)) && glm::all(glm::lessThan(at, board.high));
}

TEST(Occlusions, AreThoseThatHideEachSampledPointFirst) {
  CounterRandom random(5, 0, RandomPurpose::kTest);
  std::map<size_t, int> with_count;
  for (int trial = 0; trial < 60; ++trial) {
    Still world;
    std::vector<Board> boards;
    for (uint64_t id = 10; id < 10 + static_cast<uint64_t>(trial % 7); ++id) {
      const glm::dvec2 low(random.next_in(-0.4, 0.2), random.next_in(0.0, 1.4));
      boards.push_back(
          {id, low, low + glm::dvec2(random.next_in(0.1, 0.5), random.next_in(0.2, 1.0)), random.next_in(1, 5)});
      const glm::dvec2 middle = (boards.back().low + boards.back().high) / 2.0, half = boards.back().high - middle;
      world.add_box(id, {middle.x, middle.y, boards.back().z}, {half.x, half.y, 1e-4}, {.collides = false});
    }
    const StepResult r = world.step(kTick);
    std::map<uint64_t, int> points_by_id;
    const std::vector<glm::dvec3>& sights_m = world.dump().plan.now.sights_m;
    for (const glm::dvec3& point : sights_m) {
      const Board* first = nullptr;
      for (const Board& board : boards)
        if (hides(board, point, r.camera.pose.position_m) && (!first || board.z < first->z)) first = &board;
      if (first) ++points_by_id[first->id];
    }
    const auto& got = r.targets[0].occlusions;
    ASSERT_EQ(got.size(), points_by_id.size()) << trial;
    double sum = 0;
    for (size_t i = 0; i < got.size(); ++i) {
      EXPECT_DOUBLE_EQ(got[i].share, points_by_id[got[i].id] / static_cast<double>(sights_m.size())) << trial;
      EXPECT_GE(got[i > 0 ? i - 1 : 0].share, got[i].share);
      sum += got[i].share;
    }
    EXPECT_NEAR(sum, 1 - r.targets[0].visible_share, 1e-12);
    ++with_count[got.size()];
  }
  EXPECT_GE(with_count.size(), 4u) << "none, one and several were tried";
}

TEST(Occlusions, AreAtMostEightTheGreatestFirst) {
  Still world;
  world.settings.sample.points = 16;
  for (uint64_t k = 0; k < 40; ++k) {
    const double low = 0.05 + 0.05 * static_cast<double>(k);
    world.add_box(10 + k, {0, low + 0.025, 0.5}, {1, 0.0249, 1e-4}, {.collides = false});
  }
  const StepResult r = world.step(kTick);
  EXPECT_LT(r.targets[0].visible_share, 0.2);
  EXPECT_EQ(r.targets[0].occlusions.size(), kMaxOcclusions);
}

// ---- the part inside the picture ----

TEST(PictureShare, IsThePartOfTheImageInsideThePicture) {
  const double edge = 6 * std::tan(Lens{}.vertical_fov_rad / 2) * Lens{}.aspect;
  const auto share_at = [](double x) { return Still({x, 1, 0}).step(kTick).targets[0].picture_share; };
  EXPECT_EQ(share_at(0), 1.0);
  EXPECT_EQ(share_at(edge - 0.4), 1.0);
  EXPECT_NEAR(share_at(edge), 0.5, 0.1) << "across the edge";
  EXPECT_EQ(share_at(edge + 0.4), 0.0);
  EXPECT_EQ(share_at(-edge - 20), 0.0);
  double before = 1.0;
  for (double x = edge - 0.4; x < edge + 0.4; x += 0.05) {
    const double now = share_at(x);
    EXPECT_LE(now, before + 0.05) << x;
    before = now;
  }
}

TEST(PictureShare, IsNothingBehindTheCameraAndPartOfATargetTooNear) {
  Still behind;
  behind.place({0, 1, 6}, {0, 1, 12});
  EXPECT_EQ(behind.step(kTick).targets[0].picture_share, 0.0);
  Still near;
  near.place({0, 1, 1.2}, {0, 1, 0});
  const double height_m = 2 * 0.9 * std::tan(Lens{}.vertical_fov_rad / 2);  // of the picture at the person's front
  EXPECT_NEAR(near.step(kTick).targets[0].picture_share, height_m / 1.8, 0.15);
}

TEST(PictureShare, DoesNotDependOnWhatHidesTheTarget) {
  const double edge = 6 * std::tan(Lens{}.vertical_fov_rad / 2) * Lens{}.aspect;
  Still open({edge, 1, 0}), hidden({edge, 1, 0});
  hidden.add_box(10, {edge / 2, 1, 3}, {2, 2, 0.01}, {.collides = false});
  EXPECT_EQ(open.step(kTick).targets[0].picture_share, hidden.step(kTick).targets[0].picture_share);
}

// ---- the forecast ----

// A person walks behind a wall, past a camera that stays.
struct WalksBehindAWall : Still {
  explicit WalksBehindAWall(double speed) : Still({-4, 1, 0}), speed_mps(speed) {
    add_box(10, {2, 1, 2}, {2, 3, 0.05}, {.collides = false});
  }
  TargetSight walk() {
    const double x = -2.4 + speed_mps * kTick * step_++;
    move(1, {x, 1, 0}, {speed_mps, 0, 0});
    return step(kTick).targets[0];
  }
  double speed_mps;
  int step_ = 0;
};

TEST(Forecast, ForetellsTheLossOfSightAndTheShareAfterIt) {
  double loss_error_s = 0, losses = 0;
  for (const double speed_mps : {1.0, 2.0, 4.0}) {
    SCOPED_TRACE(speed_mps);
    WalksBehindAWall world(speed_mps);
    std::vector<TargetSight> sights;
    int lost_at = -1;
    for (int i = 0; i < 400 && sights.size() < static_cast<size_t>(lost_at < 0 ? 400 : lost_at + 60); ++i) {
      sights.push_back(world.walk());
      if (lost_at < 0 && sights.back().filtered_share < kSeenShare) lost_at = i;
    }
    ASSERT_GT(lost_at, 30);
    std::optional<int> told_at;
    double error = 0, count = 0;
    for (int i = 20; i < lost_at; ++i) {
      const TargetSight& sight = sights[static_cast<size_t>(i)];
      ASSERT_TRUE(sight.forecast) << i;
      const SightForecast& forecast = *sight.forecast;
      const auto later = static_cast<size_t>(i + std::lround(forecast.ahead_s / kTick));
      error += std::abs(forecast.share - sights[later].visible_share), ++count;
      if (!forecast.loss_s) continue;
      if (!told_at) told_at = i;
      loss_error_s += std::abs(*forecast.loss_s - (lost_at - i) * kTick), ++losses;
      EXPECT_LE(*forecast.loss_s, forecast.ahead_s);
    }
    EXPECT_LT(error / count, 0.2) << "of the share; three points of the predicted person are sampled";
    ASSERT_TRUE(told_at) << "the loss was foretold";
    EXPECT_GT((lost_at - *told_at) * kTick, 0.2) << "and early enough to act";
    EXPECT_FALSE(sights[static_cast<size_t>(lost_at + 30)].forecast->loss_s) << "nothing is left to lose";
  }
  EXPECT_LT(loss_error_s / losses, 0.15);
}

TEST(Forecast, ForetellsNoLossInTheOpen) {
  OneFilmed world;
  for (int i = 0; i < 240; ++i) {
    world.move(1, {1.5 * i * kTick, 1, 0}, {1.5, 0, 0});
    const StepResult r = world.step(kTick);
    if (!r.targets[0].forecast) continue;
    EXPECT_FALSE(r.targets[0].forecast->loss_s) << i;
    EXPECT_EQ(r.targets[0].forecast->share, 1.0) << i;
  }
}

TEST(Forecast, IsAbsentWithoutPredictionAndTrustsErraticTargetsLess) {
  OneFilmed plain;
  plain.settings.move.prediction_s = 0;
  EXPECT_FALSE(plain.step(kTick).targets[0].forecast);

  OneFilmed calm, erratic;
  double calm_confidence = 0, erratic_confidence = 0;
  for (int i = 0; i < 120; ++i) {
    calm.move(1, {1.5 * i * kTick, 1, 0}, {1.5, 0, 0});
    erratic.move(1, {0.05 * ((i / 3) % 2), 1, 0});
    const StepResult a = calm.step(kTick), b = erratic.step(kTick);
    if (i < 60) continue;
    if (a.targets[0].forecast) calm_confidence += a.targets[0].forecast->confidence / 60;
    if (b.targets[0].forecast) erratic_confidence += b.targets[0].forecast->confidence / 60;
  }
  EXPECT_GT(calm_confidence, 0.9);
  EXPECT_LT(erratic_confidence, calm_confidence);
}

}  // namespace
}  // namespace sightline::test
