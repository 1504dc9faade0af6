#include "server/aggregate/compose.h"

#include <gtest/gtest.h>

#include "server/base/random.h"
#include "server/sample/embree_sampler.h"
#include "server/sample/plan.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

Bound ball(const glm::dvec3& center, double radius) {
  Bound bound;
  bound.center_m = center;
  bound.radius_m = radius;
  return bound;
}

glm::dvec3 random_vector(CounterRandom& random, double size) {
  return {random.next_in(-size, size), random.next_in(-size, size), random.next_in(-size, size)};
}

// Returns whether a straight line from eye to point crosses a box, by the slab method. It shares no code with the maps.
bool box_blocks(const glm::dvec3& eye, const glm::dvec3& point, const glm::dvec3& center, const glm::dvec3& half) {
  double enter = 0, leave = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const double d = point[axis] - eye[axis];
    double t0 = (center[axis] - half[axis] - eye[axis]) / d, t1 = (center[axis] + half[axis] - eye[axis]) / d;
    if (t0 > t1) std::swap(t0, t1);
    enter = std::max(enter, t0), leave = std::min(leave, t1);
  }
  return enter < leave;
}

// One point a target.
std::vector<MapRange> one_each(size_t targets) {
  std::vector<MapRange> points(targets);
  for (uint32_t i = 0; i < targets; ++i) points[i] = {i, 1};
  return points;
}

class ComposeManyTargets : public testing::TestWithParam<int> {};

// Candidates at texel centres are not quantised, so the maps must agree exactly with straight lines there.
TEST_P(ComposeManyTargets, AgreesWithStraightLinesAtTexelCentres) {
  const int n = GetParam();
  CounterRandom random(21, n, RandomPurpose::kTest);
  GeometryStore store;
  SceneMirror mirror;
  SceneDelta delta;
  std::vector<std::pair<glm::dvec3, glm::dvec3>> boxes;
  for (uint64_t id = 1; id <= 30; ++id) {
    const glm::vec3 half(random.next_in(0.1, 0.6), random.next_in(0.1, 0.6), random.next_in(0.1, 0.6));
    const glm::dvec3 at = random_vector(random, 3.0);
    boxes.emplace_back(at, half);
    delta.add.push_back({id, *store.intern(*tessellate(BoxShape{half})), Pose{at, {1, 0, 0, 0}}, glm::dmat3(1), {}});
  }
  ASSERT_TRUE(mirror.apply(delta, {}));
  const Bound bound = ball({0, 0, 6}, 1.5);
  std::vector<MapView> views;
  std::vector<MapRange> ranges;
  std::vector<glm::dvec3> eyes;
  for (int t = 0; t < n; ++t) {
    eyes.push_back(random_vector(random, 3.0) - glm::dvec3(0, 0, 4));
    const auto first = static_cast<uint32_t>(views.size());
    ranges.push_back({first, static_cast<uint32_t>(plan_views(eyes[t], bound, {}, {0.5, 0.5}, views))});
  }
  std::vector<MapRequest> requests;
  for (const MapView& view : views) requests.push_back({.view = view});
  const auto device = make_embree_sampler_device();
  std::vector<DepthMap> maps;
  ASSERT_TRUE(device->make_sampler()->take(mirror, requests, maps));
  int visible = 0, hidden = 0;
  Composer composer;
  for (int t = 0; t < n; ++t) {
    CandidateSet candidates;
    for (int y = 0; y < 7; ++y)
      for (int x = 0; x < 7; ++x)
        candidates.add(eyes[t] + glm::normalize(texel_direction(views[ranges[t].first], x, y)) * random.next_in(4, 12));
    const std::vector<MapRange> points = one_each(ranges.size());
    composer.set_positions(candidates.position_m);
    composer.visibility({maps, ranges, points}, 1e-5, candidates.visible_targets);
    for (size_t i = 0; i < candidates.size(); ++i) {
      bool blocked = false;
      for (const auto& [center, half] : boxes) blocked |= box_blocks(eyes[t], candidates.position_m[i], center, half);
      EXPECT_EQ((candidates.visible_targets[i] >> t & 1) == 0, blocked) << "target " << t << " candidate " << i;
      ++(blocked ? hidden : visible);
    }
  }
  EXPECT_GT(visible, 5);
  EXPECT_GT(hidden, 5);
}
INSTANTIATE_TEST_SUITE_P(Targets, ComposeManyTargets, testing::Values(1, 2, 3, 8, 32));

