// The sample table against brute force over every triangle, in double, by a projection that shares no code with the
// table's.
#include "server/sample/extent.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>
#include <thread>

#include "server/scene/clearance.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

using GeometryPtr = std::shared_ptr<const Geometry>;

WorkLimit::Part endless(nullptr);

GeometryPtr shape(const Shape& shape) {
  return build_geometry(tessellate(shape).value()).value();
}

void append(MeshData& mesh, const Shape& shape, const glm::quat& rotation, const glm::vec3& place) {
  const MeshData part = tessellate(shape).value();
  const auto first = static_cast<uint32_t>(mesh.positions.size());
  for (const glm::vec3& p : part.positions) mesh.positions.push_back(rotation * p + place);
  for (const uint32_t i : part.indices) mesh.indices.push_back(first + i);
}

// A body, two arms held up and two legs: capsules that hide one another.
MeshData figure_mesh() {
  MeshData mesh;
  const auto tilt = [](float angle) { return glm::angleAxis(angle, glm::vec3(0, 0, 1)); };
  append(mesh, CapsuleShape{0.22f, 0.3f}, tilt(0), {0, 1.2f, 0});
  append(mesh, CapsuleShape{0.07f, 0.3f}, tilt(0.7f), {-0.4f, 1.6f, 0});
  append(mesh, CapsuleShape{0.07f, 0.3f}, tilt(-0.7f), {0.4f, 1.6f, 0.1f});
  append(mesh, CapsuleShape{0.09f, 0.35f}, tilt(0), {-0.14f, 0.44f, 0});
  append(mesh, CapsuleShape{0.09f, 0.35f}, tilt(0), {0.14f, 0.44f, 0});
  return mesh;
}

// A shape that is not convex, lies far from its frame's origin, and is half see-through.
MeshData torus_mesh() {
  constexpr uint32_t kAround = 40, kAcross = 16;
  MeshData mesh;
  for (uint32_t i = 0; i < kAround; ++i)
    for (uint32_t j = 0; j < kAcross; ++j) {
      const float a = 6.2831853f * static_cast<float>(i) / kAround, b = 6.2831853f * static_cast<float>(j) / kAcross;
      const float out = 2.0f + 0.6f * std::cos(b);
      mesh.positions.push_back({100 + out * std::cos(a), -50 + 0.6f * std::sin(b), 30 + out * std::sin(a)});
    }
  const auto at = [](uint32_t i, uint32_t j) { return i % kAround * kAcross + j % kAcross; };
  for (uint32_t i = 0; i < kAround; ++i)
    for (uint32_t j = 0; j < kAcross; ++j)
      mesh.indices.insert(mesh.indices.end(), {at(i, j), at(i, j + 1), at(i + 1, j),  //
                                               at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)});
  mesh.see_through_first_index = static_cast<uint32_t>(mesh.indices.size() / 6 * 3);
  return mesh;
}

struct NamedShape {
  const char* name;
  GeometryPtr geometry;
};

const std::vector<NamedShape>& shapes() {
  static const std::vector<NamedShape> all = {{"box", shape(BoxShape{{0.3f, 1.0f, 0.6f}})},
                                              {"sphere", shape(SphereShape{0.7f})},
                                              {"capsule", shape(CapsuleShape{0.35f, 0.55f})},
                                              {"figure", build_geometry(figure_mesh()).value()},
                                              {"torus", build_geometry(torus_mesh()).value()}};
  return all;
}

struct Triangle {
  glm::dvec3 a, b, c;
};

std::vector<Triangle> triangles_of(const Geometry& geometry) {
  std::vector<Triangle> triangles;
  const auto corner = [&](size_t i) { return glm::dvec3(geometry.positions[geometry.indices[i]]); };
  for (size_t i = 0; i < geometry.indices.size(); i += 3)
    triangles.push_back({corner(i), corner(i + 1), corner(i + 2)});
  return triangles;
}

