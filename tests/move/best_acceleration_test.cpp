// The acceleration that begins a flight plan: against a plain search over the same plan, and where it must lead.
#include "server/move/best_acceleration.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "server/base/random.h"

namespace sightline {
namespace {

constexpr double kSpacingM = 0.5, kBodyM = 0.3;
constexpr size_t kSlices = 12;
const glm::dvec3 kMiddleM(5, 5, 5);

// A planner of a cube of 21 cells a side, whose cells cost what a function of position says, at every slice.
class AccelerationTest : public testing::Test {
 protected:
  static constexpr int kSide = 21;

  void plan(
      const std::function<float(const glm::dvec3& position_m, size_t slice)>& cost,
      const std::function<bool(const glm::dvec3& position_m)>& is_open = [](const glm::dvec3&) { return true; }) {
    std::vector<PlaceRun> runs;
    for (int z = 0; z < kSide; ++z)
      for (int y = 0; y < kSide; ++y) runs.push_back({{0, y, z}, static_cast<uint32_t>((z * kSide + y) * kSide)});
    places_.set_runs(kSpacingM, runs, kSide * kSide * kSide);
    list_places(places_, position_m_);
    std::vector<float> clearance_m;
    for (const glm::dvec3& position_m : position_m_) clearance_m.push_back(is_open(position_m) ? 10.0f : 0.0f);
    planner_.lay(places_, position_m_, clearance_m, kBodyM, kSlices);
    for (size_t slice = 0; slice < kSlices; ++slice) {
      for (size_t i = 0; i < position_m_.size(); ++i)
        planner_.costs(slice)[planner_.cell_of(i)] = cost(position_m_[i], slice);
      planner_.blur(slice, 0.0);
    }
    planner_.plan({.position_m = kMiddleM}, settings_);
  }
  // The cost of an acceleration by what the header says.
  double plain_cost(const glm::dvec3& a) const {
    const auto position_at = [&](double t) { return input_.position_m + input_.velocity_mps * t + a * (t * t / 2); };
    double sum = 0, way_m = 0, end_s = 0;
    size_t slice = 0;
    for (double at_s = input_.first_slice_s; at_s <= 0.35;
         ++slice, at_s = input_.first_slice_s + 0.1 * static_cast<double>(slice)) {
      sum += planner_.cost_at(position_at(at_s), slice, 1e9);
      way_m += glm::distance(position_at(end_s), position_at(at_s)), end_s = at_s;
    }
    const glm::dvec3 velocity_mps = input_.velocity_mps + a * end_s,
                     relative_mps = velocity_mps - input_.group_velocity_mps;
    sum += planner_.cost_from(position_at(end_s) + velocity_mps * 0.1, slice, 1e9);
    return sum / kSlices + settings_.route * way_m + input_.effort_m * glm::dot(a, a) / 100 +
           0.02 * glm::dot(relative_mps, relative_mps);
  }
  glm::dvec3 best() const {
    const auto found = best_acceleration_mps2(planner_, settings_, input_);
    EXPECT_TRUE(found);
    return found.value_or(glm::dvec3(NAN));
  }

