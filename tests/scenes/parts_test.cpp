// The arithmetic, shapes and paths that scenes are made from, against the standard library and plain
// definitions.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "scenes/building.h"
#include "scenes/exact.h"
#include "scenes/path.h"
#include "scenes/shapes.h"
#include "server/base/transform.h"

namespace sightline::scenes {
namespace {

TEST(Exact, CirclePointsAgreeWithTheStandardLibrary) {
  for (double turns = -2.0; turns <= 2.0; turns += 0.00137) {
    const glm::dvec2 p = circle_point(turns);
    EXPECT_NEAR(p.x, std::cos(2 * std::numbers::pi * turns), 1e-12);
    EXPECT_NEAR(p.y, std::sin(2 * std::numbers::pi * turns), 1e-12);
  }
}

TEST(Exact, FacingTurnsTheFrontOfAModelToEachDirection) {
  for (double turns = 0; turns < 1; turns += 0.01) {
    const glm::dvec2 d = circle_point(turns);
    const glm::dvec3 front = facing(d) * glm::dvec3(0, 0, 1);
    EXPECT_NEAR(glm::distance(front, glm::dvec3(d.x, 0, d.y)), 0, 1e-9) << turns;
    EXPECT_NEAR(glm::length(facing(d)), 1, 1e-9);
  }
}

TEST(Exact, LookingAgreesWithLookRotation) {
  CounterRandom random(5, 0, RandomPurpose::kTest);
  for (int i = 0; i < 200; ++i) {
    const glm::dvec3 eye{random.next_in(-5, 5), random.next_in(-5, 5), random.next_in(-5, 5)};
    const glm::dvec3 at{random.next_in(-5, 5), random.next_in(-5, 5), random.next_in(-5, 5)};
    const glm::dquat expected = look_rotation(glm::normalize(at - eye), {0, 1, 0}, {1, 0, 0});
    EXPECT_NEAR(angle_between(looking(eye, at), expected), 0, 1e-6);
  }
}

TEST(Exact, SnappedNumbersAreFloatsExactly) {
  CounterRandom random(6, 0, RandomPurpose::kTest);
  for (int i = 0; i < 1000; ++i) {
    const double value = snapped_in(random, -500, 500);
    EXPECT_EQ(static_cast<double>(static_cast<float>(value)), value);
    EXPECT_EQ(value * 1024, std::floor(value * 1024));
  }
}

// Six times the volume enclosed by the mesh; positive when its faces look outwards.
double signed_volume(const MeshData& mesh) {
  double sum = 0;
  for (size_t i = 0; i < mesh.indices.size(); i += 3) {
    const glm::dvec3 a = mesh.positions[mesh.indices[i]], b = mesh.positions[mesh.indices[i + 1]],
                     c = mesh.positions[mesh.indices[i + 2]];
    sum += glm::dot(a, glm::cross(b, c));
  }
  return sum / 6;
}

// Closed and consistently wound: every directed edge between two places has its opposite.
bool is_watertight(const MeshData& mesh) {
  using Place = std::array<float, 3>;
  std::map<std::pair<Place, Place>, int> balance;
  const auto place = [&](size_t i) {
    const glm::vec3& p = mesh.positions[mesh.indices[i]];
    return Place{p.x, p.y, p.z};
  };
  for (size_t i = 0; i < mesh.indices.size(); ++i) {
    const Place a = place(i), b = place(i % 3 == 2 ? i - 2 : i + 1);
    ++balance[{a, b}];
    --balance[{b, a}];
  }
  return std::all_of(balance.begin(), balance.end(), [](const auto& edge) { return edge.second == 0; });
}

TEST(Shapes, AreClosedAndFaceOutwards) {
  MeshData box, drum, cone, capsule;
  append_box(box, {-1, 0, -2}, {1, 3, 2});
  append_frustum(drum, {1, 0, 0}, 1.0, 0.5, 2.0, 16);
  append_frustum(cone, {0, 1, 0}, 1.0, 0.0, 3.0, 12);
  append_capsule(capsule, {0, 0, 0}, 0.3, 1.8, 16, 4);
  EXPECT_NEAR(signed_volume(box), 24, 1e-6);
  EXPECT_NEAR(signed_volume(drum), std::numbers::pi * 2.0 / 3 * (1 + 0.5 + 0.25), 0.1);
  EXPECT_NEAR(signed_volume(cone), std::numbers::pi, 0.15);
  EXPECT_NEAR(signed_volume(capsule), std::numbers::pi * (0.09 * 1.2 + 4.0 / 3 * 0.027), 0.03);
  for (const MeshData* mesh : {&box, &drum, &cone, &capsule}) EXPECT_TRUE(is_watertight(*mesh));
}

TEST(Shapes, CapsuleHasTheHeightAndWidthOfABody) {
  MeshData capsule;
  append_capsule(capsule, {0, 0, 0}, 0.3, 1.8, 16, 4);
  Aabb bounds;
  for (const glm::vec3& p : capsule.positions) bounds.grow(p);
  EXPECT_NEAR(bounds.min.y, 0, 1e-3);
  EXPECT_NEAR(bounds.max.y, 1.8, 1e-3);
  EXPECT_NEAR(bounds.max.x, 0.3, 1e-3);
}

TEST(Building, HasRealWindowsAndStandsOnItsFootprint) {
  const MeshData building = make_building({.floors = 3, .windows = 4, .side_m = 12, .floor_m = 3.25});
  EXPECT_EQ(building.indices.size() / 3, 72u * 3 * 4 + 26u);
  Aabb bounds;
  for (const glm::vec3& p : building.positions) bounds.grow(p);
  EXPECT_EQ(bounds.min, glm::vec3(-6, 0, -6));
  EXPECT_EQ(bounds.max, glm::vec3(6, 10.5f, 6));
  // Open only at the bottom, which adds nothing to the sum: outward facing means about the volume of the
  // block.
  EXPECT_NEAR(signed_volume(building) / (12 * 12 * 9.75), 1.0, 0.15);
}

TEST(Path, TurnsWithinTheWindowAndStaysOnTheLegsOtherwise) {
  const TimedPath path({{0, 0}, {4, 0}, {4, 4}}, {0, 2, 4});
  EXPECT_NEAR(glm::distance(path.position_m(1.0), glm::dvec2(2, 0)), 0, 1e-12);
  EXPECT_NEAR(glm::distance(path.velocity_mps(2 - 0.151), glm::dvec2(2, 0)), 0, 1e-9);
  EXPECT_NEAR(glm::distance(path.velocity_mps(2 + 0.151), glm::dvec2(0, 2)), 0, 1e-9);
  EXPECT_NEAR(glm::distance(path.velocity_mps(2), glm::dvec2(1, 1)), 0, 1e-9);
}

TEST(Path, VelocityIsTheDerivativeOfPosition) {
  const TimedPath path({{0, 0}, {4, 1}, {4, 4}, {1, 5}}, {0, 2, 3.5, 5});
  for (double t = -0.5; t < 5.5; t += 0.0173) {
    const glm::dvec2 difference = (path.position_m(t + 1e-5) - path.position_m(t - 1e-5)) / 2e-5;
    EXPECT_NEAR(glm::distance(difference, path.velocity_mps(t)), 0, 1e-3) << t;
  }
}

TEST(Path, ParallelKeepsItsDistanceFromEveryLeg) {
  const Polyline line{{0, 0}, {5, 0}, {5, 5}, {9, 5}};
  const Polyline left = parallel(line, 0.5);
  const Polyline expected{{0, -0.5}, {5.5, -0.5}, {5.5, 4.5}, {9, 4.5}};
  for (size_t i = 0; i < line.size(); ++i) EXPECT_NEAR(glm::distance(left[i], expected[i]), 0, 1e-9) << i;
}

}  // namespace
}  // namespace sightline::scenes