double hit_distance(const Triangle& triangle, const glm::dvec3& origin, const glm::dvec3& direction) {
  const glm::dvec3 ab = triangle.b - triangle.a, ac = triangle.c - triangle.a;
  const glm::dvec3 p = glm::cross(direction, ac);
  const double det = glm::dot(ab, p);
  if (det == 0.0) return kInfinity;
  const glm::dvec3 s = origin - triangle.a;
  const double u = glm::dot(s, p) / det;
  const glm::dvec3 q = glm::cross(s, ab);
  const double v = glm::dot(direction, q) / det;
  if (u < 0 || v < 0 || u + v > 1) return kInfinity;
  const double t = glm::dot(ac, q) / det;
  return t > 0 ? t : kInfinity;
}

double brute_first_hit(const std::vector<Triangle>& triangles, const glm::dvec3& origin, const glm::dvec3& direction) {
  double nearest = kInfinity;
  for (const Triangle& t : triangles) nearest = std::min(nearest, hit_distance(t, origin, direction));
  return nearest;
}

double brute_distance(const std::vector<Triangle>& triangles, const glm::dvec3& p) {
  double nearest = kInfinity;
  for (const Triangle& t : triangles)
    nearest = std::min(nearest, glm::distance(p, closest_on_triangle(p, t.a, t.b, t.c)));
  return nearest;
}

// The test's own picture: axes turned at random about the view direction, coordinates in [-1, 1] in units of the frame
// that just holds the bounding sphere.
struct TestCamera {
  glm::dvec3 center, direction, right, up;
  double radius, distance;

  TestCamera(const Geometry& geometry, const ExtentView& view, CounterRandom& random)
      : center(geometry.center), direction(view.direction), radius(geometry.radius_m), distance(view.distance) {
    const glm::dvec3 any(random.next_in(-1, 1), random.next_in(-1, 1), random.next_in(-1, 1));
    right = glm::normalize(glm::cross(direction, any));
    up = glm::cross(direction, right);
  }
  bool parallel() const { return std::isinf(distance); }
  double edge() const { return parallel() ? 1.0 : 1.0 / std::sqrt(distance * distance - 1.0); }
  glm::dvec2 project(const glm::dvec3& p) const {
    const glm::dvec3 rel = (p - center) / radius;
    const double depth = parallel() ? 1.0 : distance - glm::dot(rel, direction);
    return glm::dvec2(glm::dot(rel, right), glm::dot(rel, up)) / (depth * edge());
  }
  // The viewer's eye for mesh point p; under a parallel projection each point has its own.
  glm::dvec3 eye_for(const glm::dvec3& p) const {
    return parallel() ? p + direction * (4.0 * radius) : center + direction * (distance * radius);
  }
};

ExtentView random_view(CounterRandom& random, double distance) {
  const double y = random.next_in(-1, 1), angle = random.next_in(0, 6.283185307179586), around = std::sqrt(1 - y * y);
  return {{around * std::cos(angle), y, around * std::sin(angle)}, distance};
}

// Marks the pixels of a picture that the shape covers, by drawing every triangle's projection.
class Coverage {
 public:
  static constexpr int kSide = 384;

  Coverage(const std::vector<Triangle>& triangles, const TestCamera& camera) : covered_(kSide * kSide, false) {
    for (const Triangle& t : triangles) draw({camera.project(t.a), camera.project(t.b), camera.project(t.c)});
  }
  bool at(int x, int y) const { return covered_[static_cast<size_t>(y * kSide + x)]; }
  static glm::dvec2 middle(int x, int y) { return (glm::dvec2(x, y) + 0.5) * (2.0 / kSide) - 1.0; }
  static int pixel(double coordinate) {
    return std::clamp(static_cast<int>(std::floor((coordinate + 1.0) * kSide / 2.0)), 0, kSide - 1);
  }
  // The share of the whole frame that is covered.
  double share() const {
    return static_cast<double>(std::count(covered_.begin(), covered_.end(), true)) / (kSide * kSide);
  }

