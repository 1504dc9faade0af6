// A step fails when its maps cannot be taken, and leaves no trace: the next step answers as if the failed one had not
// been tried.
#include <gtest/gtest.h>

#include "server/base/random.h"
#include "tests/session/game.h"

namespace sightline::test {
namespace {

constexpr double kTickS = 1.0 / 64;

// Embree's maps, except for the steps that are meant to fail.
class FlakySampler : public Sampler {
 public:
  Status take(const SceneMirror& mirror, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) override {
    if (fails) return fail(ErrorCode::kUnavailable, "", "the device was lost");
    return inner_->take(mirror, requests, maps);
  }
  bool fails = false;

 private:
  std::unique_ptr<SamplerDevice> device_ = make_embree_sampler_device();
  std::unique_ptr<Sampler> inner_ = device_->make_sampler();
};

// Ann and Bob walk in circles past the wall, filmed with the default settings.
struct Stroll : Game {
  Stroll() {
    SessionOptions options = make_options();
    options.settings = preset_settings(Preset::kSightline);
    options.extents = &extents_;
    auto made = std::make_unique<FlakySampler>();
    sampler = made.get();
    session = std::move(*Session::open(std::move(options), std::move(made), nullptr));
  }
  TickMaker next() {
    TickMaker next = tick(kTickS);
    for (const uint64_t id : {kAnn, kBob}) {
      const double angle = 1.3 * time_s + 2.0 * static_cast<double>(id);
      next.move(id, {2 * std::sin(angle), 1, 2 * std::cos(angle)});
    }
    return next;
  }
  void fail_a_step() {
    sampler->fails = true;
    EXPECT_FALSE(session->step().has_value());
    sampler->fails = false;
  }

  FlakySampler* sampler = nullptr;

 private:
  ExtentCache extents_;
};

void expect_same(const SessionAnswer& a, const SessionAnswer& b) {
  EXPECT_EQ(a.step.camera.pose.position_m, b.step.camera.pose.position_m);
  EXPECT_EQ(a.step.camera.pose.rotation, b.step.camera.pose.rotation);
  EXPECT_EQ(a.step.camera.velocity_mps, b.step.camera.velocity_mps);
  EXPECT_EQ(a.step.camera.angular_velocity_radps, b.step.camera.angular_velocity_radps);
  EXPECT_EQ(a.lens.vertical_fov_rad, b.lens.vertical_fov_rad);
  EXPECT_EQ(a.step.reason, b.step.reason);
  EXPECT_EQ(a.step.chosen_candidate, b.step.chosen_candidate);
  EXPECT_EQ(a.merged_ticks, b.merged_ticks);
  EXPECT_EQ(a.cut, b.cut);
  ASSERT_EQ(a.step.targets.size(), b.step.targets.size());
  for (size_t i = 0; i < a.step.targets.size(); ++i) {
    EXPECT_EQ(a.step.targets[i].visible_share, b.step.targets[i].visible_share);
    EXPECT_EQ(a.step.targets[i].filtered_share, b.step.targets[i].filtered_share);
    EXPECT_EQ(a.step.targets[i].filtered_visible, b.step.targets[i].filtered_visible);
  }
}

// One session tries some steps that fail; the other one never tries them.
TEST(FailedStep, ItsTimeCountsOnce) {
  Stroll failing, waiting;
  CounterRandom random(17, 0, RandomPurpose::kTest);
  int failed = 0;
  for (int i = 0; i < 300; ++i) {
    failing.apply(failing.next()), waiting.apply(waiting.next());
    if (random.next_below(4) == 0) {
      failing.fail_a_step(), ++failed;
      continue;
    }
    expect_same(failing.answer(), waiting.answer());
    if (HasFailure()) FAIL() << "tick " << i;
  }
  EXPECT_GT(failed, 50);
}

// Lens, settings, targets and the observed camera change from tick to tick, and back, whether the tick's step fails or
// not.
TEST(FailedStep, LeavesNoTraceOfWhatChanged) {
  Stroll failing, waiting;
  CounterRandom random(18, 0, RandomPurpose::kTest);
  const StepSettings first = failing.session->settings();
  for (int i = 0; i < 300; ++i) {
    TickMaker tick = failing.next();
    waiting.next();
    StepSettings settings = first;
    if (random.next_below(3) == 0) settings.move.search_viewpoints = false;
    if (random.next_below(3) == 0) settings.move.strategy = Strategy::kRobust;
    if (random.next_below(3) == 0) settings.bound.horizon_s = settings.bound.max_horizon_s = 1.0;
    if (random.next_below(3) == 0)
      settings.framing.min_vertical_fov_rad = 0.3, settings.framing.max_vertical_fov_rad = 0.5;
    tick.settings = settings;
    if (random.next_below(4) == 0) tick.lens.emplace().vertical_fov_rad = random.next_in(0.5, 0.8);
    if (random.next_below(4) == 0) {
      tick.targets = {Game::target(kAnn), Game::target(kBob)};
      (*tick.targets)[random.next_below(2)].weight = random.next_below(2);
    }
    if (random.next_below(20) == 0) tick.observed_camera = seen_at({4, 2, 5}, random.next_below(2) == 0);
    failing.apply(tick), waiting.apply(tick);
    if (random.next_below(3) == 0) {
      failing.fail_a_step();
      continue;
    }
    expect_same(failing.answer(), waiting.answer());
    if (HasFailure()) FAIL() << "tick " << i;
  }
}

}  // namespace
}  // namespace sightline::test
