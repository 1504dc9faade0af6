// The grid of places against the distances that the camera itself keeps, which are computed without Embree.
#include "client/ceiling/places.h"

#include <gtest/gtest.h>

#include "server/scene/clearance.h"
#include "tests/support/small_scenes.h"

namespace sightline {
namespace {

constexpr double kBodyM = 0.31;

PlaceGridOptions options_within(double reach_m, double spacing_m = 0.5) {
  PlaceGridOptions options;
  options.spacing_m = spacing_m;
  options.body_m = kBodyM;
  options.wanted = [reach_m](const glm::dvec3& center_m) {
    return std::abs(center_m.x) < reach_m && std::abs(center_m.y) < reach_m && std::abs(center_m.z) < reach_m;
  };
  return options;
}

bool is_inside_box(const glm::dvec3& point_m) {
  return std::abs(point_m.x) < 2 && std::abs(point_m.z) < 2 && point_m.y > 0 && point_m.y < 3;
}

class Places : public testing::Test {
 protected:
  void make(const test::SmallScene& scene) {
    place_ = std::make_unique<test::Place>(scene);
    world_ = place_->world();
    colliders_.gather(world_->mirror(), {0, 0, 0}, 40, world_->mirror().moving_slots());
  }
  PlaceGrid grid(const glm::dvec3& start_m, const PlaceGridOptions& options) const {
    return {world_->colliders(), world_->mirror().moving_slots(), start_m, options};
  }
  std::unique_ptr<test::Place> place_;
  std::unique_ptr<ScenarioWorld> world_;
  ClearanceField colliders_;
};

TEST_F(Places, AndTheWaysBetweenThemAreFree) {
  make(test::SmallScene(1, {0, 1.5, 5}).target("anna", {0, 0, 0}).closed_box(true));
  const PlaceGrid places = grid({0, 1.5, 5}, options_within(6));
  ASSERT_GT(places.size(), 1000u);
  bool some_inside = false;
  for (uint32_t a = 0; a < places.size(); ++a) {
    some_inside = some_inside || is_inside_box(places.place_m(a));
    EXPECT_EQ(places.at(places.cell(a)), a);
    EXPECT_EQ(places.cell_of(places.place_m(a)), places.cell(a));
    ASSERT_GE(colliders_.clearance_m(places.place_m(a), 1.0), kBodyM - 1e-5);
    for (uint32_t edge = places.graph().first[a]; edge < places.graph().first[a + 1]; ++edge) {
      const glm::dvec3 to_m = places.place_m(places.graph().to[edge]);
      EXPECT_FLOAT_EQ(places.graph().length_m[edge], static_cast<float>(glm::distance(places.place_m(a), to_m)));
      // The body without what its radius has for the error of a sweep.
      ASSERT_TRUE(colliders_.free_fraction(places.place_m(a), to_m, kBodyM - 0.01) == 1.0);
    }
  }
  EXPECT_TRUE(some_inside) << "through the doorway";
}

TEST_F(Places, AreThoseThatTheStartIsConnectedWith) {
  make(test::SmallScene(1, {0, 1.5, 5}).target("anna", {0, 0, 0}).closed_box(false));
  const PlaceGrid outside = grid({0, 1.5, 5}, options_within(6)), inside = grid({0, 1.5, 0}, options_within(6));
  ASSERT_GT(inside.size(), 100u);
  for (uint32_t a = 0; a < outside.size(); ++a) EXPECT_FALSE(is_inside_box(outside.place_m(a)));
  for (uint32_t a = 0; a < inside.size(); ++a) EXPECT_TRUE(is_inside_box(inside.place_m(a)));
}

// The body has 10 cm to each side in the opening, wherever the cells lie.
TEST_F(Places, AreFoundInOpeningsNarrowerThanACell) {
  for (const double shift_m : {0.0, 0.0625, 0.125, 0.25, 0.4375}) {
    make(test::SmallScene(1, {0, 1, 5})
             .target("anna", {0, 0, -3})
             .box("left", {10, 12, 0.25}, {-5.3125 + shift_m, 0, 0})
             .box("right", {10, 12, 0.25}, {5.3125 + 0.1875 + shift_m, 0, 0}));
    const PlaceGrid places = grid({0, 1, 5}, options_within(5.5));
    bool behind = false;
    for (uint32_t a = 0; a < places.size(); ++a) behind = behind || places.place_m(a).z < -1;
    EXPECT_TRUE(behind) << shift_m;
  }
}

TEST_F(Places, EndWhereTheyAreTooMany) {
  make(test::SmallScene(1, {0, 1.5, 5}).target("anna", {0, 0, 0}));
  PlaceGridOptions options = options_within(6);
  EXPECT_TRUE(grid({0, 1.5, 5}, options).complete());
  options.most_places = 500;
  const PlaceGrid few = grid({0, 1.5, 5}, options);
  EXPECT_FALSE(few.complete());
  EXPECT_EQ(few.size(), 500u);
}

TEST_F(Places, AreNoneWhereTheBodyHasNoRoom) {
  make(test::SmallScene(1, {0, 1.5, 5}).target("anna", {0, 0, 0}).box("block", {2, 3, 2}, {0, 0, 5}));
  EXPECT_EQ(grid({0, 1.5, 4.25}, options_within(6, 0.25)).size(), 0u);
}

TEST_F(Places, SpherePassesWhereTheCamerasOwnSweepDoes) {
  make(test::SmallScene(1, {0, 1.5, 5}).target("anna", {0, 0, 0}).closed_box(true));
  const auto at = [](int k) { return glm::dvec3(-3 + 0.37 * (k % 17), 0.4 + 0.21 * (k % 11), -3 + 0.43 * (k % 15)); };
  int free = 0, blocked = 0;
  for (int k = 0; k < 1500; ++k) {
    const glm::dvec3 from_m = at(k), to_m = at(7 * k + 3);
    const bool passes = sphere_passes(world_->colliders(), world_->mirror().moving_slots(), from_m, to_m, 0.3);
    // Within the error of the sweep either answer is right.
    const bool surely_free = colliders_.free_fraction(from_m, to_m, 0.31) == 1.0;
    const bool surely_blocked = colliders_.free_fraction(from_m, to_m, 0.29) < 1.0;
    EXPECT_TRUE(passes || !surely_free) << k;
    EXPECT_FALSE(passes && surely_blocked) << k;
    free += surely_free;
    blocked += surely_blocked;
  }
  EXPECT_GT(free, 50);
  EXPECT_GT(blocked, 50);
}

}  // namespace
}  // namespace sightline
