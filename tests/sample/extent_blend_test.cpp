// Views around a viewer, one of which is drawn for each map (ExtentTable::points_blended).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <span>

#include "server/base/random.h"
#include "server/sample/extent.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

using GeometryPtr = std::shared_ptr<const Geometry>;

GeometryPtr shape(const Shape& shape) {
  return build_geometry(tessellate(shape).value()).value();
}

ExtentView random_view(CounterRandom& random, double distance) {
  const double y = random.next_in(-1, 1), angle = random.next_in(0, 6.283185307179586), around = std::sqrt(1 - y * y);
  return {{around * std::cos(angle), y, around * std::sin(angle)}, distance};
}

// Every viewer sees equal parts of a round body to the left and right of its axis. A single view of the table does not
// show this, but blended views do on average.
TEST(Extent, BlendedViewsAreNotTurned) {
  const GeometryPtr body = shape(CapsuleShape{0.3f, 0.6f});
  const auto table = ExtentTable::build(*body);
  CounterRandom random(62, 0, RandomPurpose::kTest);
  double turned = 0.0, blended = 0.0;
  constexpr int kViewers = 40, kDraws = 200;
  for (int i = 0; i < kViewers; ++i) {
    ExtentView viewer = random_view(random, 10.0);
    viewer.direction = glm::normalize(glm::dvec3(viewer.direction.x, 0.2, viewer.direction.z));
    const glm::dvec3 at = glm::dvec3(body->center) + viewer.direction * (viewer.distance * body->radius_m);
    const glm::dvec3 right = glm::normalize(glm::cross(glm::dvec3(0, 1, 0), viewer.direction));
    const auto share_left = [&](std::span<const glm::vec3> points) {
      return static_cast<double>(std::count_if(
                 points.begin(), points.end(),
                 [&](const glm::vec3& p) { return glm::dot(glm::dvec3(p) - glm::dvec3(body->center), right) < 0; })) /
             static_cast<double>(points.size());
    };
    double mean = 0.0;
    for (int draw = 0; draw < kDraws; ++draw) {
      const double x = random.next_unit(), y = random.next_unit();
      mean += share_left(table->points_blended(at, {x, y})) / kDraws;
    }
    turned += std::abs(share_left(table->points(at)) - 0.5) / kViewers;
    blended += std::abs(mean - 0.5) / kViewers;
  }
  EXPECT_GT(turned, 0.04);
  EXPECT_LT(blended, 0.025);
  const glm::dvec3 middle(body->center);
  EXPECT_EQ(table->points_blended(middle, {0.5, 0.5}).data(), table->points(middle).data());
}

// The places from which a blended viewer looks fill a disc evenly, across its line of sight. The disc is as large as
// the part of the sphere that one direction has. So a view is chosen as often as the disc lies nearest to it.
TEST(Extent, BlendedViewsAreChosenInProportionToTheirNearness) {
  const GeometryPtr body = shape(CapsuleShape{0.3f, 0.6f});
  const auto table = ExtentTable::build(*body);
  const double cosine = 1.0 - 2.0 / kExtentDirections, tangent = std::tan(std::acos(cosine));
  CounterRandom random(63, 0, RandomPurpose::kTest);
  for (int i = 0; i < 8; ++i) {
    const ExtentView viewer = random_view(random, 10.0);
    const glm::dvec3 along = viewer.direction * (viewer.distance * body->radius_m),
                     at = glm::dvec3(body->center) + along;
    const glm::dvec3 right = glm::normalize(glm::cross(glm::dvec3(0.3, 1, 0.2), viewer.direction)),
                     up = glm::cross(viewer.direction, right);
    constexpr int kDraws = 10'000;
    std::map<const glm::vec3*, double> more;  // by view: the share of draws above what the disc says
    for (int draw = 0; draw < kDraws; ++draw) {
      const double x = random.next_unit(), y = random.next_unit();
      more[table->points_blended(at, {x, y}).data()] += 1.0 / kDraws;
      glm::dvec2 place(1, 1);
      while (glm::length(place) > 1) place = {random.next_in(-1, 1), random.next_in(-1, 1)};
      place *= tangent * glm::length(along);
      more[table->points(at + place.x * right + place.y * up).data()] -= 1.0 / kDraws;
    }
    double differing = 0.0;
    for (const auto& [view, share] : more) differing += std::abs(share) / 2;
    EXPECT_GT(more.size(), 2u);
    EXPECT_LT(differing, 0.04) << "of the draws choose another view";
  }
}

}  // namespace
}  // namespace sightline
