// First hits against brute force: every triangle, in double.
#include "server/scene/ray.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/base/random.h"
#include "server/scene/crossings.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

// A heap of triangles of all sizes, half of them see-through, about `middle`.
MeshData heap(CounterRandom& random, int triangles, const glm::vec3& middle) {
  const auto any = [&](double size) {
    return glm::vec3(random.next_in(-size, size), random.next_in(-size, size), random.next_in(-size, size));
  };
  MeshData mesh;
  for (int i = 0; i < triangles; ++i) {
    const glm::vec3 place = middle + any(2.0);
    for (int corner = 0; corner < 3; ++corner) {
      mesh.indices.push_back(static_cast<uint32_t>(mesh.positions.size()));
      mesh.positions.push_back(place + any(0.3));
    }
  }
  mesh.see_through_first_index = static_cast<uint32_t>(triangles / 2 * 3);
  return mesh;
}

struct Brute {
  double distance = std::numeric_limits<double>::infinity();
  uint32_t first_index = 0;
  double edge = 1.0;  // the least barycentric coordinate over all triangles that the ray meets or nearly meets
};

Brute brute_first_hit(const Geometry& geometry, const glm::dvec3& origin, const glm::dvec3& direction) {
  Brute best;
  for (uint32_t i = 0; i < geometry.indices.size(); i += 3) {
    const auto corner = [&](uint32_t k) { return glm::dvec3(geometry.positions[geometry.indices[i + k]]); };
    const glm::dmat3 sides(corner(1) - corner(0), corner(2) - corner(0), -direction);
    if (glm::determinant(sides) == 0.0) continue;
    const glm::dvec3 uvt = glm::inverse(sides) * (origin - corner(0));
    const double inside = std::min({uvt.x, uvt.y, 1.0 - uvt.x - uvt.y});
    if (uvt.z > 0) best.edge = std::min(best.edge, std::abs(inside));
    if (inside >= 0 && uvt.z > 0 && uvt.z < best.distance) best.distance = uvt.z, best.first_index = i;
  }
  return best;
}

TEST(RayCaster, FindsTheFirstHitThatBruteForceFinds) {
  CounterRandom random(1, 0, RandomPurpose::kTest);
  const glm::vec3 middle(300, -200, 100);
  const auto geometry = build_geometry(heap(random, 900, middle)).value();
  const RayCaster caster(*geometry);
  int hits = 0;
  for (int i = 0; i < 4000; ++i) {
    const auto any = [&](double size) {
      return glm::dvec3(random.next_in(-size, size), random.next_in(-size, size), random.next_in(-size, size));
    };
    const glm::dvec3 origin = glm::dvec3(middle) + any(5.0), direction = glm::dvec3(middle) + any(2.0) - origin;
    const Brute want = brute_first_hit(*geometry, origin, direction);
    if (want.edge < 1e-4) continue;  // may fall on either side of the edge
    const SurfaceHit got = caster.first_hit(origin, direction);
    ASSERT_EQ(got.hit(), std::isfinite(want.distance)) << i;
    if (!got.hit()) continue;
    ++hits;
    ASSERT_EQ(got.first_index, want.first_index) << i;
    ASSERT_NEAR(got.distance, want.distance, 1e-9) << i;
    ASSERT_LT(glm::distance(got.point_m, origin + direction * want.distance), 1e-9) << i;
  }
  EXPECT_GT(hits, 500);
}

TEST(RayCaster, RaysAlongTheAxesHitABox) {
  const auto box = build_geometry(tessellate(BoxShape{{1, 2, 3}}).value()).value();
  const RayCaster caster(*box);
  for (int axis = 0; axis < 3; ++axis)
    for (const double sign : {-1.0, 1.0}) {
      glm::dvec3 direction(0.0), origin(0.1, 0.2, 0.3);
      direction[axis] = -sign, origin[axis] = sign * 10.0;
      EXPECT_NEAR(caster.first_hit(origin, direction).distance, 10.0 - (axis + 1), 1e-12);
      EXPECT_FALSE(caster.first_hit(origin, -direction).hit());
      origin[axis] = 0.0;  // from inside: the far side's back
      EXPECT_NEAR(caster.first_hit(origin, direction).distance, axis + 1, 1e-12);
    }
}

TEST(RayCaster, AGeometryWithoutTrianglesIsNeverHit) {
  const auto nothing = build_geometry({}).value();
  EXPECT_FALSE(RayCaster(*nothing).first_hit({0, 0, 0}, {0, 0, 1}).hit());
  EXPECT_FALSE(crosses(*nothing, {0, 0, 0}, {0, 0, 1}));
}

TEST(Crossing, IsWhereTheFirstHitOfBruteForceLiesOnTheLine) {
  CounterRandom random(2, 0, RandomPurpose::kTest);
  const glm::vec3 middle(30, -20, 10);
  const auto geometry = build_geometry(heap(random, 900, middle)).value();
  int crossing = 0, short_of_it = 0;
  for (int i = 0; i < 4000; ++i) {
    const auto any = [&](double size) {
      return glm::dvec3(random.next_in(-size, size), random.next_in(-size, size), random.next_in(-size, size));
    };
    const glm::dvec3 from = glm::dvec3(middle) + any(5.0), to = glm::dvec3(middle) + any(2.0);
    const Brute first = brute_first_hit(*geometry, from, to - from);
    if (first.edge < 1e-9) continue;
    ASSERT_EQ(crosses(*geometry, from, to), first.distance < 1) << i;
    if (first.distance == std::numeric_limits<double>::infinity()) continue;
    ++(first.distance < 1 ? crossing : short_of_it);
    const glm::dvec3 hit = from + first.distance * (to - from);
    ASSERT_FALSE(crosses(*geometry, from, hit)) << "a line that ends on the surface does not cross it: " << i;
    ASSERT_TRUE(crosses(*geometry, from, hit + 1e-3 * (to - from))) << i;
  }
  EXPECT_GT(crossing, 300);
  EXPECT_GT(short_of_it, 100);
}

// Two boxes with a whole face in common: the ray leaves one and enters the other at the same distance.
TEST(Crossings, AreAllFoundInOrderWithTheSideThatTheRayMeets) {
  MeshData mesh = tessellate(BoxShape{{1, 1, 1}}).value();
  const MeshData box = mesh;
  for (const glm::vec3& p : box.positions) mesh.positions.push_back(p + glm::vec3(0, 0, -2));
  for (const uint32_t index : box.indices) mesh.indices.push_back(static_cast<uint32_t>(box.positions.size()) + index);
  mesh.see_through_first_index = static_cast<uint32_t>(box.indices.size());
  const auto geometry = build_geometry(mesh).value();
  std::vector<Crossing> crossings = all_crossings(*geometry, {0.3, 0.2, 5}, {0, 0, -1});
  ASSERT_EQ(crossings.size(), 4u);
  EXPECT_NEAR(crossings[0].distance, 4, 1e-9);
  EXPECT_FALSE(crossings[0].from_back);
  EXPECT_NEAR(crossings[1].distance, 6, 1e-9);
  EXPECT_NEAR(crossings[2].distance, 6, 1e-9);
  EXPECT_NE(crossings[1].from_back, crossings[2].from_back);
  EXPECT_NEAR(crossings[3].distance, 8, 1e-9);
  EXPECT_TRUE(crossings[3].from_back);
  EXPECT_EQ(all_crossings(*geometry, {0.3, 0.2, 0}, {0, 0, 1}).size(), 1u) << "what lies behind the origin";
}

}  // namespace
}  // namespace sightline
