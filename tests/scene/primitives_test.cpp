#include "server/scene/primitives.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>

#include "server/base/random.h"

namespace sightline {
namespace {

constexpr double kPi = std::numbers::pi;

struct Case {
  const char* name;
  Shape shape;
  double volume_m3;  // analytic
  double radius_m;   // of the round part; 0 for a box
};

std::vector<Case> cases() {
  const auto ball = [](double r) { return 4.0 / 3.0 * kPi * r * r * r; };
  return {{"box", BoxShape{{0.5f, 1.0f, 2.0f}}, 8 * 0.5 * 1.0 * 2.0, 0},
          {"unit sphere", SphereShape{1.0f}, ball(1), 1},
          {"small sphere", SphereShape{1e-4f}, ball(1e-4), 1e-4},
          {"capsule", CapsuleShape{0.3f, 0.6f}, ball(0.3) + kPi * 0.3 * 0.3 * 1.2, 0.3},
          {"capsule without a middle", CapsuleShape{0.3f, 0.0f}, ball(0.3), 0.3},
          {"flat cylinder", CylinderShape{2.0f, 0.1f}, kPi * 4 * 0.2, 2},
          {"tall cylinder", CylinderShape{0.1f, 50.0f}, kPi * 0.01 * 100, 0.1}};
}

// Signed distance from the true surface, negative inside.
double distance_from(const BoxShape& s, const glm::dvec3& p) {
  const glm::dvec3 q = glm::abs(p) - glm::dvec3(s.half_extent_m);
  return glm::length(glm::max(q, glm::dvec3(0))) + std::min(0.0, std::max({q.x, q.y, q.z}));
}
double distance_from(const SphereShape& s, const glm::dvec3& p) {
  return glm::length(p) - s.radius_m;
}
double distance_from(const CapsuleShape& s, const glm::dvec3& p) {
  const double h = s.half_height_m;
  return glm::length(p - glm::dvec3(0, std::clamp(p.y, -h, h), 0)) - s.radius_m;
}
double distance_from(const CylinderShape& s, const glm::dvec3& p) {
  const double side = std::hypot(p.x, p.z) - s.radius_m, cap = std::abs(p.y) - s.half_height_m;
  return std::hypot(std::max(side, 0.0), std::max(cap, 0.0)) + std::min(0.0, std::max(side, cap));
}
double distance_from(const Shape& shape, const glm::dvec3& p) {
  return std::visit([&](const auto& s) { return distance_from(s, p); }, shape);
}

glm::dvec3 corner(const MeshData& mesh, size_t i) {
  return mesh.positions[mesh.indices[i]];
}

TEST(Primitives, EveryVertexLiesOnTheTrueSurface) {
  for (const Case& c : cases()) {
    const MeshData mesh = tessellate(c.shape).value();
    for (const glm::vec3& p : mesh.positions)
      EXPECT_NEAR(distance_from(c.shape, p), 0.0, 1e-6 * glm::length(p)) << c.name;
  }
}

TEST(Primitives, SurfacesAreClosedAndConsistentlyWound) {
  for (const Case& c : cases()) {
    const MeshData mesh = tessellate(c.shape).value();
    std::map<std::pair<uint32_t, uint32_t>, int> edges;  // each directed edge once, its reverse once
    for (size_t i = 0; i < mesh.indices.size(); ++i)
      ++edges[{mesh.indices[i], mesh.indices[i % 3 == 2 ? i - 2 : i + 1]}];
    for (const auto& [edge, count] : edges) {
      EXPECT_EQ(count, 1) << c.name;
      EXPECT_EQ(edges.count({edge.second, edge.first}), 1u) << c.name;
    }
  }
}

TEST(Primitives, TrianglesFaceOutwardAndEncloseTheAnalyticVolume) {
  for (const Case& c : cases()) {
    const MeshData mesh = tessellate(c.shape).value();
    double volume = 0;
    for (size_t i = 0; i < mesh.indices.size(); i += 3) {
      const double part = glm::dot(corner(mesh, i), glm::cross(corner(mesh, i + 1), corner(mesh, i + 2))) / 6;
      EXPECT_GT(part, 0) << c.name;  // all shapes are convex about the origin
      volume += part;
    }
    EXPECT_LT(volume, c.volume_m3 * (1 + 1e-6)) << c.name;
    EXPECT_GT(volume, c.volume_m3 * (c.radius_m > 0 ? 0.98 : 1 - 1e-6)) << c.name;
  }
}

TEST(Primitives, FacetsStayWithinOnePercentOfTheRadius) {
  CounterRandom random(1, 0, RandomPurpose::kTest);
  for (const Case& c : cases()) {
    const MeshData mesh = tessellate(c.shape).value();
    double deepest = 0;
    for (size_t i = 0; i < mesh.indices.size(); i += 3)
      for (int k = 0; k < 200; ++k) {
        // Edges too: their middles are the deepest points.
        double u = k < 20 ? 0.5 : random.next_unit(), v = k < 20 ? 0.025 * k : random.next_unit();
        if (u + v > 1) u = 1 - u, v = 1 - v;
        const glm::dvec3 p = (1 - u - v) * corner(mesh, i) + u * corner(mesh, i + 1) + v * corner(mesh, i + 2);
        EXPECT_LT(distance_from(c.shape, p), 1e-6 * glm::length(p)) << c.name;  // inscribed
        deepest = std::max(deepest, -distance_from(c.shape, p));
      }
    EXPECT_LT(deepest, c.radius_m > 0 ? 0.01 * c.radius_m : 1e-6) << c.name;
  }
}

TEST(Primitives, NoTriangleIsDegenerate) {
  for (const Case& c : cases()) {
    const MeshData mesh = tessellate(c.shape).value();
    EXPECT_EQ(build_geometry(mesh).value()->triangle_count(), mesh.indices.size() / 3) << c.name;
  }
}

TEST(Primitives, LongAxisIsY) {
  for (const Shape& shape : {Shape(CapsuleShape{0.5f, 2.0f}), Shape(CylinderShape{0.5f, 2.5f})}) {
    const Aabb bounds = build_geometry(tessellate(shape).value()).value()->bounds;
    EXPECT_FLOAT_EQ(bounds.max.y, 2.5f);
    EXPECT_FLOAT_EQ(bounds.min.y, -2.5f);
    EXPECT_FLOAT_EQ(bounds.max.x, 0.5f);
    EXPECT_FLOAT_EQ(bounds.min.z, -0.5f);
  }
}

TEST(Primitives, SizesOutsideTheRangeAreRefusedByName) {
  for (const float bad : {0.0f, -1.0f, 0.9e-4f, 1.1e5f, INFINITY, NAN}) {
    const auto expect = [&](const Shape& shape, const char* field) {
      const auto result = tessellate(shape);
      ASSERT_FALSE(result) << field << ' ' << bad;
      EXPECT_EQ(result.error().code, ErrorCode::kInvalidArgument);
      EXPECT_EQ(result.error().field, field);
    };
    expect(BoxShape{{1, bad, 1}}, "half_extent_m");
    expect(SphereShape{bad}, "radius_m");
    expect(CapsuleShape{bad, 1}, "radius_m");
    expect(CylinderShape{bad, 1}, "radius_m");
    expect(CylinderShape{1, bad}, "half_height_m");
    if (bad != 0.0f) expect(CapsuleShape{1, bad}, "half_height_m");
  }
}

TEST(Primitives, ABodyIsTheShapesAtTheirPlaces) {
  const glm::dquat quarter = glm::angleAxis(kPi / 2, glm::dvec3(0, 0, 1));
  const PlacedShape parts[] = {{BoxShape{{1, 2, 3}}, {{10, 0, 0}, {1, 0, 0, 0}}},
                               {CapsuleShape{0.5f, 1.0f}, {{0, 5, 0}, quarter}}};
  const MeshData box = tessellate(parts[0].shape).value(), capsule = tessellate(parts[1].shape).value();
  const MeshData body = tessellate(parts).value();
  ASSERT_EQ(body.indices.size(), box.indices.size() + capsule.indices.size());
  for (size_t i = 0; i < body.indices.size(); ++i) {
    const bool of_box = i < box.indices.size();
    const PlacedShape& part = parts[of_box ? 0 : 1];
    const glm::dvec3 own = of_box ? corner(box, i) : corner(capsule, i - box.indices.size());
    EXPECT_LT(glm::distance(corner(body, i), part.body_from_shape.position_m + part.body_from_shape.rotation * own),
              1e-5);
  }
  const PlacedShape wrong[] = {parts[0], {SphereShape{-1}, {}}};
  EXPECT_EQ(tessellate(wrong).error().field, "[1].radius_m");
}

}  // namespace
}  // namespace sightline