// One target has three points, and the candidate sees two of them.
TEST(Compose, ATargetIsSeenWhenEnoughOfItsPointsAre) {
  MapView view;
  view.width = view.height = 1;
  const std::vector<DepthMap> maps = {{view, {9.0f}, {0}}, {view, {9.0f}, {0}}, {view, {1.0f}, {0}}};
  const std::vector<MapRange> of_point = {{0, 1}, {1, 1}, {2, 1}}, of_target = {{0, 3}};
  const std::vector<glm::dvec3> places = {{0, 0, -5}};
  Composer composer;
  std::vector<uint32_t> visible;
  composer.set_positions(places);
  for (const auto& [needed, seen] :
       std::vector<std::pair<double, uint32_t>>{{0.0, 1}, {0.6, 1}, {2.0 / 3, 1}, {0.7, 0}, {1.0, 0}}) {
    composer.visibility({maps, of_point, of_target, needed}, 0.0, visible);
    EXPECT_EQ(visible[0], seen) << needed;
  }
  const std::vector<DepthMap> hidden = {{view, {1.0f}, {0}}};
  const std::vector<MapRange> alone = {{0, 1}};
  composer.visibility({hidden, alone, alone, 0.0}, 0.0, visible);
  EXPECT_EQ(visible[0], 0u) << "none seen is never enough";
}

TEST(Compose, EqualDistanceIsVisible) {
  MapView view;
  view.width = view.height = 1;
  const DepthMap map{view, {5.0f}, {3}};
  EXPECT_TRUE(look_up({&map, 1}, {0, 0, -5}, 0.0).visible);
  const Sight beyond = look_up({&map, 1}, {0, 0, -5.01}, 0.0);
  EXPECT_TRUE(beyond.known);
  EXPECT_FALSE(beyond.visible);
  EXPECT_EQ(beyond.occluder, 3u);
  EXPECT_TRUE(look_up({&map, 1}, {0, 0, -5.01}, 0.01).visible) << "the relative bias gives slack";
}

TEST(Compose, OutsideEveryWindowIsUnknownAndNotVisible) {
  MapView view;
  view.width = view.height = 1;
  const DepthMap map{view, {std::numeric_limits<float>::infinity()}, {kNoOccluder}};
  const Sight behind = look_up({&map, 1}, {0, 0, 5}, 0.0), aside = look_up({&map, 1}, {9, 0, -5}, 0.0);
  EXPECT_FALSE(behind.known || behind.visible);
  EXPECT_FALSE(aside.known || aside.visible);
}

TEST(Compose, CountsAreThePapersSetsForTheSteeredTargets) {
  CandidateSet candidates;
  for (int i = 0; i < 5; ++i) candidates.add({});
  candidates.filtered_targets = {0b00, 0b01, 0b10, 0b11, 0b111};
  SightCounts counts;
  count_sights(candidates, 0b011, 3, counts);
  EXPECT_EQ(counts.total, 5u);
  EXPECT_EQ(counts.none_visible, 1u);
  EXPECT_EQ(counts.some_visible, 2u);
  EXPECT_EQ(counts.all_visible, 2u);
  EXPECT_EQ(counts.visible_by_target, (std::vector<uint32_t>{3, 3, 1}));
}

}  // namespace
}  // namespace sightline
