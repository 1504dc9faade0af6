// Sessions of one Embree device share scenes, and no session sees the changes of another.
#include <gtest/gtest.h>

#include <algorithm>
#include <thread>

#include "server/sample/embree_sampler.h"
#include "tests/sample/brute_force.h"
#include "tests/sample/scene_maker.h"

namespace sightline {
namespace {

using test::brute_trace;
using test::SceneMaker;

// One session: its mirror and its sampler.
struct Session {
  SceneMirror mirror;
  std::unique_ptr<Sampler> sampler;
  std::vector<DepthMap> maps;

  Session(SamplerDevice& device, const SceneDelta& scene) : sampler(device.make_sampler()) {
    EXPECT_TRUE(mirror.apply(scene, {}));
  }
  const DepthMap& look(const MapRequest& request) {
    EXPECT_TRUE(sampler->take(mirror, {&request, 1}, maps));
    return maps[0];
  }
  void hide(uint64_t id) {
    SceneDelta delta;
    delta.change.push_back({id, {.visible = false}});
    EXPECT_TRUE(mirror.apply(delta, {}));
  }
};

// A field of boxes, none moving.
SceneDelta field(SceneMaker& maker, int count) {
  SceneDelta delta;
  for (int i = 0; i < count; ++i) {
    delta.add.push_back(maker.instance(static_cast<uint64_t>(i) + 1));
    delta.add.back().moving = false;
    delta.add.back().attributes = {};
  }
  return delta;
}

bool is_as_brute_force(Session& session, const MapRequest& request) {
  const DepthMap& map = session.look(request);
  int different = 0;
  for (int y = 0; y < map.view.height; ++y)
    for (int x = 0; x < map.view.width; ++x)
      different += map.occluder_at(x, y) != brute_trace(session.mirror, true, map.view.eye_m,
                                                        texel_direction(map.view, x, y), map.view.near_m, {})
                                                .slot;
  return different <= 1;
}

class EmbreeSharingTest : public ::testing::Test {
 protected:
  std::unique_ptr<SamplerDevice> device_ = make_embree_sampler_device();
  SceneMaker maker_{31};
};

TEST_F(EmbreeSharingTest, SessionsWithEqualStaticInstancesCostEmbreeNothingMore) {
  const SceneDelta scene = field(maker_, 500);
  const MapRequest request{.view = maker_.view()};
  std::vector<std::unique_ptr<Session>> sessions;
  sessions.push_back(std::make_unique<Session>(*device_, scene));
  sessions[0]->look(request);
  const size_t one = device_->geometry_bytes();
  for (int i = 0; i < 20; ++i) {
    sessions.push_back(std::make_unique<Session>(*device_, scene));
    sessions.back()->look(request);
  }
  EXPECT_EQ(device_->geometry_bytes(), one);
  sessions.back()->hide(7);
  sessions.back()->look(request);
  EXPECT_GT(device_->geometry_bytes(), one) << "what differs is not shared";
  sessions.pop_back();
  EXPECT_EQ(device_->geometry_bytes(), one) << "and is gone with its session";
}

TEST_F(EmbreeSharingTest, NoSessionSeesWhatAnotherChanges) {
  const SceneDelta scene = field(maker_, 12);
  MapRequest request{.view = maker_.view()};
  std::vector<std::unique_ptr<Session>> sessions;
  for (int i = 0; i < 3; ++i) sessions.push_back(std::make_unique<Session>(*device_, scene));
  for (int round = 0; round < 20; ++round) {
    Session& changed = *sessions[maker_.random().next_below(static_cast<uint32_t>(sessions.size()))];
    const uint64_t id = 1 + maker_.random().next_below(12);
    if (round % 3 == 0)
      changed.hide(id);
    else
      ASSERT_TRUE(changed.mirror.apply({}, {.ids = {id},
                                            .poses = {maker_.pose()},
                                            .velocities_mps = {},
                                            .angular_velocities_radps = {},
                                            .corrections_m = {}}));
    request.view = maker_.view();
    for (const auto& session : sessions) EXPECT_TRUE(is_as_brute_force(*session, request));
    if (round == 10) sessions.erase(sessions.begin());  // the first session, which built the shared scenes
  }
}

TEST_F(EmbreeSharingTest, LayersAndContentAreToldApart) {
  SceneDelta scene = field(maker_, 12), other = scene;
  for (NewInstance& instance : other.add) instance.attributes.layers = 2;
  Session first(*device_, scene), second(*device_, other);
  const MapRequest all{.view = maker_.view()}, of_layer_1{.view = all.view, .layer_mask = 1};
  EXPECT_EQ(first.look(all).occluder, second.look(all).occluder);
  const auto nothing = [](const DepthMap& map) {
    return std::ranges::count(map.occluder, kNoOccluder) == std::ssize(map.occluder);
  };
  EXPECT_FALSE(nothing(first.look(of_layer_1)));
  EXPECT_TRUE(nothing(second.look(of_layer_1)));
}

// Sessions on several threads open, change and close over one device; each sees its own scene throughout.
TEST_F(EmbreeSharingTest, ThreadsSeeTheirOwnScenes) {
  const SceneDelta scene = field(maker_, 40);
  std::vector<MapRequest> requests;
  for (int i = 0; i < 4; ++i) requests.push_back({.view = maker_.view()});
  const auto live = [&](SamplerDevice& device, uint64_t seed) {
    SceneMaker maker(seed);
    std::vector<std::vector<uint32_t>> seen;
    for (int life = 0; life < 6; ++life) {
      Session session(device, scene);
      for (int tick = 0; tick < 15; ++tick) {
        // Every thread hides instances in the same order, so that all ask for the same scenes.
        if (tick % 5 == 4) session.hide(static_cast<uint64_t>(tick + life));
        EXPECT_TRUE(session.mirror.apply({}, maker.moves(session.mirror, 3)));
        for (const MapRequest& request : requests) seen.push_back(session.look(request).occluder);
      }
    }
    return seen;
  };
  std::vector<std::vector<std::vector<uint32_t>>> got(3), want(3);
  std::vector<std::thread> threads;
  for (uint64_t i = 0; i < got.size(); ++i) threads.emplace_back([&, i] { got[i] = live(*device_, 90 + i); });
  for (std::thread& thread : threads) thread.join();
  for (uint64_t i = 0; i < want.size(); ++i) want[i] = live(*make_embree_sampler_device(), 90 + i);
  EXPECT_EQ(got, want);
}

}  // namespace
}  // namespace sightline
