// The guide's table against the costs that it was given, at the nearest place by a plain search.
#include "client/ceiling/guide.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/gtx/component_wise.hpp>
#include <random>

#include "tests/support/small_scenes.h"

namespace sightline {
namespace {

class GuideTest : public testing::Test {
 protected:
  GuideTest()
      : place_(test::SmallScene(1, {0, 1.5, 5}).target("anna", {0, 0, 0}).closed_box(true)), world_(place_.world()) {
    PlaceGridOptions options;
    options.wanted = [](const glm::dvec3& center_m) { return glm::compMax(glm::abs(center_m)) < 6; };
    grid_ = std::make_unique<PlaceGrid>(world_->colliders(), world_->mirror().moving_slots(), glm::dvec3(0, 1.5, 5),
                                        options);
  }
  // The place of the point's cell, else the nearest of the 26 cells round it, by a search of all places.
  uint32_t plain_place(const glm::dvec3& point_m) const {
    const glm::ivec3 cell = grid_->cell_of(point_m);
    uint32_t nearest = kNoPlace;
    for (uint32_t place = 0; place < grid_->size(); ++place) {
      const glm::ivec3 away = glm::abs(grid_->cell(place) - cell);
      if (away == glm::ivec3(0)) return place;
      if (away.x > 1 || away.y > 1 || away.z > 1) continue;
      if (nearest == kNoPlace ||
          glm::distance(grid_->place_m(place), point_m) < glm::distance(grid_->place_m(nearest), point_m))
        nearest = place;
    }
    return nearest;
  }

  test::Place place_;
  std::unique_ptr<ScenarioWorld> world_;
  std::unique_ptr<PlaceGrid> grid_;
};

TEST_F(GuideTest, TellsTheCostsOfTheNearestPlaceOfEachStage) {
  ASSERT_GT(grid_->size(), 1000u);
  std::mt19937 random(5);
  std::uniform_real_distribution<float> share(0.0f, 1.0f);
  Guide guide(*grid_, 2);
  std::vector<std::vector<float>> pictures(2), to_go(2);
  for (size_t stage = 0; stage < 2; ++stage) {
    for (uint32_t place = 0; place < grid_->size(); ++place)
      pictures[stage].push_back(share(random)), to_go[stage].push_back(20 + 100 * share(random));
    guide.keep(stage, pictures[stage], to_go[stage]);
  }
  int in_cell = 0, beside = 0, nowhere = 0;
  std::uniform_real_distribution<double> coordinate(-7.0, 7.0);
  for (int k = 0; k < 3000; ++k) {
    const glm::dvec3 point_m(coordinate(random), coordinate(random), coordinate(random));
    const uint32_t place = plain_place(point_m);
    for (size_t stage = 0; stage < 2; ++stage) {
      if (place == kNoPlace) {
        EXPECT_EQ(guide.picture(point_m, stage), kNoWayCost);
        EXPECT_EQ(guide.to_go(point_m, stage), kNoWayCost);
        continue;
      }
      EXPECT_NEAR(guide.picture(point_m, stage), pictures[stage][place], 0.5 / 200 + 1e-6) << k;
      EXPECT_NEAR(guide.to_go(point_m, stage), to_go[stage][place], 0.5 / 64 + 1e-4) << k;
    }
    if (place != kNoPlace) {
      EXPECT_EQ(guide.picture(point_m, 2), 0.0) << "after the last stage";
      EXPECT_EQ(guide.to_go(point_m, 2), 0.0);
    }
    nowhere += place == kNoPlace;
    if (place != kNoPlace) ++(grid_->cell(place) == grid_->cell_of(point_m) ? in_cell : beside);
  }
  EXPECT_GT(in_cell, 100);
  EXPECT_GT(beside, 100);
  EXPECT_GT(nowhere, 100);
}

TEST_F(GuideTest, CostsThatAreTooHighAreTheHighestThatItKeeps) {
  Guide guide(*grid_, 1);
  std::vector<float> pictures(grid_->size(), 5.0f), to_go(grid_->size(), 1e9f);
  to_go[0] = 3.0f;
  guide.keep(0, pictures, to_go);
  const glm::dvec3 first_m = grid_->place_m(0), other_m = grid_->place_m(1);
  EXPECT_DOUBLE_EQ(guide.picture(first_m, 0), static_cast<double>(255 / 200.0f));
  EXPECT_DOUBLE_EQ(guide.to_go(first_m, 0), 3.0);
  EXPECT_NEAR(guide.to_go(other_m, 0), 3.0 + 65535 / 64.0, 1e-3);
}

}  // namespace
}  // namespace sightline
