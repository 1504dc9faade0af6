// Promises of the EGL device beyond correct maps: sessions on several threads, sessions taken together, recovery from a
// lost context.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <thread>

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

// The median over texels that show anything.
double median_distance_m(const std::vector<DepthMap>& maps) {
  std::vector<float> seen_m;
  for (const DepthMap& map : maps)
    for (const float distance_m : map.distance_m)
      if (std::isfinite(distance_m)) seen_m.push_back(distance_m);
  if (seen_m.empty()) return 1.0;
  std::nth_element(seen_m.begin(), seen_m.begin() + static_cast<ptrdiff_t>(seen_m.size() / 2), seen_m.end());
  return seen_m[seen_m.size() / 2];
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
  device.simulate_context_loss();
  ASSERT_TRUE(sampler->take(mirror, requests, after));
  EXPECT_EQ(device.context_rebuilds(), 1u);
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

TEST(EglSamplerTest, AMapThatEndsShowsAllThatIsNearer) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(device);
  const auto sampler = device.make_sampler();
  size_t nearer = 0, left_out = 0;
  for (uint64_t seed = 0; seed < 20; ++seed) {
    SceneMaker maker(seed);
    SceneMirror mirror;
    ASSERT_TRUE(mirror.apply(maker.scene(25), {}));
    std::vector<MapRequest> requests = some_requests(maker, 8);
    std::vector<DepthMap> endless, ended;
    ASSERT_TRUE(sampler->take(mirror, requests, endless));
    const double far_m = median_distance_m(endless);
    for (MapRequest& request : requests) request.far_m = far_m;
    ASSERT_TRUE(sampler->take(mirror, requests, ended));
    for (size_t i = 0; i < endless.size(); ++i)
      for (size_t texel = 0; texel < endless[i].distance_m.size(); ++texel) {
        const int width = endless[i].view.width, x = static_cast<int>(texel) % width,
                  y = static_cast<int>(texel) / width;
        const bool is_nearer = endless[i].depth_at(x, y) <= far_m;
        nearer += is_nearer;
        left_out += ended[i].occluder[texel] == kNoOccluder && endless[i].occluder[texel] != kNoOccluder;
        if (!is_nearer) {
          EXPECT_GT(ended[i].depth_at(x, y), far_m);  // nothing, or another instance beyond the limit
          continue;
        }
        EXPECT_EQ(ended[i].occluder[texel], endless[i].occluder[texel]);
        EXPECT_EQ(ended[i].distance_m[texel], endless[i].distance_m[texel]);
      }
  }
  EXPECT_GT(nearer, 1000u);
  EXPECT_GT(left_out, 1000u);
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
      EXPECT_NE(device.renderer().find(info.renderer), std::string::npos);
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

// Jobs are split into submissions of at most 16 maps: in the middle of a session, and with many sizes in one
// submission.
TEST(EglSamplerTest, MapsTakenTogetherAreThoseTakenAlone) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(device);
  std::vector<std::unique_ptr<Session>> sessions;
  std::vector<std::unique_ptr<Sampler>> samplers;
  std::vector<std::vector<DepthMap>> alone, together(12);
  std::vector<TakeJob> jobs;
  size_t hits = 0;
  for (uint64_t i = 0; i < 12; ++i) {
    // The sixth session requests no maps.
    sessions.push_back(std::make_unique<Session>(900 + i, i == 5 ? 0 : 3 + 4 * static_cast<int>(i)));
    samplers.push_back(device.make_sampler());
    ASSERT_TRUE(device.make_sampler()->take(sessions[i]->mirror, sessions[i]->requests, alone.emplace_back()));
    jobs.push_back({samplers[i].get(), &sessions[i]->mirror, sessions[i]->requests, &together[i], {}});
    for (const DepthMap& map : alone[i])
      hits += map.occluder.size() - static_cast<size_t>(std::ranges::count(map.occluder, kNoOccluder));
  }
  EXPECT_GT(hits, 5000u);
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

TEST(EglSamplerTest, AViewThatIsNotFiniteFailsItsOwnTakeOnly) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(device);
  SceneMaker maker(9);
  SceneMirror mirror;
  ASSERT_TRUE(mirror.apply(maker.scene(20), {}));
  const auto good = some_requests(maker, 4);
  auto bad = good;
  bad[2].view.eye_m.y = std::nan("");
  std::vector<std::unique_ptr<Sampler>> samplers;
  std::vector<std::vector<DepthMap>> maps(3);
  std::vector<TakeJob> jobs;
  for (size_t i = 0; i < maps.size(); ++i) {
    samplers.push_back(device.make_sampler());
    jobs.push_back({.sampler = samplers[i].get(),
                    .mirror = &mirror,
                    .requests = i == 0 ? bad : good,
                    .maps = &maps[i],
                    .taken = {}});
  }
  device.take_all(jobs);
  ASSERT_FALSE(jobs[0].taken);
  EXPECT_EQ(jobs[0].taken.error().code, ErrorCode::kInternal);
  std::vector<DepthMap> alone;
  ASSERT_TRUE(device.make_sampler()->take(mirror, good, alone));
  for (const size_t i : {1u, 2u}) {
    EXPECT_TRUE(jobs[i].taken);
    expect_equal(alone, maps[i]);
  }
  EXPECT_FALSE(samplers[0]->take(mirror, bad, maps[0]));
  device.take_all(std::span(jobs).first(1));
  EXPECT_FALSE(jobs[0].taken);
}

// Other maps in a submission change no bit of a map.
TEST(EglSamplerTest, AMapIsTheSameWhereverItStandsInASubmission) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(device);
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const Session session(seed, 40);
    const auto sampler = device.make_sampler();
    std::vector<DepthMap> all, one;
    ASSERT_TRUE(sampler->take(session.mirror, session.requests, all));
    for (size_t i = 0; i < all.size(); ++i) {
      ASSERT_TRUE(sampler->take(session.mirror, std::span(session.requests).subspan(i, 1), one));
      expect_equal(one, {all[i]});
    }
  }
}

TEST(EglSamplerTest, OnlyHardwareGainsByTakingSessionsTogether) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(device);
  const auto info = choose_egl_device({});
  ASSERT_TRUE(info);
  EXPECT_EQ(device.best_batch() == 1, info->software);
}

}  // namespace
}  // namespace sightline
