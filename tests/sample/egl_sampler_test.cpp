// What the EGL device promises beside right maps: one copy of geometry, sessions side by side, losses survived.
#include <gtest/gtest.h>

#include <algorithm>
#include <thread>

#include "server/sample/egl_measure.h"
#include "server/sample/geometry_arena.h"
#include "server/sample/map_renderer.h"
#include "tests/sample/egl_device.h"
#include "tests/sample/scene_maker.h"

namespace sightline {
namespace {

using test::SceneMaker;

void expect_equal(const std::vector<DepthMap>& a, const std::vector<DepthMap>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].occluder, b[i].occluder);
    EXPECT_EQ(a[i].distance_m, b[i].distance_m);
  }
}

std::vector<MapRequest> some_requests(SceneMaker& maker, int count) {
  std::vector<MapRequest> requests;
  for (int i = 0; i < count; ++i) requests.push_back({.view = maker.view()});
  return requests;
}

TEST(EglSamplerTest, ALostContextIsRebuiltAndTheTakeRepeated) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(device);
  SceneMaker maker(1);
  SceneMirror mirror;
  ASSERT_TRUE(mirror.apply(maker.scene(20), {}));
  const auto requests = some_requests(maker, 6);
  const auto sampler = device.make_sampler();
  std::vector<DepthMap> before, after;
  ASSERT_TRUE(sampler->take(mirror, requests, before));
  const size_t bytes = device.geometry_bytes();
  device.simulate_context_loss();
  ASSERT_TRUE(sampler->take(mirror, requests, after));
  EXPECT_EQ(device.context_rebuilds(), 1u);
  EXPECT_EQ(device.geometry_bytes(), bytes);
  expect_equal(before, after);
  ASSERT_TRUE(sampler->take(mirror, requests, after));
  EXPECT_EQ(device.context_rebuilds(), 1u);
  expect_equal(before, after);
}

TEST(EglSamplerTest, SamplersOnTwoThreadsTakeWhatTheyTakeAlone) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(device);
  constexpr int kSessions = 3, kTakes = 60;
  const auto run = [&](uint64_t seed, std::vector<std::vector<DepthMap>>& taken) {
    SceneMaker maker(seed);
    SceneMirror mirror;
    if (!mirror.apply(maker.scene(15), {})) return;
    const auto sampler = device.make_sampler();
    for (int take = 0; take < kTakes; ++take) {
      if (!mirror.apply({}, maker.moves(mirror, 15))) return;
      if (!sampler->take(mirror, some_requests(maker, 2), taken.emplace_back())) return;
    }
  };
  std::vector<std::vector<std::vector<DepthMap>>> alone(kSessions), together(kSessions);
  for (uint64_t i = 0; i < kSessions; ++i) run(i, alone[i]);
  std::vector<std::thread> threads;
  for (uint64_t i = 0; i < kSessions; ++i) threads.emplace_back([&, i] { run(i, together[i]); });
  for (std::thread& thread : threads) thread.join();
  for (size_t i = 0; i < kSessions; ++i) {
    ASSERT_EQ(alone[i].size(), size_t{kTakes});
    ASSERT_EQ(together[i].size(), size_t{kTakes});
    for (size_t take = 0; take < kTakes; ++take) expect_equal(alone[i][take], together[i][take]);
  }
}

TEST(EglSamplerTest, TenMirrorsOfOneGeometryKeepOneCopyUntilItDies) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(device, {.variant = EglVariant{.detail = Detail::kClusters}});
  SceneMaker maker(4);
  auto geometry = maker.shape();
  MapView view;
  view.eye_m = {0, 0, 5};
  std::vector<DepthMap> maps;
  const std::vector<MapRequest> requests{{.view = view}};
  const size_t one = geometry->occluding_index_count * GeometryArena::kVertexBytes;
  {
    std::vector<SceneMirror> mirrors(10);
    std::vector<std::unique_ptr<Sampler>> samplers;
    for (SceneMirror& mirror : mirrors) {
      SceneDelta delta;
      delta.add.push_back({.id = 1, .geometry = geometry, .pose = {}, .attributes = {}});
      ASSERT_TRUE(mirror.apply(delta, {}));
      ASSERT_TRUE(samplers.emplace_back(device.make_sampler())->take(mirror, requests, maps));
      EXPECT_GT(std::ranges::count(maps[0].occluder, 0u), 0);
      EXPECT_EQ(device.geometry_bytes(), one);
    }
  }
  EXPECT_EQ(device.geometry_bytes(), one);
  geometry.reset();
  EXPECT_EQ(device.geometry_bytes(), 0u);
}

