// The strategies of the paper over real pair volumes.
#include <gtest/gtest.h>

#include <algorithm>

#include "server/paper/groups.h"
#include "server/paper/paper_settings.h"
#include "tests/support/world.h"

namespace sightline::test {
namespace {

constexpr double kTick = 1.0 / 60;

// Two people 1.5 m apart on an open plane, the camera 6 m in front of them, with the preset PAPER.
struct OpenPlane : World {
  OpenPlane() {
    settings = preset_settings(Preset::kPaper);
    add_box(100, {0, -0.1, 0}, {50, 0.1, 50});
    add_target(1, {-0.75, 1, 0});
    add_target(2, {0.75, 1, 0});
    place(kPlaceM, {0, 1, 0});
  }
  static constexpr glm::dvec3 kPlaceM{0, 1.6, 6};
};

struct Path {
  double length_m = 0;
  int pair_steps = 0;
};
Path play(World& world, double seconds) {
  Path path;
  for (int i = 0; i < seconds / kTick; ++i) {
    const glm::dvec3 before_m = world.camera().pose.position_m;
    path.pair_steps += world.step(kTick).volume == Volume::kPair;
    path.length_m += glm::distance(world.camera().pose.position_m, before_m);
  }
  return path;
}

class PaperFilter : public testing::TestWithParam<FilterMode> {};

TEST_P(PaperFilter, RobustMoveStaysInItsPlaceOnAnOpenPlane) {
  OpenPlane world;
  world.settings.aggregate.filter.mode = GetParam();
  const Path path = play(world, 10);
  EXPECT_EQ(path.pair_steps, 600);
  EXPECT_LT(path.length_m, 0.5);
  EXPECT_LT(glm::distance(world.camera().pose.position_m, OpenPlane::kPlaceM), 0.1);
}

// Without anything hidden the candidates are one group, however few rays meet.
TEST_P(PaperFilter, AnOpenPlaneIsOneGroup) {
  for (const double apart_m : {0.1, 1.5, 6.0}) {
    OpenPlane world;
    world.settings.aggregate.filter.mode = GetParam();
    world.move(1, {-apart_m / 2, 1, 0}, glm::dvec3(0)), world.move(2, {apart_m / 2, 1, 0}, glm::dvec3(0));
    world.step(kTick);
    ASSERT_EQ(world.dump().plan.pair.gap, PairGap::kNone);
    GroupScratch scratch;
    Groups groups;
    const CandidateSights& sights = world.dump().sights;
    std::vector<uint8_t> members(sights.position_m.size(), 1);
    find_groups(sights.texels, Neighbours::kTouching, sights.position_m, members, OpenPlane::kPlaceM, scratch, groups);
    EXPECT_EQ(groups.size_cells.size(), 1u) << apart_m << " m";
    EXPECT_GT(sights.texels.size(), 25u);
  }
}
INSTANTIATE_TEST_SUITE_P(Modes, PaperFilter, testing::Values(FilterMode::kNone, FilterMode::kJoint));

// A box hides both targets from the camera's place. The largest group lies to one side.
TEST(Paper, RobustMoveGoesToWhereBothAreSeen) {
  for (const RobustGoal goal : {RobustGoal::kDeepestMember, RobustGoal::kCenter}) {
    OpenPlane world;
    world.settings.move.robust_goal = goal;
    world.add_box(10, {0.2, 1.3, 4.5}, {0.5, 1.3, 0.05});
    play(world, 10);
    const StepResult result = world.step(kTick);
    EXPECT_EQ(result.volume, Volume::kPair);
    EXPECT_TRUE(std::all_of(result.targets.begin(), result.targets.end(),
                            [](const auto& t) { return t.visible_share == 1.0; }));
  }
}

// A post hides the targets from a strip in the middle of the bound, so what sees them is a U around it, whose centre is
// nearer to the strip than its deepest member.
TEST(Paper, ThePrintedCentreIsTheMeanOfTheGroup) {
  OpenPlane world;
  world.settings.aggregate.filter.mode = FilterMode::kNone;
  world.settings.move.robust_goal = RobustGoal::kCenter;
  world.settings.move.prediction_s = 0;
  world.add_box(10, {-0.5, 1.3, 4.5}, {0.2, 1.3, 0.05});
  world.step(kTick);
  world.step(kTick);
  const CandidateSights& sights = world.dump().sights;
  std::vector<uint8_t> members;
  for (const uint32_t seen : sights.candidates.filtered()) members.push_back((seen & 3u) == 3u);
  GroupScratch scratch;
  Groups groups;
  find_groups(sights.texels, Neighbours::kTouching, sights.position_m, members, OpenPlane::kPlaceM, scratch, groups);
  ASSERT_NE(groups.largest, kNoGroup);
  glm::dvec3 sum_m(0.0);
  double count = 0;
  for (size_t i = 0; i < members.size(); ++i)
    if (groups.group_of[i] == groups.largest) sum_m += sights.position_m[i], ++count;
  ASSERT_LT(count, members.size()) << "some are hidden";
  const glm::dvec3 wanted = world.dump().decision.wanted_mps, before_m = OpenPlane::kPlaceM;
  EXPECT_GT(glm::dot(glm::normalize(wanted), glm::normalize(sum_m / count - before_m)), 0.9) << "towards the mean";
}

// With pair volumes the filter works over the pair volumes of the last steps. A post that passes in three of ten steps
// changes nothing.
TEST(Paper, TheFilterOverPairVolumesIgnoresWhatPassesQuickly) {
  const auto farthest_m = [](FilterMode mode) {
    OpenPlane world;
    world.settings.move.strategy = Strategy::kBasic;
    world.settings.move.prediction_s = 0;
    world.settings.aggregate.filter.mode = mode;
    world.settings.aggregate.filter.n = 10, world.settings.aggregate.filter.alpha = 0.6;
    world.add_box(10, {0, 1, 30}, {0.15, 1, 0.05});
    double most_m = 0;
    for (int i = 0; i < 300; ++i) {
      world.move(10, {0, 1, i % 10 >= 7 ? 4.5 : 30.0}, glm::dvec3(0));
      EXPECT_EQ(world.step(kTick).volume, Volume::kPair);
      most_m = std::max(most_m, glm::distance(world.camera().pose.position_m, OpenPlane::kPlaceM));
    }
    return most_m;
  };
  EXPECT_GT(farthest_m(FilterMode::kNone), 0.005);
  EXPECT_LT(farthest_m(FilterMode::kJoint), 0.0005);
}

TEST(Paper, WhatNeedsCellsThatStayUsesTheLatticeAndSaysSo) {
  for (const bool by_filter : {false, true}) {
    OpenPlane world;
    if (by_filter)
      world.settings.aggregate.filter.mode = FilterMode::kPerTarget;
    else
      world.settings.move.strategy = Strategy::kMinCost;
    const StepResult result = world.step(kTick);
    EXPECT_EQ(result.volume, Volume::kLattice);
    EXPECT_TRUE(result.pair_asked && result.pair_needs_lattice);
  }
}

// The resolution follows from the samples that are wanted in a cubic metre, and the field `resolution` is the most.
TEST(Paper, DensityGivesTheResolution) {
  OpenPlane world;
  world.settings.sample.resolution = 20;
  world.step(kTick);
  EXPECT_EQ(world.dump().plan.views.front().width, 20);
  const double radius_m = world.dump().bound.radius_m,
               volume_m3 = 4.0 / 3 * 3.141592653589793 * radius_m * radius_m * radius_m;
  for (const int wanted : {2, 5, 9, 20}) {
    OpenPlane dense;
    dense.settings.sample.resolution = 20;
    dense.settings.sample.density_per_m3 = (wanted - 0.5) * (wanted - 0.5) * (wanted - 0.5) / volume_m3;
    dense.step(kTick);
    EXPECT_EQ(dense.dump().plan.views.front().width, wanted);
    dense.settings.sample.density_per_m3 = 1e6;
    dense.step(kTick);
    EXPECT_EQ(dense.dump().plan.views.front().width, 20);
  }
}

}  // namespace
}  // namespace sightline::test
