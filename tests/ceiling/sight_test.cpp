// What a camera could see of the targets, at places whose view is known.
#include "client/ceiling/sight.h"

#include <gtest/gtest.h>
#include <glm/gtc/quaternion.hpp>

#include "client/truth/coherence.h"
#include "server/base/random.h"
#include "tests/support/small_scenes.h"

namespace sightline {
namespace {

constexpr size_t kRays = 8;

class SightTest : public testing::Test {
 protected:
  SightEstimate& look(const test::SmallScene& scene) {
    place_ = std::make_unique<test::Place>(scene);
    world_ = place_->world();
    estimate_ = std::make_unique<SightEstimate>(*world_, place_->extents, limits_, kRays);
    estimate_->refresh(0);
    return *estimate_;
  }
  static test::SmallScene two_people() {
    return std::move(test::SmallScene(1, {0, 1, 8}).target("anna", {-1.5, 0, 0}).target("ben", {1.5, 0, 0}));
  }

  const MoveSettings limits_;
  const glm::dvec3 front_m_{0, 1, 8}, back_m_{0, 1, -8};
  std::unique_ptr<test::Place> place_;
  std::unique_ptr<ScenarioWorld> world_;
  std::unique_ptr<SightEstimate> estimate_;
};

void expect_shares(const TargetsSeen& seen, double least, double mean) {
  EXPECT_DOUBLE_EQ(seen.least_share, least);
  EXPECT_DOUBLE_EQ(seen.mean_share, mean);
}

TEST_F(SightTest, AWallHidesWhoIsBehindItFromThere) {
  const SightEstimate& estimate = look(two_people().box("wall", {0.8, 3, 0.2}, {0.75, 0, 4}));
  ASSERT_TRUE(estimate.is_allowed(front_m_) && estimate.is_allowed(back_m_));
  for (const size_t rays : {size_t{1}, kRays, size_t{kExtentPoints}}) {
    expect_shares(estimate.shares(front_m_, rays), 0.0, 0.5);
    expect_shares(estimate.shares(back_m_, rays), 1.0, 1.0);
  }
  EXPECT_TRUE(estimate.from(front_m_).allowed);
  expect_shares(estimate.from(front_m_), 0.0, 0.5);
  expect_shares(estimate.from(back_m_), 1.0, 1.0);
}

TEST_F(SightTest, WhatIsNearerThanTheNearPlaneHidesNothing) {
  const auto speck_at = [this](double z_m) { return two_people().box("speck", {0.4, 0.4, 0.02}, {0, 0.8, z_m}); };
  expect_shares(look(speck_at(7.95)).shares(front_m_, kRays), 1.0, 1.0);
  expect_shares(look(speck_at(7.7)).shares(front_m_, kRays), 0.0, 0.0);
}

TEST_F(SightTest, ThePictureHasRoomForBothOnlyFromFarEnough) {
  const SightEstimate& estimate = look(two_people());
  const glm::dvec3 close_m(0, 1, 2);  // they stand 37 degrees to each side; the lens has 33
  expect_shares(estimate.shares(close_m, kRays), 1.0, 1.0);
  EXPECT_FALSE(estimate.from(close_m).allowed);
  EXPECT_TRUE(estimate.from(front_m_).allowed);
}

// The wall covers the right half of the target. The share of all points is near one half, and each turn counts others
// of them.
TEST_F(SightTest, TurnsTakeTheirPointsInTurnsUntilAllWereTaken) {
  SightEstimate& estimate = look(
      std::move(test::SmallScene(1, {0, 1, 8}).target("anna", {0, 0, 0}).box("wall", {2, 3, 0.2}, {1, 0, 4})));
  const double all = estimate.shares(front_m_, kExtentPoints).least_share;
  EXPECT_NEAR(all, 0.5, 0.2);
  static_assert(kExtentPoints % kRays == 0);
  double sum = 0.0;
  constexpr size_t kTurns = kExtentPoints / kRays;
  bool differ = false;
  for (size_t turn = 0; turn < kTurns; ++turn) {
    estimate.refresh(turn);
    const double share = estimate.shares(front_m_, kRays).least_share;
    differ = differ || share != all;
    sum += share / static_cast<double>(kTurns);
    estimate.refresh(turn + kTurns);
    EXPECT_EQ(estimate.shares(front_m_, kRays).least_share, share) << "after all points, the first come again";
  }
  EXPECT_LE(sum, all + 1e-9);
  EXPECT_GT(sum, all / 2) << "three blocked rays at the beginning count as hidden";
  EXPECT_TRUE(differ);
}

// From some places the first three rays are all blocked, and others would arrive.
TEST_F(SightTest, ThreeBlockedRaysAtTheBeginningCountAsHidden) {
  const SightEstimate& estimate = look(
      std::move(test::SmallScene(1, {0, 1, 8}).target("anna", {0, 0, 0}).box("wall", {2, 3, 0.2}, {1, 0, 4})));
  int hidden = 0, doubtful = 0;
  for (double x_m = -1.5; x_m <= 1.5; x_m += 0.02) {
    const glm::dvec3 eye_m(x_m, 1, 8);
    const double first = estimate.shares(eye_m, 3).least_share, all = estimate.shares(eye_m, kExtentPoints).least_share;
    EXPECT_GE(all, 3 * first / kExtentPoints) << x_m;
    EXPECT_TRUE(first > 0.0 || all == 0.0) << x_m;
    hidden += first == 0.0;
    doubtful += first > 0.0 && first < 0.5;
  }
  EXPECT_GT(hidden, 5);
  EXPECT_GT(doubtful, 0);
}

// The judge counts pixels and the rays of an outline; the estimate counts points of the bodies' surfaces.
TEST_F(SightTest, WholeBodiesAreCountedAsTheJudgeCountsThem) {
  const SightEstimate& estimate = look(two_people().box("wall", {0.8, 3, 0.2}, {0.75, 0, 4}));
  const Lens lens = place_->scenario.lens();
  CounterRandom random(5, 0, RandomPurpose::kSceneGeneration);
  int cut_off = 0, hidden = 0;
  double sum = 0;
  constexpr int kPictures = 60;
  for (int k = 0; k < kPictures; ++k) {
    const glm::dvec3 eye_m(random.next_in(-4, 4), random.next_in(0.5, 3), random.next_in(3, 9));
    const Pose pose{
        eye_m, glm::quatLookAt(glm::normalize(glm::dvec3(random.next_in(-3, 3), 1, 0) - eye_m), glm::dvec3(0, 1, 0))};
    PictureTruth truth = measure_picture(world_->occluders(), world_->mirror(), world_->targets(), pose, lens);
    add_outlines(world_->occluders(), world_->mirror(), world_->targets(), pose, lens, truth);
    const double loss = estimate.whole_loss(pose, kExtentPoints);
    EXPECT_NEAR(loss, sight_loss(truth), 0.15) << k;
    sum += loss - sight_loss(truth);
    for (const TargetTruth& target : truth.targets) {
      cut_off += target.outline.in_picture_share < 0.8;
      hidden += target.alone_pixels > 0 && target.visible_share() < 0.8;
    }
  }
  EXPECT_NEAR(sum / kPictures, 0.0, 0.02) << "no bias";
  EXPECT_GT(cut_off, 5);
  EXPECT_GT(hidden, 5);
}

// At the edge of the wall, some places see the first rays arrive and later ones blocked.
TEST_F(SightTest, RaysThatAreKnownToArriveAreNotTracedAgain) {
  constexpr size_t kKnown = 16;
  const SightEstimate& estimate = look(
      std::move(test::SmallScene(1, {0, 1, 8}).target("anna", {0, 0, 0}).box("wall", {2, 3, 0.2}, {1, 0, 4})));
  int partly_seen = 0;
  for (double x_m = -1.5; x_m <= 1.5; x_m += 0.02) {
    const glm::dvec3 eye_m(x_m, 1, 8);
    const double all = estimate.shares(eye_m, kExtentPoints).least_share;
    const double trusting = estimate.shares(eye_m, kExtentPoints, kKnown).least_share;
    EXPECT_GE(trusting, double{kKnown} / kExtentPoints) << x_m;
    if (estimate.shares(eye_m, kKnown).least_share < 1.0) continue;
    EXPECT_EQ(trusting, all) << x_m;
    partly_seen += all < 1.0;
  }
  EXPECT_GT(partly_seen, 0);
}

}  // namespace
}  // namespace sightline