TEST(EglSamplerTest, NothingInViewIsInfinitelyFar) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(device);
  SceneMirror mirror;
  std::vector<DepthMap> maps;
  const auto sampler = device.make_sampler();
  ASSERT_TRUE(sampler->take(mirror, std::vector<MapRequest>(3), maps));
  ASSERT_EQ(maps.size(), 3u);
  for (const DepthMap& map : maps) {
    EXPECT_TRUE(std::ranges::all_of(map.distance_m, [](float d) { return std::isinf(d); }));
    EXPECT_EQ(std::ranges::count(map.occluder, kNoOccluder), 49);
  }
  ASSERT_TRUE(sampler->take(mirror, {}, maps));
  EXPECT_TRUE(maps.empty());
  EXPECT_EQ(sampler->maps_taken(), 3u);
}

TEST(EglSamplerTest, MoreMapsThanOneSubmissionHoldsAreTakenInParts) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(device);
  SceneMaker maker(9);
  SceneMirror mirror;
  ASSERT_TRUE(mirror.apply(maker.scene(10), {}));
  std::vector<MapRequest> requests = some_requests(maker, 1);
  requests.resize(MapRenderer::kMaxMaps + 5, requests[0]);
  std::vector<DepthMap> maps;
  ASSERT_TRUE(device.make_sampler()->take(mirror, requests, maps));
  ASSERT_EQ(maps.size(), requests.size());
  for (const DepthMap& map : maps) ASSERT_EQ(map.occluder, maps[0].occluder);
}

TEST(EglDeviceTest, AWrongIndexAndSoftwareWhereAGpuIsRequiredAreRefusedByName) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(device);
  const auto wrong = make_egl_sampler_device({.device_index = 63});
  ASSERT_FALSE(wrong);
  EXPECT_EQ(wrong.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(wrong.error().field, "--egl-device");
  for (const EglDeviceInfo& info : list_egl_devices({})) {
    if (!info.software || info.index < 0) continue;  // -1 asks for the best one
    const auto refused = make_egl_sampler_device({.device_index = info.index, .require_gpu = true});
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().field, "--require-gpu");
  }
  EXPECT_EQ(device.kind(), "egl");
}

TEST(EglDeviceTest, TheListNamesEveryDeviceAndExactlyOneChoice) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(device);
  const std::vector<EglDeviceInfo> list = list_egl_devices({});
  ASSERT_FALSE(list.empty());
  EXPECT_EQ(std::ranges::count_if(list, [](const EglDeviceInfo& info) { return info.chosen; }), 1);
  for (const EglDeviceInfo& info : list) {
    EXPECT_NE(info.renderer.empty(), info.trouble.empty());
    if (info.chosen) {
      EXPECT_NE(device.description().find(info.renderer), std::string::npos);
    }
  }
}

// Maps of many sizes at now and ahead, some of them sights.
std::vector<MapRequest> mixed_requests(SceneMaker& maker, int count) {
  std::vector<MapRequest> requests = some_requests(maker, count);
  for (size_t i = 0; i < requests.size(); ++i) {
    if (i % 4 == 0) requests[i].view.width = requests[i].view.height = 1;
    if (i % 5 == 0) requests[i].ahead_s = 0.4;
  }
  return requests;
}

// One session of a round: a scene that moves, and what it asks for.
struct Session {
  SceneMirror mirror;
  std::vector<MapRequest> requests;
  explicit Session(uint64_t seed, int maps) {
    SceneMaker maker(seed);
    EXPECT_TRUE(mirror.apply(maker.scene(25), {}));
    EXPECT_TRUE(mirror.apply({}, maker.moves(mirror, 25)));
    requests = mixed_requests(maker, maps);
  }
};

TEST(EglVariantTest, EveryWayTakesTheSameMaps) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(reference);
  constexpr uint64_t kScenes = 60;
  std::vector<std::vector<DepthMap>> expected(kScenes);
  size_t hits = 0;
  for (uint64_t seed = 0; seed < kScenes; ++seed) {
    const Session session(seed, 40);
    ASSERT_TRUE(reference.make_sampler()->take(session.mirror, session.requests, expected[seed]));
    for (const DepthMap& map : expected[seed])
      hits += map.occluder.size() - static_cast<size_t>(std::ranges::count(map.occluder, kNoOccluder));
  }
  EXPECT_GT(hits, 50000u);
  for (const bool geometry_shader : {false, true})
    for (const EglVariant& variant : all_egl_variants()) {
      SCOPED_TRACE(to_string(variant));
      auto other = test::make_egl_for_tests({.variant = variant, .layers_by_geometry_shader = geometry_shader});
      ASSERT_TRUE(other.device) << other.why_not;
      const auto sampler = other.device->make_sampler();
      std::vector<DepthMap> maps;
      for (uint64_t seed = 0; seed < (geometry_shader ? 5 : kScenes); ++seed) {
        const Session session(seed, 40);
        ASSERT_TRUE(other.device->make_sampler()->take(session.mirror, session.requests, maps));
        expect_equal(maps, expected[seed]);
      }
    }
}

