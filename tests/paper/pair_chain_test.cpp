#include "server/paper/pair_chain.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "server/aggregate/compose.h"
#include "server/base/random.h"
#include "server/sample/embree_sampler.h"
#include "server/scene/primitives.h"
#include "tests/aggregate/random_ball.h"

namespace sightline {
namespace {

constexpr double kBias = 1e-5;
constexpr int kResolution = 7;
const glm::dvec2 kMiddle(0.5);

struct Layout {
  std::vector<glm::dvec3> points;
  Bound bound;
};

Layout random_layout(CounterRandom& random, size_t targets) {
  Layout layout;
  for (size_t i = 0; i < targets; ++i) layout.points.push_back(random_vector(random, 3.0));
  layout.bound = ball(glm::dvec3(0, 0, 7) + random_vector(random, 2.0), random.next_in(0.2, 1.2));
  return layout;
}

Layout random_chained(CounterRandom& random, size_t targets, PairChain& chain) {
  for (;;) {
    Layout layout = random_layout(random, targets);
    if (make_pair_chain(layout.points, layout.bound, kResolution, kMiddle, chain) == PairGap::kNone) return layout;
  }
}

// ---- which volumes ----

TEST(PairChain, FollowsTheListWhereItsPairsHaveVolumes) {
  const std::vector<glm::dvec3> points = {{-4, 0, 0}, {-1.5, 0, 0}, {1.5, 0, 0}, {4, 0, 0}};
  PairChain chain;
  ASSERT_EQ(make_pair_chain(points, ball({0, 0, 8}, 0.5), kResolution, kMiddle, chain), PairGap::kNone);
  ASSERT_EQ(chain.links.size(), 3u);
  for (uint32_t i = 0; i < 3; ++i) {
    EXPECT_EQ(chain.links[i].from, i);
    EXPECT_EQ(chain.links[i].to, i + 1);
  }
}

// B and C are at one place, so they form no pair. B and C both join A, then D joins C.
TEST(PairChain, ATargetAtItsNeighboursPlaceJoinsAnother) {
  const std::vector<glm::dvec3> points = {{-3, 0, 0}, {0, 0, 0}, {0, 0, 0}, {3, 0, 0}};
  PairChain chain;
  ASSERT_EQ(make_pair_chain(points, ball({0, 0, 8}, 0.5), kResolution, kMiddle, chain), PairGap::kNone);
  ASSERT_EQ(chain.links.size(), 3u);
  EXPECT_EQ(chain.links[1].from, 0u);
  EXPECT_EQ(chain.links[1].to, 2u);
  EXPECT_EQ(chain.links[2].from, 2u);
  EXPECT_EQ(chain.links[2].to, 3u);
}

TEST(PairChain, ATargetAtTheFirstOnesPlaceWaitsForOneThatBringsItIn) {
  const std::vector<glm::dvec3> points = {{0, 0, 0}, {0, 0, 0}, {3, 0, 0}};
  PairChain chain;
  ASSERT_EQ(make_pair_chain(points, ball({0, 0, 8}, 0.5), kResolution, kMiddle, chain), PairGap::kNone);
  EXPECT_EQ(chain.links[0].to, 2u) << "the candidates are those of the first and the third";
  EXPECT_EQ(chain.links[1].from, 2u);
  EXPECT_EQ(chain.links[1].to, 1u);
}

TEST(PairChain, SaysWhyATargetIsLeftOut) {
  PairChain chain;
  const std::vector<glm::dvec3> near = {{-3, 0, 0}, {3, 0, 0}, {0, 0, 7.9}};
  EXPECT_EQ(make_pair_chain(near, ball({0, 0, 8}, 0.5), kResolution, kMiddle, chain), PairGap::kTargetInBound);
  const std::vector<glm::dvec3> together = {{0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
  EXPECT_EQ(make_pair_chain(together, ball({0, 0, 8}, 0.5), kResolution, kMiddle, chain), PairGap::kTooClose);
  const std::vector<glm::dvec3> in_line = {{0, 0, 0}, {0, 0, 1}, {0, 0, 2}};
  EXPECT_EQ(make_pair_chain(in_line, ball({0, 0, 8}, 0.5), kResolution, kMiddle, chain), PairGap::kOnLine);
}

// The targets that are connected through pairs with a volume, by the transitive closure.
bool connected(const Layout& layout) {
  const size_t n = layout.points.size();
  std::vector<std::vector<bool>> reaches(n, std::vector<bool>(n));
  for (size_t i = 0; i < n; ++i)
    for (size_t k = 0; k < n; ++k)
      reaches[i][k] = pair_gap(layout.points[i], layout.points[k], layout.bound) == PairGap::kNone;
  for (size_t over = 0; over < n; ++over)
    for (size_t i = 0; i < n; ++i)
      for (size_t k = 0; k < n; ++k)
        if (reaches[i][over] && reaches[over][k]) reaches[i][k] = true;
  for (size_t k = 1; k < n; ++k)
    if (!reaches[0][k]) return false;
  return true;
}

TEST(PairChain, ThereIsOneExactlyWhenPairsConnectAllTargets) {
  CounterRandom random(41, 0, RandomPurpose::kTest);
  int chained = 0, left_out = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const size_t n = 2 + random.next_below(3);
    Layout layout = random_layout(random, n);
    layout.bound.radius_m = random.next_in(0.2, 1.5);
    // Some targets are at the same place, in the bound, or on a line with its centre.
    for (size_t i = 1; i < n; ++i) {
      const glm::dvec3 to_center = layout.bound.center_m - layout.points[0];
      const double where = random.next_unit();
      if (where < 0.4)
        layout.points[i] = layout.points[0] + (where < 0.2 ? glm::dvec3(0) : where * to_center);
      else if (where < 0.5)
        layout.points[i] = layout.bound.center_m + random_vector(random, 0.1);
    }
    PairChain chain;
    const PairGap gap = make_pair_chain(layout.points, layout.bound, kResolution, kMiddle, chain);
    ASSERT_EQ(gap == PairGap::kNone, connected(layout));
    ++(gap == PairGap::kNone ? chained : left_out);
    if (gap != PairGap::kNone) continue;
    ASSERT_EQ(chain.links.size(), n - 1);
    EXPECT_EQ(chain.links[0].from, 0u);
    std::vector<bool> in(n);
    in[0] = true;
    for (const ChainLink& link : chain.links) {
      EXPECT_TRUE(in[link.from]) << "a volume shares a target with an earlier one";
      EXPECT_FALSE(in[link.to]) << "and brings in one";
      EXPECT_EQ(pair_gap(layout.points[link.from], layout.points[link.to], layout.bound), PairGap::kNone);
      in[link.to] = true;
    }
  }
  EXPECT_GT(chained, 500);
  EXPECT_GT(left_out, 500);
}

// ---- what the candidates see ----

struct Box {
  glm::dvec3 center, half;
};

// The distance along origin + t direction to the nearest box, by the slab method, with each box grown by `margin` on
// all sides. Infinity when no box is hit.
double first_box(const std::vector<Box>& boxes, const glm::dvec3& origin, const glm::dvec3& direction, double margin) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Box& box : boxes) {
    double enter = 0, leave = nearest;
    for (int axis = 0; axis < 3; ++axis) {
      const double reach = box.half[axis] + margin, at = box.center[axis] - origin[axis];
      double t0 = (at - reach) / direction[axis], t1 = (at + reach) / direction[axis];
      if (t0 > t1) std::swap(t0, t1);
      enter = std::max(enter, t0), leave = std::min(leave, t1);
    }
    if (enter < leave) nearest = enter;
  }
  return nearest;
}

// Returns whether the ray sees the position at `distance`; nothing when the depths are too close to decide.
std::optional<bool> shows(const std::vector<Box>& boxes, const glm::dvec3& eye, const glm::dvec3& direction,
                          double distance) {
  constexpr double kHairM = 1e-3;
  const glm::dvec3 unit = glm::normalize(direction);
  const bool grown = distance <= first_box(boxes, eye, unit, kHairM);
  const bool shrunk = distance <= first_box(boxes, eye, unit, -kHairM);
  if (grown != shrunk) return std::nullopt;
  return grown;
}

// The texel whose ray passes nearest to a position, found by trying every texel; nothing when two pass equally near.
std::optional<glm::ivec2> texel_of(const MapView& view, const glm::dvec3& place) {
  const glm::dvec3 offset = place - view.eye_m, forward = -view.world_from_view[2];
  const glm::dvec3 at = offset / glm::dot(offset, forward);
  glm::ivec2 nearest(0);
  double least = INFINITY, second = INFINITY;
  for (int y = 0; y < view.height; ++y)
    for (int x = 0; x < view.width; ++x) {
      const glm::dvec3 apart = at - texel_direction(view, x, y);
      const double across = glm::dot(apart, view.world_from_view[0]) / (view.right - view.left) * view.width;
      const double along = glm::dot(apart, view.world_from_view[1]) / (view.top - view.bottom) * view.height;
      const double distance = std::hypot(across, along);
      if (distance < least)
        second = least, least = distance, nearest = {x, y};
      else
        second = std::min(second, distance);
    }
  if (second - least < 1e-6) return std::nullopt;
  return nearest;
}

// Boxes between the targets and the ball. None is so near a target that the target's near plane cuts it.
struct Scene {
  std::vector<Box> boxes;
  GeometryStore store;
  SceneMirror mirror;
};

void fill(Scene& scene, CounterRandom& random, const Layout& layout) {
  SceneDelta delta;
  while (scene.boxes.size() < 20) {
    const glm::vec3 half(random.next_in(0.1, 0.5), random.next_in(0.1, 0.5), random.next_in(0.1, 0.5));
    const glm::dvec3 at = random_vector(random, 3.5) + glm::dvec3(0, 0, 3);
    const auto too_near = [&](const glm::dvec3& p) { return glm::distance(p, at) < 1.0; };
    if (std::any_of(layout.points.begin(), layout.points.end(), too_near)) continue;
    scene.boxes.push_back({at, half});
    delta.add.push_back({scene.boxes.size(),
                         *scene.store.intern(*tessellate(BoxShape{half})),
                         Pose{at, {1, 0, 0, 0}},
                         glm::dmat3(1),
                         {}});
  }
  ASSERT_TRUE(scene.mirror.apply(delta, {}));
}

std::vector<DepthMap> take_maps(const Scene& scene, const PairChain& chain, size_t targets, const glm::dvec2& jitter) {
  std::vector<MapRequest> requests;
  for (uint32_t i = 0; i < targets; ++i) requests.push_back({.view = chain_view(chain, i, jitter)});
  std::vector<DepthMap> maps;
  EXPECT_TRUE(make_embree_sampler_device()->make_sampler()->take(scene.mirror, requests, maps));
  return maps;
}

class PairChainOf : public testing::TestWithParam<int> {};

// The two targets of the first volume are judged by straight lines; every other one by the ray that passes nearest to
// the candidate.
TEST_P(PairChainOf, SaysOfEveryCandidateWhatRaysSay) {
  const size_t n = GetParam();
  CounterRandom random(42, n, RandomPurpose::kTest);
  std::vector<int> seen(n), hidden(n);
  int hairs = 0, compared = 0;
  for (int trial = 0; trial < 60; ++trial) {
    PairChain chain;
    const Layout layout = random_chained(random, n, chain);
    Scene scene;
    fill(scene, random, layout);
    const glm::dvec2 jitter(random.next_unit(), random.next_unit());
    const std::vector<DepthMap> maps = take_maps(scene, chain, n, jitter);
    CandidateSet candidates;
    std::vector<glm::ivec3> texels;
    compose_chain(chain, maps, layout.bound, kBias, candidates, texels);
    ASSERT_EQ(texels.size(), candidates.size());
    for (size_t i = 0; i < candidates.size(); ++i) {
      const glm::dvec3 place = candidates.position_m[i];
      EXPECT_TRUE(layout.bound.contains(place));
      EXPECT_EQ(candidates.visible_targets[i] >> n, 0u);
      for (uint32_t target = 0; target < n; ++target) {
        const glm::dvec3& eye = layout.points[target];
        EXPECT_LT(glm::distance(maps[target].view.eye_m, eye), 1e-9);
        const bool exact = target == 0 || target == chain.links[0].to;
        const auto texel = texel_of(maps[target].view, place);
        const glm::dvec3 direction = exact || !texel ? place - eye
                                                     : texel_direction(maps[target].view, texel->x, texel->y);
        // As far along that ray as the candidate is deep.
        const glm::dvec3 axis = -maps[target].view.world_from_view[2];
        const double depth = glm::dot(place - eye, axis) / glm::dot(direction, axis);
        const auto shown = shows(scene.boxes, eye, direction, depth * glm::length(direction));
        if (!shown || (!exact && !texel)) {
          ++hairs;
          continue;
        }
        ++compared;
        EXPECT_EQ((candidates.visible_targets[i] >> target & 1u) != 0, *shown)
            << "target " << target << " candidate " << i << " trial " << trial;
        ++(*shown ? seen : hidden)[target];
      }
    }
  }
  EXPECT_LT(hairs * 50, compared);
  for (size_t target = 0; target < n; ++target) {
    EXPECT_GT(seen[target], 50);
    EXPECT_GT(hidden[target], 50);
  }
}
INSTANTIATE_TEST_SUITE_P(Targets, PairChainOf, testing::Values(2, 3, 4, 8));

// The general operator projects into the same maps, and takes any position, not only the candidates.
TEST(PairChain, AgreesWithTheGeneralOperatorOverTheSameMaps) {
  CounterRandom random(43, 0, RandomPurpose::kTest);
  for (const size_t n : {2, 3, 8, 32}) {
    PairChain chain;
    Layout layout;
    do {
      layout = random_layout(random, n);
      layout.bound.radius_m = 0.2;
    } while (make_pair_chain(layout.points, layout.bound, kResolution, kMiddle, chain) != PairGap::kNone);
    Scene scene;
    const std::vector<DepthMap> maps = [&] {
      fill(scene, random, {{layout.points[0]}, layout.bound});
      return take_maps(scene, chain, n, {0.5, 0.5});
    }();
    CandidateSet candidates;
    std::vector<glm::ivec3> texels;
    compose_chain(chain, maps, layout.bound, kBias, candidates, texels);
    ASSERT_EQ(texels.size(), candidates.size());
    ASSERT_GT(candidates.size(), 20u);
    std::vector<MapRange> ranges;
    for (uint32_t i = 0; i < n; ++i) ranges.push_back({i, 1});
    Composer composer;
    std::vector<uint32_t> general;
    composer.set_positions(candidates.position_m);
    composer.visibility({maps, ranges, ranges}, kBias, general);
    EXPECT_EQ(general, candidates.visible_targets) << n << " targets";
    EXPECT_TRUE(std::ranges::equal(general, candidates.filtered()));
    EXPECT_TRUE(std::ranges::equal(general, candidates.ahead()));
  }
}

// Figure 2: "the rendering from object B is performed only once and resampled for use by both visibility volumes". In
// the basis of V_BC a candidate of V_AB has a column and a row of B. The ray through them, looked up in the map that
// was taken for V_AB, falls into the same texel that V_AB compared.
TEST(PairChain, TheSecondVolumeFindsTheFirstOnesAnswerInTheSharedPicture) {
  CounterRandom random(44, 0, RandomPurpose::kTest);
  int candidates_seen = 0, candidates_hidden = 0;
  for (int trial = 0; trial < 20; ++trial) {
    PairChain chain;
    const Layout layout = random_chained(random, 3, chain);
    if (chain.links[1].from != chain.links[0].to) continue;
    Scene scene;
    fill(scene, random, layout);
    const std::vector<DepthMap> maps = take_maps(scene, chain, 3, {0.5, 0.5});
    CandidateSet candidates;
    std::vector<glm::ivec3> texels;
    compose_chain(chain, maps, layout.bound, kBias, candidates, texels);
    ASSERT_EQ(texels.size(), candidates.size());
    const uint32_t b = chain.links[1].from;
    const PairVolume& volume = chain.links[1].volume;
    for (size_t i = 0; i < candidates.size(); ++i) {
      const PairCoordinates at = pair_coordinates(volume, candidates.position_m[i]);
      const glm::dvec3 far = volume.a_m + volume.world_from_volume * glm::dvec3(at.xa, at.y, volume.far_m);
      const MapPoint in_b = project(maps[b].view, far);
      ASSERT_TRUE(in_b.in_window);
      EXPECT_NEAR(in_b.x - std::floor(in_b.x), 0.5, 1e-6);
      EXPECT_NEAR(in_b.y - std::floor(in_b.y), 0.5, 1e-6);
      const float depth = maps[b].distance_at(static_cast<int>(in_b.x), static_cast<int>(in_b.y));
      const bool seen = glm::distance(candidates.position_m[i], layout.points[b]) <= depth * (1.0 + kBias);
      EXPECT_EQ((candidates.visible_targets[i] >> b & 1u) != 0, seen);
      ++(seen ? candidates_seen : candidates_hidden);
    }
  }
  EXPECT_GT(candidates_seen, 100);
  EXPECT_GT(candidates_hidden, 100);
}

// Of two targets the candidates are the meeting points of the one volume, compared at the texels whose rays meet there.
TEST(PairChain, OfTwoTargetsIsTheirPairVolume) {
  CounterRandom random(45, 0, RandomPurpose::kTest);
  size_t candidates_seen = 0;
  for (int trial = 0; trial < 50; ++trial) {
    PairChain chain;
    const Layout layout = random_chained(random, 2, chain);
    const PairVolume pair = make_pair_volume(layout.points[0], layout.points[1], layout.bound, kResolution);
    Scene scene;
    fill(scene, random, layout);
    const glm::dvec2 jitter(0.3, 0.8);
    const std::vector<DepthMap> maps = take_maps(scene, chain, 2, jitter);
    const auto views = pair_views(pair, jitter);
    for (int i = 0; i < 2; ++i) {
      EXPECT_EQ(maps[i].view.eye_m, views[i].eye_m);
      EXPECT_EQ(maps[i].view.left, views[i].left);
      EXPECT_EQ(maps[i].view.top, views[i].top);
    }
    CandidateSet candidates;
    std::vector<glm::ivec3> texels;
    compose_chain(chain, maps, layout.bound, kBias, candidates, texels);
    candidates_seen += candidates.size();
    size_t i = 0;
    for_each_meeting(pair, layout.bound, jitter, [&](const glm::ivec3& uvw, const glm::dvec3& point) {
      ASSERT_LT(i, candidates.size());
      EXPECT_EQ(candidates.position_m[i], point);
      EXPECT_EQ(texels[i], uvw);
      const bool sees_a = glm::distance(point, layout.points[0]) <=
                          maps[0].distance_at(kResolution - 1 - uvw.z, uvw.y) * (1 + kBias);
      const bool sees_b = glm::distance(point, layout.points[1]) <= maps[1].distance_at(uvw.x, uvw.y) * (1 + kBias);
      EXPECT_EQ(candidates.visible_targets[i], (sees_a ? 1u : 0u) | (sees_b ? 2u : 0u));
      ++i;
    });
    EXPECT_EQ(i, candidates.size());
  }
  EXPECT_GT(candidates_seen, 1000u);
}

// A candidate of the first volume that is not in the window of a third target cannot be expressed in the second one.
TEST(PairChain, DropsCandidatesOutsideALaterVolume) {
  // The line from the second target to the third passes through the ball, so their volume covers the part on one side
  // of it only.
  const std::vector<glm::dvec3> points = {{-3, 0, 0}, {3, 0, 0}, {3, 0.4, 12}};
  const Bound bound = ball({2.5, 0.3, 6}, 1.0);
  PairChain chain;
  ASSERT_EQ(make_pair_chain(points, bound, 15, kMiddle, chain), PairGap::kNone);
  ASSERT_EQ(chain.links.size(), 2u);
  const SceneMirror empty;
  std::vector<MapRequest> requests;
  for (uint32_t i = 0; i < 3; ++i) requests.push_back({.view = chain_view(chain, i, kMiddle)});
  std::vector<DepthMap> maps;
  ASSERT_TRUE(make_embree_sampler_device()->make_sampler()->take(empty, requests, maps));
  CandidateSet candidates;
  std::vector<glm::ivec3> texels;
  compose_chain(chain, maps, bound, kBias, candidates, texels);
  size_t inside = 0, outside = 0;
  for_each_meeting(chain.links[0].volume, bound, kMiddle, [&](const glm::ivec3&, const glm::dvec3& point) {
    const bool in_both = project(chain_view(chain, chain.links[1].from == 1 ? 1 : 0, kMiddle), point).depth_m > 0 &&
                         project(chain_view(chain, 2, kMiddle), point).in_window;
    ++(in_both && nearest_texels(chain.links[1].volume, point, kMiddle) ? inside : outside);
  });
  EXPECT_EQ(candidates.size(), inside);
  EXPECT_GT(inside, 50u);
  EXPECT_GT(outside, 50u);
}

}  // namespace
}  // namespace sightline
