#include "scenes/crowd.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/scenes/hidden.h"
#include "tests/scenes/stage.h"

namespace sightline {
namespace {

using namespace sightline::scenes;

constexpr double kTick_s = 1.0 / 60.0;

class Crowd : public testing::TestWithParam<uint64_t> {};
INSTANTIATE_TEST_SUITE_P(Seeds, Crowd, testing::Values(1, 2, 77));

TEST(Crowd, HasAsManyMoversAsAskedFor) {
  for (int movers : {0, 1, 20, 35}) {
    const Stage stage(make_crowd({.movers = movers}));
    EXPECT_EQ(stage.with_role("occluder").size(), static_cast<size_t>(movers));
    EXPECT_EQ(stage.with_role("target").size(), 2u);
  }
}

glm::dvec3 place(const Stage& stage, const Role& role, double time_s) {
  return stage.pose_of(role, time_s).position_m;
}

// The positions of all people at a time, the targets first.
std::vector<glm::dvec3> places(const Stage& stage, double time_s) {
  std::vector<glm::dvec3> all;
  for (const char* kind : {"target", "occluder"})
    for (const Role& role : stage.with_role(kind)) all.push_back(place(stage, role, time_s));
  return all;
}

TEST_P(Crowd, NobodyWalksThroughAnybodyElse) {
  const Stage stage(make_crowd({.seed = GetParam(), .movers = 35}));
  for (double time_s = 0; time_s <= 20; time_s += 6 * kTick_s) {
    const std::vector<glm::dvec3> all = places(stage, time_s);
    for (size_t a = 0; a < all.size(); ++a)
      for (size_t b = a + 1; b < all.size(); ++b) EXPECT_GE(glm::distance(all[a], all[b]), 0.6) << "at " << time_s;
  }
}

TEST_P(Crowd, MoversWalkAsPeopleDoAndStayAboutTheTargets) {
  const Stage stage(make_crowd({.seed = GetParam(), .movers = 35}));
  std::vector<glm::dvec3> before = places(stage, 0);
  double sum_m = 0;
  int count = 0;
  for (double time_s = 0.1; time_s <= 20; time_s += 0.1) {
    const std::vector<glm::dvec3> now = places(stage, time_s);
    const glm::dvec3 middle = (now[0] + now[1]) / 2.0;
    for (size_t k = 2; k < now.size(); ++k, ++count) {
      EXPECT_LE(glm::distance(now[k], before[k]) / 0.1, 1.7) << "at " << time_s;
      sum_m += glm::distance(now[k], middle);
    }
    before = now;
  }
  EXPECT_LE(sum_m / count, 8.0);
}

TEST_P(Crowd, ASmallerCrowdIsTheFirstPartOfALargerOne) {
  const Stage some(make_crowd({.seed = GetParam(), .movers = 5}));
  const Stage many(make_crowd({.seed = GetParam(), .movers = 12}));
  for (double time_s : {0.0, 7.0, 19.0}) {
    const std::vector<glm::dvec3> few = places(some, time_s), all = places(many, time_s);
    EXPECT_TRUE(std::equal(few.begin(), few.end(), all.begin())) << "at " << time_s;
  }
}

TEST_P(Crowd, HidesTheMoreTheMoreTheyAre) {
  double before = -0.01;
  for (int movers : {0, 10, 35}) {
    const Hidden hidden = hidden_from_fixed_offset(make_crowd({.seed = GetParam(), .movers = movers}), true);
    RecordProperty("any_percent_" + std::to_string(movers), static_cast<int>(100 * hidden.one_or_more));
    RecordProperty("all_percent_" + std::to_string(movers), static_cast<int>(100 * hidden.all));
    EXPECT_GT(hidden.one_or_more, before) << movers;
    before = hidden.one_or_more;
  }
  EXPECT_GT(before, 0.15);
}

TEST_P(Crowd, MoversCollideOnlyWhenAskedTo) {
  for (bool collide : {false, true}) {
    Stage stage(make_crowd({.seed = GetParam(), .movers_collide = collide}));
    stage.play(5);
    for (const Role& mover : stage.with_role("occluder")) {
      const auto& instance = stage.mirror().instances()[stage.mirror().slot_of(mover.id).value()];
      EXPECT_EQ(instance.attributes.collides, collide);
      EXPECT_TRUE(instance.attributes.occludes);
    }
  }
}

}  // namespace
}  // namespace sightline