TEST(EglVariantTest, MapsTakenTogetherAreThoseTakenAlone) {
  for (const EglVariant& variant : all_egl_variants()) {
    SCOPED_TRACE(to_string(variant));
    SIGHTLINE_EGL_DEVICE_OR_SKIP(device, {.variant = variant});
    std::vector<std::unique_ptr<Session>> sessions;
    std::vector<std::unique_ptr<Sampler>> samplers;
    std::vector<std::vector<DepthMap>> alone, together(12);
    std::vector<TakeJob> jobs;
    for (uint64_t i = 0; i < 12; ++i) {
      // The sixth asks for nothing.
      sessions.push_back(std::make_unique<Session>(900 + i, i == 5 ? 0 : 3 + 4 * static_cast<int>(i)));
      samplers.push_back(device.make_sampler());
      ASSERT_TRUE(device.make_sampler()->take(sessions[i]->mirror, sessions[i]->requests, alone.emplace_back()));
      jobs.push_back({samplers[i].get(), &sessions[i]->mirror, sessions[i]->requests, &together[i], {}});
    }
    for (int again = 0; again < 2; ++again) {
      if (again) device.simulate_context_loss();
      device.take_all(jobs);
      for (size_t i = 0; i < jobs.size(); ++i) {
        ASSERT_TRUE(jobs[i].taken);
        expect_equal(together[i], alone[i]);
      }
    }
    EXPECT_EQ(samplers[3]->maps_taken(), 2 * sessions[3]->requests.size());
  }
}

TEST(EglVariantTest, IsMeasuredUnlessOneIsAskedFor) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(measured, {});
  EXPECT_NE(measured.variant_reason().find("the fastest of 8: "), std::string::npos);
  EXPECT_NE(measured.description().find(measured.variant_reason()), std::string::npos);
  EXPECT_GE(measured.best_batch(), 1u);
  const EglVariant asked{Detail::kClusters, true, true};
  const auto forced = test::make_egl_for_tests({.variant = asked});
  ASSERT_TRUE(forced.device);
  EXPECT_EQ(forced.device->variant_reason(), "clusters+per-map+ring, as asked for");
}

TEST(EglVariantTest, NamesAreReadAsTheyAreWritten) {
  const auto all = all_egl_variants();
  EXPECT_EQ(all.size(), 8u);
  for (const EglVariant& variant : all) EXPECT_EQ(parse_egl_variant(to_string(variant)), variant);
  for (const char* wrong : {"", "auto", "triangles", "triangles+at-once", "clusters+at-once+ring "})
    EXPECT_FALSE(parse_egl_variant(wrong)) << wrong;
}

TEST(EglMeasureTest, TheFirstOfTheFastIsTakenAndTheBatchFollowsWhatASubmissionCosts) {
  const EglVariant a{Detail::kTriangles, false, false}, b{Detail::kTriangles, true, false},
      c{Detail::kClusters, false, false};
  const std::vector<EglTiming> timings{{c, 5.0, 9.0}, {b, 1.05, 8.0}, {a, 1.0, 8.0}};
  EXPECT_EQ(fastest(timings).variant, b);
  EXPECT_EQ(best_batch({a, 1.0, 8.0}), 1u);   // eight sessions cost eight times one
  EXPECT_EQ(best_batch({a, 1.0, 4.5}), 10u);  // half of what one costs is the submission
  EXPECT_EQ(best_batch({a, 1.0, 1.0}), 64u);  // nothing else costs
}

TEST(RunAllocatorTest, RunsNeverOverlapAndJoinWhenGivenBack) {
  constexpr uint32_t kSize = 1000;
  CounterRandom random(5, 0, RandomPurpose::kTest);
  RunAllocator runs(kSize);
  std::vector<std::pair<uint32_t, uint32_t>> taken;
  std::vector<char> used(kSize);
  for (int i = 0; i < 5000; ++i) {
    if (random.next_below(2) == 0) {
      const uint32_t count = 1 + random.next_below(60), first = runs.take(count);
      if (first == UINT32_MAX) continue;
      for (uint32_t k = first; k < first + count; ++k) ASSERT_FALSE(std::exchange(used.at(k), 1));
      taken.emplace_back(first, count);
    } else if (!taken.empty()) {
      std::swap(taken[random.next_below(static_cast<uint32_t>(taken.size()))], taken.back());
      const auto [first, count] = taken.back();
      taken.pop_back();
      runs.give_back(first, count);
      std::fill_n(used.begin() + first, count, 0);
    }
  }
  for (const auto& [first, count] : taken) runs.give_back(first, count);
  EXPECT_TRUE(runs.all_free(kSize));
}

}  // namespace
}  // namespace sightline
