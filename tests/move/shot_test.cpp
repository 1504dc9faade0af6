#include "server/move/shot.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "server/move/choose.h"
#include "tests/support/round_maps.h"

namespace sightline {
namespace {

using namespace test;

const auto kAnywhere = [](const glm::dvec3&) { return true; };

// Between viewpoints beside each other.
constexpr size_t kNextElevation = ViewpointMap::kDistances, kNextAzimuth = ViewpointMap::kElevations * kNextElevation;

// Targets around a centre at the origin, the viewpoints around them, the requested shot and the present one.
struct Filming {
  std::vector<TrackedTarget> targets;
  std::vector<uint64_t> ids;
  ViewpointMap viewpoints;
  glm::dvec3 asked_m{0.0}, present_m{0.0};
  size_t former = 0;
  MoveSettings move;
  double take_asked_below = -1;

  explicit Filming(std::vector<double> weights = {1.0}) {
    for (size_t i = 0; i < weights.size(); ++i) {
      TrackedTarget t;
      t.aim_m = glm::dvec3(static_cast<double>(i) - static_cast<double>(weights.size() - 1) / 2, 0, 0);
      t.radius_m = 0.5, t.weight = weights[i];
      targets.push_back(t), ids.push_back(i + 1);
    }
    // no shot is good enough to be kept unweighed
    move.viewpoint_search.keep_shot_below = -1, move.viewpoint_search.switch_margin = 0;
    viewpoints.follow(ids, 6.0);
    shoot(viewpoints.offset_m(20));
  }
  glm::dvec3 center() const { return weighted_center_m(targets); }
  void shoot(const glm::dvec3& offset_m) { asked_m = present_m = offset_m; }
  // Every viewpoint sees target `i` except those in `hidden`, and those farther out in the same directions.
  void look(size_t i, const std::set<size_t>& hidden) {
    RoundMaps maps(center(), 64);
    for (const size_t place : hidden) maps.hide(center() + viewpoints.offset_m(place), 0.1);
    viewpoints.learn(i, maps.maps, center(), 0.0, 1e6, 0.1);
  }
  std::optional<size_t> choose(const std::function<bool(const glm::dvec3&)>& allowed = kAnywhere) const {
    const ShotWish wish{.asked_m = asked_m,
                        .present_m = present_m,
                        .asked_place = viewpoints.nearest_viewpoint(asked_m),
                        .former_place = former,
                        .take_asked_below = std::max(take_asked_below, move.viewpoint_search.keep_shot_below)};
    return choose_shot(viewpoints, targets, wish, move, allowed);
  }
};

// What a shot loses beside another one: the default weights of side, height and size, each from its free band to its
// limit.
double departure(const glm::dvec3& from_m, const glm::dvec3& to_m) {
  const auto degrees = [](double radians) { return radians * 180 / std::acos(-1.0); };
  const glm::dvec2 side_from = glm::normalize(glm::dvec2(from_m.x, from_m.z)),
                   side_to = glm::normalize(glm::dvec2(to_m.x, to_m.z));
  const double turn = degrees(std::acos(std::clamp(glm::dot(side_from, side_to), -1.0, 1.0)));
  const auto elevation = [&](const glm::dvec3& v) { return degrees(std::asin(v.y / glm::length(v))); };
  const double octaves = std::abs(std::log2(glm::length(to_m) / glm::length(from_m)));
  const auto side_share = [&](const glm::dvec3& v) { return std::min(1.0, 2 * std::hypot(v.x, v.z) / glm::length(v)); };
  const double side = side_share(from_m) * side_share(to_m) * (turn - 30) / 90;
  const double height = (std::abs(elevation(to_m) - elevation(from_m)) - 10) / 35, size = (octaves - 0.25) / 1.25;
  return 0.15 * std::clamp(side, 0.0, 1.0) + 0.3 * std::clamp(height, 0.0, 1.0) + 0.3 * std::clamp(size, 0.0, 1.0);
}

TEST(Shot, OneThatIsSeenIsKept) {
  Filming film;
  for (const size_t place : {20, 100, 131, 239}) {
    film.shoot(film.viewpoints.offset_m(place));
    film.look(0, {});
    EXPECT_EQ(film.choose(), place);
  }
}

TEST(Shot, OneThatIsHiddenIsLeftForOneNearBy) {
  Filming film;
  film.look(0, {20});
  ASSERT_EQ(film.viewpoints.share(0, 20), 0.0f);
  const auto chosen = film.choose();
  ASSERT_TRUE(chosen);
  EXPECT_NE(*chosen, 20u);
  EXPECT_EQ(film.viewpoints.share(0, *chosen), 1.0f);
  const glm::dvec3 was = film.viewpoints.offset_m(20), is = film.viewpoints.offset_m(*chosen);
  EXPECT_GT(glm::dot(was, is) / glm::length(was) / glm::length(is), 0.8) << "not across the line";
}

// The requested shot lies between viewpoints. One viewpoint is chosen all the same, and another requested shot moves
// the choice to its own side.
TEST(Shot, LiesBetweenTheOneAskedForAndTheOneThatIs) {
  Filming film;
  film.look(0, {});
  film.asked_m = {6, 1, 0}, film.present_m = {0, 1, 6};
  const auto chosen = film.choose();
  ASSERT_TRUE(chosen);
  const glm::dvec3 offset = film.viewpoints.offset_m(*chosen);
  EXPECT_GT(offset.x, -0.5);
  EXPECT_GT(offset.z, -0.5);
}

TEST(Shot, OnlyAllowedPlacesAreTaken) {
  Filming film;
  film.look(0, {});
  const auto high = film.choose([](const glm::dvec3& offset) { return offset.y > 4; });
  ASSERT_TRUE(high);
  EXPECT_GT(film.viewpoints.offset_m(*high).y, 4);
  std::vector<glm::dvec3> asked;
  EXPECT_FALSE(film.choose([&](const glm::dvec3& offset) {
    asked.push_back(offset);
    return false;
  }));
  ASSERT_EQ(asked.size(), ViewpointMap::kViewpoints) << "every place was asked for";
  for (size_t place = 0; place < asked.size(); ++place) EXPECT_EQ(asked[place], film.viewpoints.offset_m(place));
}

// Among equal viewpoints the first is always chosen.
TEST(Shot, EqualsAreDecidedByTheirOrder) {
  Filming film;
  film.look(0, {});
  film.move.keep_shot = 0;
  EXPECT_EQ(film.choose(), 0u);
  EXPECT_EQ(film.choose([&](const glm::dvec3& offset) { return offset != film.viewpoints.offset_m(0); }), 1u);
}

// The former viewpoint is kept when it is a little worse, but not when it is worse by more than the switch margin.
TEST(Shot, HoldsTheFormerPlaceUpToItsShare) {
  Filming film({1.0, 0.1});
  film.look(0, {}), film.look(1, {70});
  film.move.keep_shot = 0, film.move.predictive_power = 0;
  const double worse = 0.1 / 1.1;  // all else is equal: place 70 alone hides the lighter target
  film.former = 70;
  film.move.viewpoint_search.switch_margin = worse + 0.01;
  EXPECT_EQ(film.choose(), 70u);
  film.move.viewpoint_search.switch_margin = worse - 0.01;
  EXPECT_NE(film.choose(), 70u);
  film.move.viewpoint_search.switch_margin = 1;
  film.former = 0;
  EXPECT_NE(film.choose(), 70u);
}

// The requested shot is preferred to the former one. Each counts only while at most `keep_shot_below` of the targets is
// hidden from it and from its neighbours.
TEST(Shot, OneThatIsGoodEnoughIsKeptUnweighed) {
  Filming film;
  film.shoot(film.viewpoints.offset_m(86)), film.former = 186;
  film.move.keep_shot = 10, film.move.viewpoint_search.keep_shot_below = 0.1;
  film.look(0, {});
  EXPECT_EQ(film.choose(), 86u);
  film.look(0, {86});
  EXPECT_EQ(film.choose(), 186u);
  const auto weighed = film.choose([&](const glm::dvec3& offset) { return offset != film.viewpoints.offset_m(186); });
  ASSERT_TRUE(weighed && *weighed != 86);
  EXPECT_EQ(departure(film.asked_m, film.viewpoints.offset_m(*weighed)), 0)
      << "the free band holds a viewpoint that sees";
  film.look(0, {86 + kNextAzimuth, 86 - kNextAzimuth});
  EXPECT_EQ(film.choose(), 186u) << "half of what is beside it is hidden";
  film.move.viewpoint_search.keep_shot_below = 0.6;
  EXPECT_EQ(film.choose(), 86u);
}

// While the targets move, no shot is kept unweighed but the asked one.
TEST(Shot, TheAskedOneIsTakenAgainAsSoonAsItIsGood) {
  Filming film;
  film.asked_m = film.viewpoints.offset_m(86), film.present_m = film.viewpoints.offset_m(186);
  film.former = 186, film.move.viewpoint_search.switch_margin = 0.1, film.move.keep_shot = 0.05;
  film.look(0, {});
  EXPECT_EQ(film.choose(), 186u) << "the asked one gains less than the margin";
  film.take_asked_below = 0.05;
  EXPECT_EQ(film.choose(), 86u);
  film.look(0, {86});
  EXPECT_NE(film.choose(), 86u);
}

TEST(Shot, WhatIsHiddenBesideCountsByThePredictivePower) {
  Filming film;
  // The neighbours of a viewpoint in a middle ring, which itself sees the target.
  film.look(0, {86 + kNextAzimuth, 86 - kNextAzimuth, 86 + kNextElevation, 86 - kNextElevation});
  film.move.keep_shot = 0, film.move.predictive_power = 0;
  const auto only = [&](size_t a, size_t b) {
    return [&film, a, b](const glm::dvec3& offset) {
      return offset == film.viewpoints.offset_m(a) || offset == film.viewpoints.offset_m(b);
    };
  };
  EXPECT_EQ(film.choose(only(86, 186)), 86u) << "both are seen";
  film.move.predictive_power = 0.5;
  EXPECT_EQ(film.choose(only(86, 186)), 186u) << "nothing is hidden beside it";
}

// Only two viewpoints are allowed. The required target is hidden from one and the optional target from the other, and
// the weight of the optional one must not matter.
TEST(Shot, NoWeightOfAnOptionalTargetMakesUpForTheRequiredOne) {
  CounterRandom random(62, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 200; ++trial) {
    Filming film({std::pow(10.0, random.next_in(-3, 3)), std::pow(10.0, random.next_in(-3, 6))});
    film.targets[1].required = false;
    film.former = trial % 2 == 0 ? 86 : 186;
    film.move.viewpoint_search.keep_shot_below = trial % 3 == 0 ? 0.15 : -1;
    film.move.keep_shot = 0, film.move.predictive_power = 0;
    film.shoot(film.viewpoints.offset_m(86));  // both the requested and the present shot
    film.look(0, {86}), film.look(1, {186});
    const auto chosen = film.choose([&](const glm::dvec3& offset) {
      return offset == film.viewpoints.offset_m(86) || offset == film.viewpoints.offset_m(186);
    });
    EXPECT_EQ(chosen, 186u) << "trial " << trial;
  }
}

// While the targets stand still, a hidden optional target is reason enough to look for another shot.
TEST(Shot, OneThatHidesAnOptionalTargetIsNotGoodEnough) {
  Filming film({1.0, 1.0});
  film.targets[1].required = false;
  film.move.viewpoint_search.keep_shot_below = 0.15;
  film.look(0, {}), film.look(1, {20});
  const auto chosen = film.choose();
  ASSERT_TRUE(chosen);
  EXPECT_NE(*chosen, 20u);
}

// Sixteen targets, some without weight, at random shots. The chosen shot has the least cost.
TEST(Shot, IsTheCheapestOfAll) {
  CounterRandom random(61, 0, RandomPurpose::kTest);
  const auto somewhere = [&] {
    return glm::dvec3(random.next_in(-6, 6), random.next_in(0.1, 6), random.next_in(-6, 6));
  };
  std::set<size_t> chosen;
  for (int trial = 0; trial < 40; ++trial) {
    std::vector<double> weights;
    for (int i = 0; i < 1 + trial % 16; ++i) weights.push_back(i > 0 && i % 3 == 0 ? 0.0 : random.next_in(0.1, 2));
    Filming film(weights);
    film.asked_m = somewhere(), film.present_m = somewhere();
    for (size_t i = 0; i < weights.size(); ++i) {
      RoundMaps maps(film.center() + glm::dvec3(0.01, 0.02, 0.03), 8);
      maps.fill_at_random(random, 1, 9);
      film.viewpoints.learn(i, maps.maps, film.center(), 0, 0.1, 1);
    }
    film.move.keep_shot = random.next_in(0, 3), film.move.predictive_power = random.next_unit();
    film.move.viewpoint_search.switch_margin = random.next_in(0, 0.1);
    film.former = random.next_below(ViewpointMap::kViewpoints);
    double least = INFINITY;
    size_t best = 0;
    for (size_t place = 0; place < ViewpointMap::kViewpoints; ++place) {
      double sum = 0, hidden = 0, beside = 0;
      for (size_t i = 0; i < weights.size(); ++i) {
        sum += weights[i];
        hidden += weights[i] * (1 - static_cast<double>(film.viewpoints.share(i, place)));
        beside += weights[i] * (1 - static_cast<double>(film.viewpoints.share_beside(i, place)));
      }
      const glm::dvec3 offset_m = film.viewpoints.offset_m(place);
      const double ahead = film.move.predictive_power;
      double cost = ((1 - ahead) * hidden + ahead * beside) / sum +
                    film.move.keep_shot *
                        (0.02 * glm::distance(offset_m, film.asked_m) / glm::length(film.asked_m) +
                         departure(film.asked_m, offset_m) + 0.3 * departure(film.present_m, offset_m));
      if (place == film.former) cost -= film.move.viewpoint_search.switch_margin;
      if (cost < least - 1e-12) least = cost, best = place;
    }
    EXPECT_EQ(film.choose(), best) << "trial " << trial;
    chosen.insert(best);
  }
  EXPECT_GT(chosen.size(), 15u);
}

}  // namespace
}  // namespace sightline