  FlightSettings settings_{.slice_s = 0.1, .speed_mps = 4.5, .route = 0.0, .afterwards = 0.3};
  AccelerationInput input_{.position_m = kMiddleM, .effort_m = 0.0};
  FlightPlanner planner_;
  PlaceList places_;
  std::vector<glm::dvec3> position_m_;
};

float distance_from(const glm::dvec3& a, const glm::dvec3& b) {
  return static_cast<float>(glm::distance(a, b));
}

TEST_F(AccelerationTest, LeadsToTheCheapPlaceAndBrakesBeforeIt) {
  const glm::dvec3 goal_m = kMiddleM + glm::dvec3(3, 0, 0);
  plan([&](const glm::dvec3& position_m, size_t) { return 20 * distance_from(position_m, goal_m); });
  EXPECT_GT(best().x, 9.0) << "at rest, far from it";
  EXPECT_LT(std::hypot(best().y, best().z), 0.5);
  input_.position_m = goal_m - glm::dvec3(0.5, 0, 0), input_.velocity_mps = {6, 0, 0};
  EXPECT_LT(best().x, -9.0) << "it would pass it within a tenth of a second";
  input_.position_m = goal_m, input_.velocity_mps = glm::dvec3(0.0);
  EXPECT_LT(glm::length(best()), 0.5) << "it is there";
}

TEST_F(AccelerationTest, LeavesInTimeForAPlaceThatWillBeGood) {
  // All places to the right of the middle become bad at 0.6 s. Nothing is wrong before.
  plan([](const glm::dvec3& position_m, size_t slice) {
    return slice >= 5 && position_m.x > kMiddleM.x - 0.75 ? 100.0f : 0.0f;
  });
  EXPECT_LT(best().x, -1.0);
}

TEST_F(AccelerationTest, OfPlacesThatAreAlikeIsNone) {
  plan([](const glm::dvec3&, size_t) { return 7.0f; });
  EXPECT_LT(glm::length(best()), 1e-9);
  input_.effort_m = 0.2, settings_.route = 0.3;
  input_.velocity_mps = {4, 0, 0};
  EXPECT_LT(best().x, 0.0) << "the way costs";
}

TEST_F(AccelerationTest, IsSmallerTheMoreItsEffortCosts) {
  plan([](const glm::dvec3& position_m, size_t) {
    return 2 * distance_from(position_m, kMiddleM + glm::dvec3(2, 0, 0));
  });
  double former = INFINITY;
  for (const double effort_m : {0.0, 0.5, 2.0, 10.0}) {
    input_.effort_m = effort_m;
    EXPECT_LT(best().x, former) << effort_m;
    EXPECT_GT(best().x, 0.0) << effort_m;
    former = best().x;
  }
  EXPECT_LT(former, 3.0);
}

TEST_F(AccelerationTest, KeepsToOpenCells) {
  // A wall at 0.75 m to the right, and the cheap place is behind it.
  const double wall_m = kMiddleM.x + 0.75;
  plan([](const glm::dvec3& position_m,
          size_t) { return 20 * distance_from(position_m, kMiddleM + glm::dvec3(4, 0, 0)); },
       [&](const glm::dvec3& position_m) { return position_m.x < wall_m; });
  input_.velocity_mps = {3, 0, 0};
  EXPECT_LT(best().x, 0.0);
  input_.velocity_mps = {7, 0, 0};
  EXPECT_FALSE(best_acceleration_mps2(planner_, settings_, input_)) << "it cannot stop before the wall";
  input_.position_m = kMiddleM + glm::dvec3(4, 0, 0), input_.velocity_mps = glm::dvec3(0.0);
  EXPECT_FALSE(best_acceleration_mps2(planner_, settings_, input_)) << "from inside the wall";
}

// Costs are interpolated between cells, so those of a cell behind a thin wall also count before the wall.
TEST_F(AccelerationTest, DoesNotPressAgainstAWallBetweenTwoOpenCells) {
  plan([](const glm::dvec3& position_m, size_t) {
    return 20 * distance_from(position_m, kMiddleM + glm::dvec3(4, 0, 0));
  });
  EXPECT_GT(best().x, 9.0);
  input_.is_free = [](const glm::dvec3& to_m) { return to_m.x <= kMiddleM.x + 1e-9; };
  EXPECT_LE(best().x, 0.0);
  // A gap beside the camera: those to it are the cheapest of the rest.
  input_.is_free = [](const glm::dvec3& to_m) { return to_m.x <= kMiddleM.x + 1e-9 || to_m.z > kMiddleM.z + 0.2; };
  EXPECT_GT(best().x, 3.0);
  EXPECT_GT(best().z, 3.0);
  input_.is_free = [](const glm::dvec3&) { return false; };
  EXPECT_FALSE(best_acceleration_mps2(planner_, settings_, input_));
}

TEST_F(AccelerationTest, IsTheMeanThatAPlainSearchFinds) {
  for (uint64_t seed = 1; seed <= 20; ++seed) {
    CounterRandom random(seed, 0, RandomPurpose::kTest);
    const auto vector = [&](double most) {
      return glm::dvec3(random.next_in(-most, most), random.next_in(-most, most), random.next_in(-most, most));
    };
    const glm::dvec3 good_m = kMiddleM + vector(2), bad_m = kMiddleM + vector(2);
    const double moves_m = random.next_in(-0.2, 0.2);
    settings_.route = random.next_in(0, 0.5);
    input_ = {.position_m = kMiddleM + vector(0.5),
              .velocity_mps = vector(3),
              .group_velocity_mps = vector(2),
              .planned_mps2 = vector(12),
              .first_slice_s = random.next_in(0.001, 0.1),
              .effort_m = random.next_in(0, 0.5)};
    plan([&](const glm::dvec3& position_m, size_t slice) {
      const glm::dvec3 bad_then_m = bad_m + glm::dvec3(moves_m * static_cast<double>(slice), 0, 0);
      return 3 * distance_from(position_m, good_m) + 30 / (0.5f + distance_from(position_m, bad_then_m));
    });
    const glm::dvec3 found = best();
    struct Tried {
      glm::dvec3 acceleration_mps2;
      double cost, weight;
    };
    std::vector<Tried> tried;
    const auto attempt = [&](const glm::dvec3& a, double weight) { tried.push_back({a, plain_cost(a), weight}); };
    attempt(input_.planned_mps2 * std::min(1.0, 10 / glm::length(input_.planned_mps2)), 10);
    for (int x = -1; x <= 1; ++x)
      for (int y = -1; y <= 1; ++y)
        for (int z = -1; z <= 1; ++z)
          for (const double strength : {3.0, 6.5, 10.0}) {
            const glm::dvec3 direction(x, y, z);
            if (x == 0 && y == 0 && z == 0 && strength > 3) continue;
            attempt(glm::length(direction) > 0 ? glm::normalize(direction) * strength : direction, 1);
          }
    double least = INFINITY, weights = 0;
    for (const Tried& one : tried) least = std::min(least, one.cost);
    glm::dvec3 mean(0.0);
    for (const Tried& one : tried) {
      const double weight = one.weight * std::exp(-(one.cost - least) / 0.17);
      mean += weight * one.acceleration_mps2, weights += weight;
    }
    EXPECT_LT(glm::distance(found, mean / weights), 1e-6) << seed;
    EXPECT_LE(glm::length(found), input_.max_acceleration_mps2);
  }
}

TEST_F(AccelerationTest, FollowsTheTargetsVelocityAndThePlanWhereNothingElseMatters) {
  plan([](const glm::dvec3&, size_t) { return 7.0f; });
  input_.group_velocity_mps = {0, 0, 3};
  EXPECT_GT(best().z, 1.0);
  input_.velocity_mps = input_.group_velocity_mps;
  EXPECT_LT(glm::length(best()), 1e-9);
  input_.planned_mps2 = {0, 25, 0};
  EXPECT_GT(best().y, 0.5);
  EXPECT_LT(best().y, 10.0);
}

// Both sides of a pillar are equally good, and so the mean without a plan leads straight at it.
TEST_F(AccelerationTest, TakesThePlansSideOfTwoThatAreEquallyGood) {
  plan([](const glm::dvec3& position_m, size_t) { return std::abs(position_m.z - kMiddleM.z) < 1.25 ? 60.0f : 0.0f; });
  EXPECT_LT(std::abs(best().z), 1e-6);
  for (const double side : {-1.0, 1.0}) {
    input_.planned_mps2 = {0, 0, 20 * side};
    EXPECT_GT(best().z * side, 3.0);
  }
}

TEST_F(AccelerationTest, CountsNoSpeedBeyondTheLimit) {
  // Only a camera that flies faster than it may would be at the cheap place in time.
  plan([](const glm::dvec3& position_m, size_t slice) {
    return slice < 3 && position_m.x > kMiddleM.x + 1.75 ? -50.0f : 0.0f;
  });
  input_.velocity_mps = {5, 0, 0}, input_.effort_m = 1.0;
  EXPECT_GT(best().x, 3.0);
  input_.max_speed_mps = 5.0;
  EXPECT_LT(std::abs(best().x), 1.0);
}

}  // namespace
}  // namespace sightline
