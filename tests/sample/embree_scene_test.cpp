// Embree against brute force.
#include <gtest/gtest.h>

#include <algorithm>
#include <thread>

#include "server/sample/embree_sampler.h"
#include "server/sample/embree_scene.h"
#include "tests/sample/brute_force.h"
#include "tests/sample/scene_maker.h"

namespace sightline {
namespace {

using test::brute_trace;
using test::BruteHit;
using test::for_each_triangle;
using test::hit_distance;
using test::kInfinity;
using test::SceneMaker;
using test::Triangle;

// is_blocked with no limit, just beyond the first hit, and just before it.
bool blocks_as_brute_force(const EmbreeScene& scene, const glm::dvec3& origin, const glm::dvec3& direction,
                           const RayFilter& filter, const BruteHit& want) {
  const auto is_blocked = [&](double far) {
    return scene.is_blocked(origin, glm::vec3(direction), 0.01f, static_cast<float>(far), filter);
  };
  if (want.slot == UINT32_MAX) return !is_blocked(kInfinity);
  return is_blocked(kInfinity) && is_blocked(1.001 * want.distance) && !is_blocked(0.999 * want.distance);
}

// Counts rays whose answer differs; rays within 1e-6 of an edge may fall on either side.
int count_differences(const SceneMirror& mirror, const EmbreeScene& scene, bool occluders, SceneMaker& maker,
                      const RayFilter& filter, int rays) {
  int different = 0;
  for (int i = 0; i < rays; ++i) {
    const glm::dvec3 origin = maker.pose().position_m;
    const glm::dvec3 direction = maker.pose().rotation * glm::dvec3(0, 0, -maker.random().next_in(0.5, 2.0));
    const RayHit hit = scene.trace(origin, glm::vec3(direction), 0.01f, std::numeric_limits<float>::infinity(), filter);
    const BruteHit want = brute_trace(mirror, occluders, origin, glm::dvec3(glm::vec3(direction)), 0.01, filter);
    const bool tie = want.second - want.distance < 1e-5 * want.distance;
    const bool same_slot = hit.slot == want.slot || tie;
    const bool same_distance = want.slot == UINT32_MAX
                                   ? std::isinf(hit.distance_m)
                                   : std::abs(hit.distance_m - want.distance) < 1e-5 * want.distance + 1e-5;
    different += !(same_slot && same_distance) || !blocks_as_brute_force(scene, origin, direction, filter, want);
  }
  return different;
}

class EmbreeSceneTest : public ::testing::Test {
 protected:
  EmbreeDevice device_;
};

TEST_F(EmbreeSceneTest, TracesAsBruteForceDoesUnderEveryFilter) {
  int different = 0, rays = 0;
  for (uint64_t seed = 0; seed < 40; ++seed) {
    SceneMaker maker(seed);
    SceneMirror mirror;
    ASSERT_TRUE(mirror.apply(maker.scene(12), {}));
    const bool occluders = seed % 2 == 0;
    EmbreeScene scene(device_, occluders ? EmbreeScene::Content::kOccluders : EmbreeScene::Content::kColliders);
    scene.take_in(mirror);
    const std::vector<uint32_t> ignored = maker.ignored(12);
    const std::vector<RayFilter> filters{{},
                                         {.layer_mask = 2},
                                         {.ignored_slots = ignored},
                                         {.layer_mask = 5, .ignored_slots = ignored},
                                         {.only_slot = 3}};
    for (const RayFilter& filter : filters) {
      different += count_differences(mirror, scene, occluders, maker, filter, 50);
      rays += 50;
    }
  }
  // A ray that grazes an edge within rounding may go either way: at most one in a thousand.
  EXPECT_LE(different, rays / 1000);
}

TEST_F(EmbreeSceneTest, FollowsEveryChangeOfTheMirror) {
  int different = 0;
  for (uint64_t seed = 100; seed < 110; ++seed) {
    SceneMaker maker(seed);
    SceneMirror mirror;
    EmbreeScene scene(device_, EmbreeScene::Content::kOccluders);
    ASSERT_TRUE(mirror.apply(maker.scene(10), {}));
    for (int round = 0; round < 6; ++round) {
      SceneDelta delta;
      const uint64_t victim = 1 + maker.random().next_below(10);
      if (round % 3 == 0) delta.change.push_back({victim, maker.attributes()});
      if (round % 3 == 1 && mirror.find(victim)) {
        delta.remove.push_back(victim);
        delta.add.push_back(maker.instance(victim));
      }
      ASSERT_TRUE(mirror.apply(delta, maker.moves(mirror, 10)));
      scene.take_in(mirror);
      different += count_differences(mirror, scene, true, maker, {}, 100);
    }
  }
  EXPECT_LE(different, 6);
}

TEST_F(EmbreeSceneTest, DistancesHoldTenKilometresFromTheOrigin) {
  SceneMaker maker(7, glm::dvec3(8000.0, 120.0, -6000.0));
  SceneMirror mirror;
  ASSERT_TRUE(mirror.apply(maker.scene(15), {}));
  EmbreeScene scene(device_, EmbreeScene::Content::kOccluders);
  scene.take_in(mirror);
  // The same tolerance as at the origin: 1e-5 relative + 1e-5 m.
  EXPECT_LE(count_differences(mirror, scene, true, maker, {}, 2000), 2);
}

TEST_F(EmbreeSceneTest, RaysFromNowhereMeetNothing) {
  SceneMaker maker(1);
  SceneMirror mirror;
  ASSERT_TRUE(mirror.apply(maker.scene(12), {}));
  EmbreeScene scene(device_, EmbreeScene::Content::kOccluders);
  scene.take_in(mirror);
  const double nan = std::nan("");
  const glm::dvec3 here(0.0), ahead(0, 0, -1);
  for (const double bad : {nan, 1e300, -1e300, 1e30, static_cast<double>(kInfinity)})
    for (int axis = 0; axis < 3; ++axis) {
      glm::dvec3 origin = here, direction = ahead;
      origin[axis] = direction[axis] = bad;
      EXPECT_EQ(scene.trace(origin, glm::vec3(ahead), 0.0f, kInfinity).slot, UINT32_MAX) << bad;
      EXPECT_EQ(scene.trace(here, glm::vec3(direction), 0.0f, kInfinity).slot, UINT32_MAX) << bad;
      EXPECT_FALSE(scene.is_blocked(origin, glm::vec3(ahead), 0.0f, kInfinity)) << bad;
    }
}

TEST_F(EmbreeSceneTest, NormalsAreThoseOfTheWorldTriangle) {
  SceneMaker maker(3);
  SceneMirror mirror;
  ASSERT_TRUE(mirror.apply(maker.scene(12), {}));
  EmbreeScene scene(device_, EmbreeScene::Content::kOccluders);
  scene.take_in(mirror);
  int checked = 0;
  for (int i = 0; i < 500; ++i) {
    const glm::dvec3 origin = maker.pose().position_m, direction = maker.pose().rotation * glm::dvec3(0, 0, -1);
    const RayHit hit = scene.trace(origin, glm::vec3(direction), 0.01f, 100.0f);
    if (hit.slot == UINT32_MAX) continue;
    double best = 0.0;
    for_each_triangle(mirror.instances()[hit.slot], true, [&](const Triangle& triangle) {
      if (std::abs(hit_distance(triangle, origin, direction) - hit.distance_m) > 1e-3) return;
      const glm::dvec3 normal = glm::normalize(glm::cross(triangle.b - triangle.a, triangle.c - triangle.a));
      best = std::max(best, std::abs(glm::dot(normal, glm::normalize(glm::dvec3(hit.normal)))));
    });
    EXPECT_GT(best, 1 - 1e-4);
    ++checked;
  }
  EXPECT_GT(checked, 50);
}

double distance_to(const Triangle& t, const glm::dvec3& p) {
  const auto to_segment = [&](const glm::dvec3& a, const glm::dvec3& b) {
    const double s = std::clamp(glm::dot(p - a, b - a) / glm::dot(b - a, b - a), 0.0, 1.0);
    return glm::distance(p, a + (b - a) * s);
  };
  const glm::dvec3 n = glm::cross(t.b - t.a, t.c - t.a);
  const double edges = std::min({to_segment(t.a, t.b), to_segment(t.b, t.c), to_segment(t.c, t.a)});
  const bool inside = glm::dot(glm::cross(t.b - t.a, p - t.a), n) >= 0 &&
                      glm::dot(glm::cross(t.c - t.b, p - t.b), n) >= 0 &&
                      glm::dot(glm::cross(t.a - t.c, p - t.c), n) >= 0;
  return inside ? std::min(edges, std::abs(glm::dot(p - t.a, n)) / glm::length(n)) : edges;
}

TEST_F(EmbreeSceneTest, NearestSurfaceIsThatOfBruteForceWithinReach) {
  for (uint64_t seed = 200; seed < 210; ++seed) {
    SceneMaker maker(seed);
    SceneMirror mirror;
    ASSERT_TRUE(mirror.apply(maker.scene(10), {}));
    EmbreeScene scene(device_, EmbreeScene::Content::kColliders);
    scene.take_in(mirror);
    const std::vector<uint32_t> ignored = maker.ignored(10);
    for (int i = 0; i < 40; ++i) {
      const glm::dvec3 point = maker.pose().position_m;
      double want = 1.5;
      for (uint32_t slot = 0; slot < 10; ++slot) {
        if (!mirror.instances()[slot].collides() || std::ranges::count(ignored, slot) > 0) continue;
        for_each_triangle(mirror.instances()[slot], false,
                          [&](const Triangle& triangle) { want = std::min(want, distance_to(triangle, point)); });
      }
      EXPECT_NEAR(scene.nearest_surface_m(point, 1.5f, ignored), want, 2e-5);
    }
  }
}

TEST_F(EmbreeSceneTest, BottomScenesAreSharedAndDieWithTheirGeometry) {
  SceneMaker maker(11);
  const auto geometry = maker.shape();
  std::vector<SceneMirror> mirrors(10);
  std::vector<EmbreeScene> scenes;
  size_t one = 0;
  for (SceneMirror& mirror : mirrors) {
    SceneDelta delta;
    delta.add.push_back({.id = 1, .geometry = geometry, .pose = {}, .attributes = {}});
    ASSERT_TRUE(mirror.apply(delta, {}));
    scenes.emplace_back(device_, EmbreeScene::Content::kOccluders).take_in(mirror);
    if (one == 0) one = device_.geometry_bytes();
  }
  EXPECT_GT(one, geometry->positions.size() * sizeof(glm::vec3));
  EXPECT_EQ(device_.geometry_bytes(), one);

  for (int turn = 0; turn < 3; ++turn) {
    // Each of these scenes lives for one turn. Making the next one frees the geometry that it left.
    SceneMirror brief;
    SceneDelta delta;
    delta.add.push_back({.id = 1, .geometry = maker.shape(), .pose = {}, .attributes = {}});
    ASSERT_TRUE(brief.apply(delta, {}));
    EmbreeScene scene(device_, EmbreeScene::Content::kOccluders);
    scene.take_in(brief);
    EXPECT_GT(device_.geometry_bytes(), one);
  }
  EXPECT_EQ(device_.geometry_bytes(), one);
}

TEST_F(EmbreeSceneTest, SeeThroughTrianglesCollideButDoNotOcclude) {
  MeshData mesh;
  mesh.positions = {{-1, -1, -2}, {1, -1, -2}, {0, 1, -2}, {-1, -1, -1}, {1, -1, -1}, {0, 1, -1}};
  mesh.indices = {0, 1, 2, 3, 4, 5};
  mesh.see_through_first_index = 3;
  SceneMirror mirror;
  SceneDelta delta;
  delta.add.push_back({.id = 1, .geometry = build_geometry(mesh).value(), .pose = {}, .attributes = {}});
  ASSERT_TRUE(mirror.apply(delta, {}));
  EmbreeScene occluders(device_, EmbreeScene::Content::kOccluders),
      colliders(device_, EmbreeScene::Content::kColliders);
  occluders.take_in(mirror);
  colliders.take_in(mirror);
  EXPECT_FLOAT_EQ(occluders.trace({0, 0, 0}, {0, 0, -1}, 0.01f, 10.0f).distance_m, 2.0f);
  EXPECT_FLOAT_EQ(colliders.trace({0, 0, 0}, {0, 0, -1}, 0.01f, 10.0f).distance_m, 1.0f);
}

TEST_F(EmbreeSceneTest, ManyThreadsTraceTheSame) {
  SceneMaker maker(5);
  SceneMirror mirror;
  ASSERT_TRUE(mirror.apply(maker.scene(20), {}));
  EmbreeScene scene(device_, EmbreeScene::Content::kOccluders);
  scene.take_in(mirror);
  const std::vector<uint32_t> ignored = maker.ignored(20);
  const auto sum_of_hits = [&] {
    SceneMaker rays(77);
    double sum = 0;
    for (int i = 0; i < 3000; ++i) {
      const glm::dvec3 origin = rays.pose().position_m, direction = rays.pose().rotation * glm::dvec3(0, 0, -1);
      const RayHit hit = scene.trace(origin, glm::vec3(direction), 0.01f, 50.0f, {.ignored_slots = ignored});
      if (hit.slot != UINT32_MAX) sum += hit.distance_m + hit.slot;
    }
    return sum;
  };
  const double want = sum_of_hits();
  std::vector<double> got(4);
  std::vector<std::thread> threads;
  for (double& value : got) threads.emplace_back([&] { value = sum_of_hits(); });
  for (std::thread& thread : threads) thread.join();
  for (const double value : got) EXPECT_EQ(value, want);
}

TEST(EmbreeSamplerTest, TexelsAreRaysThroughTheJitteredPoint) {
  const auto device = make_embree_sampler_device();
  const auto sampler = device->make_sampler();
  SceneMaker maker(21);
  SceneMirror mirror;
  ASSERT_TRUE(mirror.apply(maker.scene(25), {}));
  const MapView view = maker.view();
  const std::vector<MapRequest> requests{{.view = view, .ignored_slots = {}}};
  std::vector<DepthMap> maps;
  ASSERT_TRUE(sampler->take(mirror, requests, maps));
  EXPECT_EQ(sampler->maps_taken(), 1u);
  for (int y = 0; y < view.height; ++y)
    for (int x = 0; x < view.width; ++x) {
      const glm::dvec3 direction = texel_direction(view, x, y);
      const BruteHit want = brute_trace(mirror, true, view.eye_m, direction, view.near_m, {});
      if (want.slot == UINT32_MAX) {
        EXPECT_EQ(maps[0].occluder_at(x, y), kNoOccluder);
        EXPECT_TRUE(std::isinf(maps[0].distance_at(x, y)));
        continue;
      }
      EXPECT_EQ(maps[0].occluder_at(x, y), want.slot);
      EXPECT_NEAR(maps[0].distance_at(x, y), want.distance * glm::length(direction), 1e-4);
    }
}

}  // namespace
}  // namespace sightline
