// A step whose maps cannot be taken fails, and leaves no trace: the next step answers as if it had not been tried.
#include <gtest/gtest.h>

#include "server/base/random.h"
#include "server/step/presets.h"
#include "tests/session/game.h"

namespace sightline::test {
namespace {

constexpr double kTickS = 1.0 / 64;

// Embree's maps, but for the steps that shall fail.
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

// Two people who walk in circles past the wall, filmed with the default settings.
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

}  // namespace
}  // namespace sightline::test
