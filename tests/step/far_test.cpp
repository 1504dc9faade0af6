// Maps end where no candidate is looked up any more (MapRequest::far_m). The steps must be the same, bit for bit, as
// with maps that do not end.
#include <algorithm>
#include <cstring>

#include "server/base/random.h"
#include "tests/support/world.h"

namespace sightline {
namespace {

using test::World;

// A sampler that ignores the requested end and takes maps without one.
class EndlessSampler final : public Sampler {
 public:
  explicit EndlessSampler(std::unique_ptr<Sampler> inner) : inner_(std::move(inner)) {}
  Status take(const SceneMirror& mirror, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) override {
    requests_.assign(requests.begin(), requests.end());
    for (MapRequest& request : requests_) request.far_m = std::numeric_limits<double>::infinity();
    return inner_->take(mirror, requests_, maps);
  }

 private:
  std::unique_ptr<Sampler> inner_;
  std::vector<MapRequest> requests_;
};

class EndlessDevice final : public SamplerDevice {
 public:
  std::unique_ptr<Sampler> make_sampler() override { return std::make_unique<EndlessSampler>(inner_->make_sampler()); }
  std::string kind() const override { return inner_->kind(); }
  std::string renderer() const override { return inner_->renderer(); }
  size_t geometry_bytes() const override { return inner_->geometry_bytes(); }

 private:
  std::unique_ptr<SamplerDevice> inner_ = make_embree_sampler_device();
};

// Pillars and walls at random positions, some of them moving, and two targets that walk among them.
struct Plaza {
  World world;
  CounterRandom random;

  Plaza(uint64_t seed, std::unique_ptr<SamplerDevice> device)
      : world(std::move(device)), random(seed, 0, RandomPurpose::kTest) {
    for (uint64_t id = 10; id < 60; ++id) {
      const glm::dvec3 at(random.next_in(-25, 25), 1.5, random.next_in(-25, 25));
      world.add_box(id, at, {random.next_in(0.1, 0.8), 1.5f, random.next_in(0.1, 0.8)});
    }
    world.add_target(1, {0, 0.9, 0});
    world.add_target(2, {1.2, 0.9, 0.3});
    world.limits.max_speed_mps = 6;
    world.place({2, 2.2, 6}, {0.5, 1, 0});
  }
  StepResult step(int tick) {
    const double t = tick / 60.0;
    world.move(1, {1.5 * t, 0.9, 2 * std::sin(t)}, {1.5, 0, 2 * std::cos(t)});
    world.move(2, {1.2 + 1.5 * t, 0.9, 0.3 + 2 * std::sin(t)}, {1.5, 0, 2 * std::cos(t)});
    for (uint64_t id = 10; id < 16; ++id)
      world.move(id, {3.0 * static_cast<double>(id) - 38 + 2 * t, 1.5, 4 * std::sin(t + static_cast<double>(id))},
                 {2, 0, 0});
    return world.step(1.0 / 60);
  }
};

void expect_same_steps(const StepSettings& settings, uint64_t seed) {
  Plaza ending(seed, make_embree_sampler_device()), endless(seed, std::make_unique<EndlessDevice>());
  ending.world.settings = endless.world.settings = settings;
  size_t hidden = 0, ended = 0;
  for (int tick = 0; tick < 150; ++tick) {
    const StepResult a = ending.step(tick), b = endless.step(tick);
    const StepDump &m = ending.world.dump(), &n = endless.world.dump();
    ASSERT_EQ(std::memcmp(&m.decision.camera.pose, &n.decision.camera.pose, sizeof(Pose)), 0)
        << "seed " << seed << ", tick " << tick;
    ASSERT_EQ(m.sights.candidates.visible_targets, n.sights.candidates.visible_targets);
    ASSERT_TRUE(std::ranges::equal(m.sights.candidates.ahead(), n.sights.candidates.ahead()));
    ASSERT_EQ(m.sights.hidden, n.sights.hidden);
    ASSERT_EQ(a.targets.size(), b.targets.size());
    for (size_t i = 0; i < a.targets.size(); ++i) {
      ASSERT_EQ(a.targets[i].visible_share, b.targets[i].visible_share);
      ASSERT_EQ(a.targets[i].filtered_share, b.targets[i].filtered_share);
      ASSERT_EQ(a.targets[i].main_occluder_id(), b.targets[i].main_occluder_id());
    }
    hidden += m.sights.counts.total - m.sights.counts.all_visible;
    for (size_t i = 0; i < m.maps.size(); ++i)
      for (size_t texel = 0; texel < m.maps[i].occluder.size(); ++texel)
        ended += m.maps[i].occluder[texel] != n.maps[i].occluder[texel];
  }
  EXPECT_GT(hidden, 1000u) << "places from which something is hidden";
  // The maps of pair volumes have no end.
  if (settings.aggregate.volume == Volume::kLattice) {
    EXPECT_GT(ended, 1000u) << "texels that ended before what they would show";
  }
}

TEST(FarEnd, ChangesNoStepOfTheDefault) {
  for (uint64_t seed = 1; seed <= 3; ++seed) expect_same_steps(preset_settings(Preset::kSightline), seed);
}

TEST(FarEnd, ChangesNoStepOfThePapersMethod) {
  expect_same_steps(preset_settings(Preset::kPaper), 4);
}

TEST(FarEnd, ChangesNoStepOfPlainStrategies) {
  StepSettings settings = preset_settings(Preset::kSightline);
  settings.move.strategy = Strategy::kBasic;
  settings.sample.resolution = 16;
  expect_same_steps(settings, 5);
}

}  // namespace
}  // namespace sightline
