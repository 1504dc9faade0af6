// The Embree sampler's maps equal brute force, do not depend on other work on the device, and are taken without an
// allocation.
#include "server/sample/embree_maps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <cstring>

#include "server/sample/embree_sampler.h"
#include "server/sample/plan.h"
#include "tests/sample/brute_force.h"
#include "tests/sample/scene_maker.h"
#include "tests/support/count_allocations.h"

namespace sightline {
namespace {

using test::brute_trace;
using test::BruteHit;
using test::SceneMaker;

// Requests whose ignored slots live as long as they do: maps of many shapes, and sights.
struct Requests {
  std::vector<std::vector<uint32_t>> ignored;
  std::vector<MapRequest> all;

  Requests(SceneMaker& maker, size_t slots, int count, double ahead_s = 0.0) {
    for (int i = 0; i < count; ++i) {
      ignored.push_back(maker.ignored(slots));
      MapRequest request{.view = maker.view(), .layer_mask = i % 3 == 0 ? 5u : 0xFFFFFFFFu};
      if (i % 4 == 1) request.view = plan_sight(request.view.eye_m, maker.pose().position_m);
      if (i % 4 == 2) request.view.width = 7, request.view.height = 7;
      if (i % 4 == 3) request.ahead_s = ahead_s;
      all.push_back(request);
    }
    for (size_t i = 0; i < all.size(); ++i) all[i].ignored_slots = ignored[i];
  }
};

// Counts texels in which a map differs from brute force. Texels that an edge passes within rounding may go either way.
size_t count_differences(const SceneMirror& mirror, const MapRequest& request, const DepthMap& map) {
  size_t different = 0;
  const RayFilter filter{.layer_mask = request.layer_mask, .ignored_slots = request.ignored_slots};
  for (int y = 0; y < map.view.height; ++y)
    for (int x = 0; x < map.view.width; ++x) {
      const glm::dvec3 direction = texel_direction(map.view, x, y);
      const BruteHit want = brute_trace(mirror, true, map.view.eye_m, direction, map.view.near_m, filter);
      const double distance_m = want.distance * glm::length(direction);
      const bool tie = want.second - want.distance < 1e-5 * want.distance;
      const bool same_slot = map.occluder_at(x, y) == want.slot || tie;
      const bool same_distance = want.slot == kNoOccluder
                                     ? std::isinf(map.distance_at(x, y))
                                     : std::abs(map.distance_at(x, y) - distance_m) < 1e-5 * distance_m + 1e-5;
      different += !(same_slot && same_distance);
    }
  return different;
}

size_t count_texels(std::span<const DepthMap> maps) {
  size_t texels = 0;
  for (const DepthMap& map : maps) texels += map.distance_m.size();
  return texels;
}

bool same_bits(const DepthMap& a, const DepthMap& b) {
  return a.distance_m.size() == b.distance_m.size() && a.occluder == b.occluder &&
         std::memcmp(a.distance_m.data(), b.distance_m.data(), a.distance_m.size() * sizeof(float)) == 0;
}

class EmbreeMapsTest : public ::testing::Test {
 protected:
  std::vector<DepthMap> take(const SceneMirror& mirror, std::span<const MapRequest> requests) {
    std::vector<DepthMap> maps;
    EXPECT_TRUE(device_->make_sampler()->take(mirror, requests, maps));
    return maps;
  }
  std::unique_ptr<SamplerDevice> device_ = make_embree_sampler_device();
};

TEST_F(EmbreeMapsTest, AreThoseOfBruteForceWhileTheSceneChanges) {
  size_t different = 0, texels = 0;
  for (uint64_t seed = 300; seed < 312; ++seed) {
    SceneMaker maker(seed, seed % 2 ? glm::dvec3(0.0) : glm::dvec3(-7000.0, 300.0, 7100.0));
    SceneMirror mirror;
    ASSERT_TRUE(mirror.apply(maker.scene(12), {}));
    const auto sampler = device_->make_sampler();
    std::vector<DepthMap> maps;
    for (int round = 0; round < 4; ++round) {
      const Requests requests(maker, mirror.instances().size(), 4);
      ASSERT_TRUE(sampler->take(mirror, requests.all, maps));
      for (size_t i = 0; i < maps.size(); ++i) different += count_differences(mirror, requests.all[i], maps[i]);
      texels += count_texels(maps);
      SceneDelta delta;
      const uint64_t victim = 1 + maker.random().next_below(12);
      if (round == 0) delta.change.push_back({victim, maker.attributes()});
      if (round == 1) delta.remove.push_back(victim), delta.add.push_back(maker.instance(victim));
      ASSERT_TRUE(mirror.apply(delta, maker.moves(mirror, 12)));
    }
  }
  EXPECT_GT(texels, 20'000u);
  EXPECT_LE(different, texels / 2000) << "of " << texels;
}

TEST_F(EmbreeMapsTest, ShowManyMoversAsBruteForceDoes) {
  SceneMaker maker(17);
  SceneMirror mirror;
  SceneDelta delta;
  const auto shape = maker.shape();
  for (uint64_t id = 1; id <= 200; ++id) {
    delta.add.push_back(maker.instance(id));
    delta.add.back().geometry = shape;
    delta.add.back().pose.position_m *= 4.0;
    delta.add.back().moving = true;
  }
  ASSERT_TRUE(mirror.apply(delta, {}));
  const Requests requests(maker, 200, 8);
  const std::vector<DepthMap> maps = take(mirror, requests.all);
  size_t different = 0;
  for (size_t i = 0; i < maps.size(); ++i) different += count_differences(mirror, requests.all[i], maps[i]);
  EXPECT_LE(different, count_texels(maps) / 2000);
}

TEST_F(EmbreeMapsTest, AreTheSameBitsOnAnyNumberOfHandsWhileTheSceneChanges) {
  const auto with_threads = make_embree_sampler_device(3);
  for (uint64_t seed = 500; seed < 506; ++seed) {
    SceneMaker maker(seed);
    SceneMirror mirror;
    ASSERT_TRUE(mirror.apply(maker.scene(12), {}));
    const auto alone = device_->make_sampler(), together = with_threads->make_sampler();
    std::vector<DepthMap> want, maps;
    for (int round = 0; round < 30; ++round) {
      const Requests requests(maker, mirror.instances().size(), round % 3 == 0 ? 3 : 60, 0.3);
      ASSERT_TRUE(alone->take(mirror, requests.all, want));
      ASSERT_TRUE(together->take(mirror, requests.all, maps));
      ASSERT_EQ(maps.size(), want.size());
      for (size_t i = 0; i < maps.size(); ++i) ASSERT_TRUE(same_bits(maps[i], want[i])) << "map " << i;
      ASSERT_EQ(together->maps_taken(), alone->maps_taken());
      SceneDelta delta;
      const uint64_t victim = 1 + maker.random().next_below(12);
      if (round % 5 == 0) delta.change.push_back({victim, maker.attributes()});
      if (round % 5 == 1) delta.remove.push_back(victim), delta.add.push_back(maker.instance(victim));
      ASSERT_TRUE(mirror.apply(delta, maker.moves(mirror, 12)));
    }
  }
}

// Each request of one call may ask for a time of its own.
TEST_F(EmbreeMapsTest, HoldWhatTheSceneWillBeAhead) {
  constexpr std::array kAheadS = {0.0, 0.4, 0.05, 1.2};
  size_t different = 0, texels = 0;
  for (uint64_t seed = 400; seed < 410; ++seed) {
    SceneMaker maker(seed);
    std::array<SceneMirror, kAheadS.size()> mirrors;  // by time; the first is the present
    const SceneDelta scene = maker.scene(12);
    for (SceneMirror& mirror : mirrors) ASSERT_TRUE(mirror.apply(scene, {}));
    TransformUpdate moves = maker.moves(mirrors[0], 12);
    moves.velocities_mps.resize(moves.ids.size(), {1.5, -0.5, 2.0});
    const glm::dvec3 turning_radps(0.0, 2.5, 0.0);
    for (size_t i = 0; i < moves.ids.size(); ++i)
      moves.angular_velocities_radps.push_back(i % 2 == 0 ? turning_radps : glm::dvec3(0.0));
    for (size_t k = 0; k < mirrors.size(); ++k) {
      TransformUpdate then = moves;
      for (size_t i = 0; i < moves.ids.size(); ++i) {
        then.poses[i].position_m += kAheadS[k] * moves.velocities_mps[i];
        if (i % 2 == 0)
          then.poses[i].rotation = glm::angleAxis(kAheadS[k] * turning_radps.y, glm::dvec3(0, 1, 0)) *
                                   then.poses[i].rotation;
      }
      ASSERT_TRUE(mirrors[k].apply({}, then));
    }
    Requests requests(maker, 12, 16);
    for (size_t i = 0; i < requests.all.size(); ++i) requests.all[i].ahead_s = kAheadS[i / 4];
    const std::vector<DepthMap> maps = take(mirrors[0], requests.all);
    for (size_t i = 0; i < maps.size(); ++i) different += count_differences(mirrors[i / 4], requests.all[i], maps[i]);
    texels += count_texels(maps);
  }
  EXPECT_LE(different, texels / 2000) << "of " << texels;
}

TEST_F(EmbreeMapsTest, AreTheSameBitsInAnyCompanyAndOrder) {
  for (uint64_t seed = 500; seed < 520; ++seed) {
    SceneMaker maker(seed);
    SceneMirror mirror;
    ASSERT_TRUE(mirror.apply(maker.scene(14), {}));
    const Requests requests(maker, 14, 12, 0.3);
    const std::vector<DepthMap> together = take(mirror, requests.all);
    std::vector<MapRequest> reversed(requests.all.rbegin(), requests.all.rend());
    const std::vector<DepthMap> backwards = take(mirror, reversed);
    const auto used = device_->make_sampler();
    for (size_t i = 0; i < together.size(); ++i) {
      EXPECT_TRUE(same_bits(together[i], backwards[together.size() - 1 - i]));
      EXPECT_TRUE(same_bits(together[i], take(mirror, {&requests.all[i], 1})[0]));
      std::vector<DepthMap> maps;
      ASSERT_TRUE(used->take(mirror, {&requests.all[i], 1}, maps));
      EXPECT_TRUE(same_bits(together[i], maps[0]));
    }
  }
}

TEST_F(EmbreeMapsTest, EndAtTheFarDepthAndAreTheSameBeforeIt) {
  size_t cut = 0, kept = 0;
  for (uint64_t seed = 600; seed < 610; ++seed) {
    SceneMaker maker(seed);
    SceneMirror mirror;
    ASSERT_TRUE(mirror.apply(maker.scene(12), {}));
    Requests requests(maker, 12, 8);
    const std::vector<DepthMap> whole = take(mirror, requests.all);
    for (MapRequest& request : requests.all) request.far_m = 4.0;
    const std::vector<DepthMap> near = take(mirror, requests.all);
    for (size_t i = 0; i < near.size(); ++i)
      for (size_t texel = 0; texel < near[i].occluder.size(); ++texel) {
        const int width = near[i].view.width, x = static_cast<int>(texel) % width, y = static_cast<int>(texel) / width;
        const bool beyond = whole[i].depth_at(x, y) > 4.0;
        (beyond ? cut : kept) += whole[i].occluder[texel] != kNoOccluder;
        EXPECT_EQ(near[i].occluder[texel], beyond ? kNoOccluder : whole[i].occluder[texel]);
        EXPECT_FLOAT_EQ(near[i].distance_m[texel],
                        beyond ? std::numeric_limits<float>::infinity() : whole[i].distance_m[texel]);
      }
  }
  EXPECT_GT(cut, 1000u);
  EXPECT_GT(kept, 1000u);
}

TEST_F(EmbreeMapsTest, AreTakenWithoutAnAllocationOnceTheirMemoryIsThere) {
  SceneMaker maker(42);
  SceneMirror mirror;
  ASSERT_TRUE(mirror.apply(maker.scene(30), {}));
  const Requests requests(maker, 30, 12, 0.3);
  std::vector<TransformUpdate> ticks;
  for (int tick = 0; tick < 100; ++tick) ticks.push_back(maker.moves(mirror, 30));
  // The first update that names an instance makes it a mover.
  for (const TransformUpdate& tick : ticks) ASSERT_TRUE(mirror.apply({}, tick));
  const auto sampler = device_->make_sampler();
  std::vector<DepthMap> maps;
  const auto run = [&] {
    for (const TransformUpdate& tick : ticks)
      if (!mirror.apply({}, tick) || !sampler->take(mirror, requests.all, maps)) return false;
    return true;
  };
  ASSERT_TRUE(run());
  const size_t before = allocations;
  ASSERT_TRUE(run());
  EXPECT_EQ(allocations - before, 0u);
}

TEST(PacketShape, CoversEveryMapWithAsFewPacketsAsAnyRectangle) {
  for (int width = 1; width <= kMaxMapSize; ++width)
    for (int height = 1; height <= kMaxMapSize; ++height) {
      const auto packets = [&](int w, int h) { return ((width + w - 1) / w) * ((height + h - 1) / h); };
      int fewest = width * height;
      for (int w = 1; w <= 16; ++w)
        for (int h = 1; w * h <= 16; ++h) fewest = std::min(fewest, packets(w, h));
      const PacketShape shape = packet_shape(width, height);
      ASSERT_LE(shape.width * shape.height, 16);
      ASSERT_EQ(packets(shape.width, shape.height), fewest) << width << " x " << height;
    }
  EXPECT_EQ(packet_shape(16, 16).width, 4);
  EXPECT_EQ(packet_shape(7, 7).width, 4);
}

// A ball that some ray of the cone meets may never be left out; most balls that none meets should be.
TEST(RayCone, LeavesOutNoBallThatARayMeets) {
  SceneMaker maker(8);
  int met = 0, left_out = 0;
  for (int i = 0; i < 2000; ++i) {
    const MapView view = maker.view();
    const std::array<glm::vec3, 4> corners{glm::vec3(texel_direction(view, 0, 0)),
                                           glm::vec3(texel_direction(view, view.width - 1, 0)),
                                           glm::vec3(texel_direction(view, 0, view.height - 1)),
                                           glm::vec3(texel_direction(view, view.width - 1, view.height - 1))};
    const RayCone cone = RayCone::around(corners);
    const glm::dvec3 center = maker.pose().position_m;
    const double radius = maker.random().next_in(0.05, 1.0);
    bool meets = false;
    for (int y = 0; y < view.height; ++y)
      for (int x = 0; x < view.width; ++x) {
        const glm::dvec3 ray = glm::normalize(texel_direction(view, x, y));
        const glm::dvec3 nearest = ray * std::max(0.0, glm::dot(ray, center)) - center;
        meets |= glm::length(nearest) <= radius;
      }
    const bool kept = cone.may_meet(glm::vec3(center), static_cast<float>(radius * (1 + 1e-6)));
    met += meets;
    left_out += !kept;
    EXPECT_TRUE(kept || !meets);
  }
  EXPECT_GT(met, 100);
  EXPECT_GT(left_out, 500);
}

int64_t processor_stands_still() {
  return 0;
}
int64_t processor_runs() {
  static int64_t now_ns = 0;
  return now_ns += 1000;
}

// A take is given up by what its thread has used of the processor. However long it takes by the wall, a thread that
// does not run refuses nothing.
TEST(EmbreeSampler, GivesUpByProcessorTimeAlone) {
  SceneMaker maker(12);
  SceneMirror mirror;
  ASSERT_TRUE(mirror.apply(maker.scene(12), {}));
  const Requests requests(maker, mirror.instances().size(), 40);
  std::vector<DepthMap> maps, free;
  ASSERT_TRUE(make_embree_sampler_device()->make_sampler()->take(mirror, requests.all, free));
  const auto patient = make_embree_sampler_device(1, std::chrono::nanoseconds(1), processor_stands_still);
  ASSERT_TRUE(patient->make_sampler()->take(mirror, requests.all, maps));
  ASSERT_EQ(maps.size(), free.size());
  for (size_t i = 0; i < maps.size(); ++i) EXPECT_EQ(maps[i].distance_m, free[i].distance_m);
  const auto strict = make_embree_sampler_device(1, std::chrono::nanoseconds(1), processor_runs);
  const Status refused = strict->make_sampler()->take(mirror, requests.all, maps);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kResourceExhausted);
}

}  // namespace
}  // namespace sightline