 private:
  static double side(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& p) {
    return (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
  }
  void draw(const std::array<glm::dvec2, 3>& t) {
    const glm::dvec2 low = glm::min(t[0], glm::min(t[1], t[2])), high = glm::max(t[0], glm::max(t[1], t[2]));
    for (int y = pixel(low.y); y <= pixel(high.y); ++y)
      for (int x = pixel(low.x); x <= pixel(high.x); ++x) {
        const glm::dvec2 p = middle(x, y);
        const double a = side(t[0], t[1], p), b = side(t[1], t[2], p), c = side(t[2], t[0], p);
        if ((a >= 0 && b >= 0 && c >= 0) || (a <= 0 && b <= 0 && c <= 0))
          covered_[static_cast<size_t>(y * kSide + x)] = true;
      }
  }
  std::vector<bool> covered_;
};

struct ChiSquare {
  double statistic = 0.0;
  int freedom = -1;
  // The value of chi-square that a correct sampler exceeds once in 10,000 times (Wilson & Hilferty, 1931).
  double critical() const {
    const double v = 2.0 / (9.0 * freedom);
    return freedom * std::pow(1.0 - v + 3.719 * std::sqrt(v), 3.0);
  }
  bool passes() const { return statistic < critical(); }
};

// Compares the counts of independent image points in square cells with the covered area of each cell. Cells that expect
// fewer than 10 points are pooled.
ChiSquare uniformity(const Coverage& coverage, const std::vector<glm::dvec2>& points) {
  constexpr int kCells = 16, kPixels = Coverage::kSide / kCells;
  std::array<double, kCells * kCells> expected{}, got{};
  for (int y = 0; y < Coverage::kSide; ++y)
    for (int x = 0; x < Coverage::kSide; ++x)
      if (coverage.at(x, y)) ++expected[static_cast<size_t>(y / kPixels * kCells + x / kPixels)];
  const double points_a_pixel = static_cast<double>(points.size()) /
                                (coverage.share() * Coverage::kSide * Coverage::kSide);
  for (const glm::dvec2& p : points)
    ++got[static_cast<size_t>(Coverage::pixel(p.y) / kPixels * kCells + Coverage::pixel(p.x) / kPixels)];
  ChiSquare result;
  double few_expected = 0.0, few_got = 0.0;
  const auto add = [&](double want, double have) {
    result.statistic += (have - want) * (have - want) / want;
    ++result.freedom;
  };
  for (size_t i = 0; i < expected.size(); ++i) {
    const double want = expected[i] * points_a_pixel;
    if (want >= 10)
      add(want, got[i]);
    else
      few_expected += want, few_got += got[i];
  }
  if (few_expected >= 10) add(few_expected, few_got);
  return result;
}

// Takes one point for each seed, the (seed modulo `among`)th, so that the points are independent.
std::vector<glm::dvec2> one_point_a_seed(const RayCaster& caster, const ExtentView& view, const TestCamera& camera,
                                         size_t seeds, size_t among = kExtentPoints) {
  std::vector<glm::dvec2> image;
  std::array<glm::vec3, kExtentPoints> points;
  for (size_t seed = 0; seed < seeds; ++seed) {
    CounterRandom random(seed, 5, RandomPurpose::kExtentPoints);
    const size_t chosen = seed % among;
    sample_extent(caster, view, random, std::span(points).first(chosen + 1), endless);
    image.push_back(camera.project(points[chosen]));
  }
  return image;
}

// A sampler that is wrong on purpose: uniform over the visible surface instead of the picture.
std::vector<glm::dvec2> even_over_surface(const std::vector<Triangle>& triangles, const TestCamera& camera,
                                          CounterRandom& random, size_t count) {
  std::vector<double> area_up_to;
  double area = 0.0;
  for (const Triangle& t : triangles) area_up_to.push_back(area += glm::length(glm::cross(t.b - t.a, t.c - t.a)));
  std::vector<glm::dvec2> image;
  while (image.size() < count) {
    const auto at = std::ranges::upper_bound(area_up_to, random.next_in(0, area));
    const Triangle& t = triangles[static_cast<size_t>(at - area_up_to.begin())];
    double u = random.next_in(0, 1), v = random.next_in(0, 1);
    if (u + v > 1) u = 1 - u, v = 1 - v;
    const glm::dvec3 p = t.a + (t.b - t.a) * u + (t.c - t.a) * v, eye = camera.eye_for(p);
    if (brute_first_hit(triangles, eye, p - eye) > 1 - 1e-6) image.push_back(camera.project(p));
  }
  return image;
}

double distance_to_nearest(const glm::dvec2& p, const std::vector<glm::dvec2>& points) {
  double nearest = kInfinity;
  for (const glm::dvec2& q : points) nearest = std::min(nearest, glm::distance(p, q));
  return nearest;
}

// The greatest distance from a covered pixel to the nearest point, in units of the mean spacing
// sqrt(covered area / number of points).
double dispersion(const Coverage& coverage, const std::vector<glm::dvec2>& points) {
  double worst = 0.0;
  for (int y = 0; y < Coverage::kSide; y += 3)
    for (int x = 0; x < Coverage::kSide; x += 3)
      if (coverage.at(x, y)) worst = std::max(worst, distance_to_nearest(Coverage::middle(x, y), points));
  return worst / std::sqrt(4.0 * coverage.share() / static_cast<double>(points.size()));
}

std::vector<glm::dvec2> projected(const TestCamera& camera, std::span<const glm::vec3> points) {
  std::vector<glm::dvec2> image;
  for (const glm::vec3& p : points) image.push_back(camera.project(p));
  return image;
}

TEST(Extent, PointsLieOnTheSurfaceAndAreSeenFromTheirViewpoint) {
  for (const auto& [name, geometry] : shapes()) {
    const auto table = ExtentTable::build(*geometry);
    const auto triangles = triangles_of(*geometry);
    CounterRandom random(1, 0, RandomPurpose::kTest);
    for (size_t view = 0; view < kExtentViews; view += 7) {
      const TestCamera camera(*geometry, ExtentTable::view(view), random);
      for (size_t i = 0; i < kExtentPoints; i += 5) {
        const glm::dvec3 p = table->points_of_view(view)[i], eye = camera.eye_for(p);
        // The rounding of a float at the mesh's position in its frame.
        const double grain = 1e-6 * (geometry->radius_m + glm::length(p));
        EXPECT_LT(brute_distance(triangles, p), grain) << name << " view " << view << " point " << i;
        const double seen = brute_first_hit(triangles, eye, p - eye);
        EXPECT_GT(seen, 1 - 1e-3) << name << " view " << view << " point " << i;
      }
    }
  }
}

TEST(Extent, EachPointIsUniformInThePicture) {
  for (const auto& [name, geometry] : shapes()) {
    const RayCaster caster(*geometry);
    const auto triangles = triangles_of(*geometry);
    CounterRandom random(2, 0, RandomPurpose::kTest);
    for (const double distance : {1.3, 3.0, 8.0, kInfinity}) {
      const ExtentView view = random_view(random, distance);
      const TestCamera camera(*geometry, view, random);
      const ChiSquare chi = uniformity(Coverage(triangles, camera), one_point_a_seed(caster, view, camera, 6000));
      EXPECT_GT(chi.freedom, 20) << name;
      EXPECT_TRUE(chi.passes()) << name << " from " << distance << " radii: " << chi.statistic << " with "
                                << chi.freedom << " degrees of freedom, critical " << chi.critical();
    }
  }
}

// When a sequence starts at a random position, on the shape or beside it, its first hits favour the parts to which it
// seldom returns.
TEST(Extent, TheFirstPointsAreAsUniformAsTheLast) {
  for (const auto& [name, geometry] : shapes()) {
    const RayCaster caster(*geometry);
    CounterRandom random(8, 0, RandomPurpose::kTest);
    const ExtentView view = random_view(random, 3.0);
    const TestCamera camera(*geometry, view, random);
    const Coverage coverage(triangles_of(*geometry), camera);
    const ChiSquare chi = uniformity(coverage, one_point_a_seed(caster, view, camera, 6000, 2));
    EXPECT_TRUE(chi.passes()) << name << ": " << chi.statistic << " of " << chi.critical();
  }
}

TEST(Extent, ATablesPointsTogetherAreUniformInThePicture) {
  const GeometryPtr& geometry = shapes()[3].geometry;
  const auto triangles = triangles_of(*geometry);
  constexpr std::array<size_t, 4> kViews = {5, 130, 250, 383};
  std::array<std::vector<glm::vec3>, kViews.size()> pooled;
  for (uint64_t seed = 0; seed < 24; ++seed) {
    const auto table = ExtentTable::build(*geometry, seed);
    for (size_t i = 0; i < kViews.size(); ++i)
      std::ranges::copy(table->points_of_view(kViews[i]), std::back_inserter(pooled[i]));
  }
  CounterRandom random(3, 0, RandomPurpose::kTest);
  for (size_t i = 0; i < kViews.size(); ++i) {
    const TestCamera camera(*geometry, ExtentTable::view(kViews[i]), random);
    const ChiSquare chi = uniformity(Coverage(triangles, camera), projected(camera, pooled[i]));
    // Points of one table keep apart, which only lowers the statistic.
    EXPECT_TRUE(chi.passes()) << "view " << kViews[i] << ": " << chi.statistic << " of " << chi.critical();
  }
}

TEST(Extent, TheUniformityTestRefusesASamplerThatIsEvenOverTheSurface) {
  for (const auto& [name, geometry] : shapes()) {
    if (std::string_view(name) == "box") continue;  // flat sides: the two densities differ by little
    const auto triangles = triangles_of(*geometry);
    CounterRandom random(4, 0, RandomPurpose::kTest);
    const TestCamera camera(*geometry, random_view(random, 3.0), random);
    const ChiSquare chi = uniformity(Coverage(triangles, camera), even_over_surface(triangles, camera, random, 4000));
    EXPECT_FALSE(chi.passes()) << name << ": " << chi.statistic << " of " << chi.critical();
  }
}

// By formulas: a ball whose outline is seen under an angle, and the sides of a box across a direction.
TEST(Extent, TheAreaOfAViewIsThatOfTheShapesImage) {
  constexpr float kRadius = 0.4f;
  const glm::dvec3 half(0.5, 0.1, 1.2);
  const auto ball = ExtentTable::build(*build_geometry(tessellate(SphereShape{kRadius}).value()).value());
  const auto box = ExtentTable::build(*build_geometry(tessellate(BoxShape{glm::vec3(half)}).value()).value());
  double of_ball = 0, of_box = 0;
  size_t boxes = 0;
  for (size_t view = 0; view < kExtentViews; ++view) {
    const double d = ExtentTable::view(view).distance;
    const double outline = std::numbers::pi * kRadius * kRadius * (d == kInfinity ? 1.0 : d * d / (d * d - 1));
    const double error = std::abs(ball->area_of_view_m2(view) / outline - 1);
    EXPECT_LT(error, 0.3);
    of_ball += error / kExtentViews;
    if (d != kInfinity) continue;
    const glm::dvec3 n = glm::abs(ExtentTable::view(view).direction);
    const double sides = 4 * (half.y * half.z * n.x + half.z * half.x * n.y + half.x * half.y * n.z);
    of_box += std::abs(box->area_of_view_m2(view) / sides - 1), ++boxes;
  }
  EXPECT_LT(of_ball, 0.05);
  EXPECT_LT(of_box / static_cast<double>(boxes), 0.05);
}

TEST(Extent, NoPartOfThePictureIsFarFromAPoint) {
  constexpr double kBound = 1.75;
  double by_chance = 0.0;
  for (const auto& [name, geometry] : shapes()) {
    const auto table = ExtentTable::build(*geometry);
    const RayCaster caster(*geometry);
    const auto triangles = triangles_of(*geometry);
    CounterRandom random(5, 0, RandomPurpose::kTest);
    for (size_t index = 3; index < kExtentViews; index += 31) {
      const ExtentView view = ExtentTable::view(index);
      const TestCamera camera(*geometry, view, random);
      const Coverage coverage(triangles, camera);
      EXPECT_LT(dispersion(coverage, projected(camera, table->points_of_view(index))), kBound)
          << name << " view " << index;
      by_chance = std::max(by_chance, dispersion(coverage, one_point_a_seed(caster, view, camera, kExtentPoints)));
    }
  }
  EXPECT_GT(by_chance, kBound);  // independent points would not keep this bound
}

TEST(Extent, EightConsecutivePointsSpreadBetterThanRandomOnes) {
  for (const auto& [name, geometry] : shapes()) {
    const auto table = ExtentTable::build(*geometry);
    const auto triangles = triangles_of(*geometry);
    CounterRandom random(6, 0, RandomPurpose::kTest);
    double consecutive = 0.0, by_chance = 0.0;
    std::vector<glm::vec3> picked;
    for (size_t view = 0; view < kExtentViews; view += 29) {
      const TestCamera camera(*geometry, ExtentTable::view(view), random);
      const Coverage coverage(triangles, camera);
      const auto points = table->points_of_view(view);
      for (uint64_t tick = 0; tick < 8; ++tick) {
        pick_points(points, tick, 8, picked);
        consecutive += dispersion(coverage, projected(camera, picked));
        for (glm::vec3& p : picked) p = points[random.next_below(kExtentPoints)];
        by_chance += dispersion(coverage, projected(camera, picked));
      }
    }
    EXPECT_LT(consecutive, 0.85 * by_chance) << name;
  }
}

TEST(Extent, EveryViewerFindsAViewWithin15Degrees) {
  const auto table = ExtentTable::build(*shapes()[0].geometry);
  const Geometry& geometry = *shapes()[0].geometry;
  CounterRandom random(7, 0, RandomPurpose::kTest);
  double worst = 1.0;
  for (int i = 0; i < 5000; ++i) {
    const ExtentView viewer = random_view(random, random.next_in(0.01, 40.0));
    const size_t index = table->view_index(glm::dvec3(geometry.center) +
                                           viewer.direction * (viewer.distance * geometry.radius_m));
    const ExtentView view = ExtentTable::view(index);
    worst = std::min(worst, glm::dot(view.direction, viewer.direction));
    for (size_t other = 0; other < kExtentViews; ++other) {
      const ExtentView candidate = ExtentTable::view(other);
      ASSERT_LE(glm::dot(candidate.direction, viewer.direction), glm::dot(view.direction, viewer.direction) + 1e-9);
    }
    const double inverse = std::min(1.0, 1.0 / viewer.distance);
    for (const double distance : kExtentDistances)
      ASSERT_LE(std::abs(1 / view.distance - inverse), std::abs(1 / distance - inverse) + 1e-6);
  }
  EXPECT_GT(worst, std::cos(glm::radians(15.0)));
}

TEST(Extent, RoundRobinUsesEveryPointOnceARound) {
  const auto table = ExtentTable::build(*shapes()[2].geometry);
  const auto points = table->points({0, 0, 5});
  std::vector<glm::vec3> picked;
  for (const size_t count : {size_t{1}, size_t{8}, size_t{24}, kExtentPoints}) {
    const uint64_t ticks = (kExtentPoints + count - 1) / count;
    std::vector<int> used(kExtentPoints, 0);
    const uint64_t start = uint64_t{1} << 40;  // a long session gets this far
    for (uint64_t tick = start; tick < start + ticks; ++tick) {
      pick_points(points, tick, count, picked);
      ASSERT_EQ(picked.size(), count);
      for (const glm::vec3& p : picked) ++used[static_cast<size_t>(std::ranges::find(points, p) - points.begin())];
    }
    EXPECT_EQ(std::ranges::count(used, 0), 0) << count;
    if (kExtentPoints % count == 0) {
      EXPECT_EQ(std::ranges::count(used, 1), kExtentPoints) << count;
    }
  }
}

TEST(Extent, PickingIsSafeAtItsEnds) {
  std::vector<glm::vec3> picked(3);
  pick_points({}, 7, 8, picked);
  EXPECT_TRUE(picked.empty());
  const std::array<glm::vec3, 3> points = {glm::vec3(0), glm::vec3(1), glm::vec3(2)};
  pick_points(points, UINT64_MAX, 100, picked);
  EXPECT_EQ(picked.size(), 3);
  pick_points(points, 2, 2, picked);
  EXPECT_EQ(picked, (std::vector<glm::vec3>{glm::vec3(1), glm::vec3(2)}));
  pick_points(points, 1, 2, picked);
  EXPECT_EQ(picked, (std::vector<glm::vec3>{glm::vec3(2), glm::vec3(0)}));
}

std::vector<glm::vec3> all_points(const ExtentTable& table) {
  std::vector<glm::vec3> all;
  for (size_t view = 0; view < kExtentViews; ++view)
    std::ranges::copy(table.points_of_view(view), std::back_inserter(all));
  return all;
}

TEST(Extent, TheSameContentAndSeedGiveTheSameTable) {
  const auto once = all_points(*ExtentTable::build(*build_geometry(figure_mesh()).value(), 9));
  EXPECT_EQ(once, all_points(*ExtentTable::build(*build_geometry(figure_mesh()).value(), 9)));
  EXPECT_NE(once, all_points(*ExtentTable::build(*build_geometry(figure_mesh()).value(), 10)));
}

// A square in the plane z = 0. A viewer in that plane sees nothing of it.
MeshData square_mesh() {
  MeshData mesh;
  mesh.positions = {{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}};
  mesh.indices = {0, 1, 2, 0, 2, 3};
  return mesh;
}

TEST(Extent, AViewThatSeesNothingFallsBackToTheCentre) {
  const auto square = build_geometry(square_mesh()).value();
  std::array<glm::vec3, kExtentPoints> points;
  for (const double distance : {3.0, kInfinity}) {
    CounterRandom random(1, 0, RandomPurpose::kTest);
    sample_extent(RayCaster(*square), {{1, 0, 0}, distance}, random, points, endless);
    EXPECT_EQ(std::ranges::count(points, glm::vec3(1, 1, 0)), kExtentPoints);
    sample_extent(RayCaster(*square), {{0, 0, 1}, distance}, random, points, endless);
    EXPECT_LE(std::ranges::count(points, glm::vec3(1, 1, 0)), 1);
  }
}

TEST(Extent, AGeometryWithoutTrianglesHasItsCentreForEveryViewer) {
  const auto table = ExtentTable::build(*build_geometry({}).value());
  for (const glm::dvec3& viewer : {glm::dvec3(0.0), glm::dvec3(3, 1, 2)})
    EXPECT_EQ(std::ranges::count(table->points(viewer), glm::vec3(0.0f)), kExtentPoints);
}

TEST(Extent, AThinDiagonalRodHasAllItsPoints) {
  MeshData mesh;
  append(mesh, CylinderShape{0.01f, 1.0f}, glm::angleAxis(0.9f, glm::normalize(glm::vec3(1, 1, 1))), {5, 6, 7});
  const auto table = ExtentTable::build(*build_geometry(std::move(mesh)).value());
  for (size_t view = 0; view < kExtentViews; ++view) {
    const auto points = table->points_of_view(view);
    for (const glm::vec3& p : points) ASSERT_EQ(std::ranges::count(points, p), 1) << "view " << view;
  }
}

TEST(Extent, AViewerAtTheCentreOrFarAwayFindsPoints) {
  const auto& geometry = shapes()[4].geometry;
  const auto table = ExtentTable::build(*geometry);
  EXPECT_LT(table->view_index(glm::dvec3(geometry->center)), kExtentDirections);
  EXPECT_GE(table->view_index({1e12, 0, 0}), 3 * kExtentDirections);
}

TEST(ExtentCache, SharesOneTableAShapeAndFreesItWithTheShape) {
  ExtentCache cache;
  auto capsule = shape(CapsuleShape{}), twin = shape(CapsuleShape{});
  const auto sphere = shape(SphereShape{});
  std::weak_ptr<const ExtentTable> first = cache.get(capsule);
  EXPECT_EQ(first.lock(), cache.get(capsule));
  EXPECT_EQ(first.lock(), cache.get(twin));  // another geometry with equal triangles
  EXPECT_EQ(cache.count(), 1);

  capsule.reset();
  cache.get(sphere);
  EXPECT_FALSE(first.expired());  // the twin is still in use
  EXPECT_EQ(cache.count(), 2);

  twin.reset();
  cache.get(shape(BoxShape{}));
  EXPECT_TRUE(first.expired());
  EXPECT_EQ(cache.count(), 2);
}

TEST(ExtentCache, BuildsAShapeOnceForManyThreads) {
  ExtentCache cache;
  const auto capsule = shape(CapsuleShape{});
  std::array<std::shared_ptr<const ExtentTable>, 8> got;
  std::vector<std::thread> threads;
  for (auto& table : got) threads.emplace_back([&] { table = cache.get(capsule); });
  for (std::thread& thread : threads) thread.join();
  for (const auto& table : got) EXPECT_EQ(table, got[0]);
}

TEST(ExtentCache, ABuildThatHadToEndIsBegunAgainByWhoWaits) {
  ExtentCache cache;
  const auto capsule = shape(CapsuleShape{});
  std::atomic<bool> unwanted{false}, begun{false};
  WorkLimit given_up({}, [&] {
    begun = true;
    while (!unwanted) std::this_thread::yield();
    return true;
  });
  std::shared_ptr<const ExtentTable> first = ExtentTable::build(*capsule), second;
  std::thread builder([&] { first = cache.get(capsule, &given_up); });
  while (!begun) std::this_thread::yield();
  std::thread waiting([&] { second = cache.get(capsule); });
  EXPECT_FALSE(cache.has(*capsule));
  unwanted = true;
  builder.join(), waiting.join();
  EXPECT_EQ(first, nullptr);
  ASSERT_TRUE(second);
  EXPECT_EQ(cache.get(capsule), second);
}

TEST(ExtentCache, WhoWaitsForAnotherCanStopToo) {
  ExtentCache cache;
  const auto capsule = shape(CapsuleShape{});
  std::atomic<bool> go_on{false}, begun{false};
  WorkLimit slow({}, [&] {
    begun = true;
    while (!go_on) std::this_thread::yield();
    return false;
  });
  std::shared_ptr<const ExtentTable> first;
  std::thread builder([&] { first = cache.get(capsule, &slow); });
  while (!begun) std::this_thread::yield();
  WorkLimit gone({}, [] { return true; });
  EXPECT_EQ(cache.get(capsule, &gone), nullptr);
  go_on = true;
  builder.join();
  EXPECT_TRUE(first);
}

TEST(ExtentCache, ADeadShapeThatComesBackIsSharedAgain) {
  ExtentCache cache;
  const auto table = cache.get(shape(CapsuleShape{}));
  const auto again = shape(CapsuleShape{});
  EXPECT_EQ(cache.get(again), table);
  cache.get(shape(SphereShape{}));
  EXPECT_EQ(cache.get(again), table);
}

}  // namespace
}  // namespace sightline
