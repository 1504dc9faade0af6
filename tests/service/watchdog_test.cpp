// The watchdog, the state that it sets, and the step that a daemon tries at its start.
#include "server/service/watchdog.h"

#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>

#include "server/service/daemon_state.h"
#include "server/service/self_test.h"
#include "tests/service/service_world.h"

namespace sightline {
namespace {

using Names = std::vector<std::string>;
using Seconds = Watchdog::Seconds;

TEST(Watchdog, NamesWhatIsSilentForLongerThanTheLimit) {
  std::atomic<double> loop_s{0.5}, step_s{10.0};
  std::mutex mutex;
  std::condition_variable changed;
  Names seen{"nothing yet"};
  const Watchdog watchdog(
      {{"loop", [&] { return Seconds(loop_s.load()); }}, {"step", [&] { return Seconds(step_s.load()); }}},
      Seconds(10.0), Seconds(0.001), [&](const Names& hanging) {
        const std::lock_guard lock(mutex);
        seen = hanging;
        changed.notify_all();
      });
  const auto sees = [&](const Names& expected) {
    std::unique_lock lock(mutex);
    return changed.wait_for(lock, std::chrono::seconds(30), [&] { return seen == expected; });
  };
  EXPECT_TRUE(sees({}));
  EXPECT_EQ(watchdog.hanging(), Names{});
  step_s = 10.1;
  EXPECT_TRUE(sees({"step"}));
  loop_s = 60.0;
  EXPECT_TRUE(sees({"loop", "step"}));
  EXPECT_EQ(watchdog.hanging(), (Names{"loop", "step"}));
  loop_s = step_s = 0.0;
  EXPECT_TRUE(sees({}));
}

TEST(DaemonState, IsReadyWhileItServesAndNothingHangs) {
  DaemonState state;
  EXPECT_EQ(state.why_not_ready(), "the daemon is starting");
  EXPECT_EQ(state.why_not_alive(), "");
  state.enter(DaemonState::Phase::kServing);
  EXPECT_TRUE(state.ready());
  EXPECT_TRUE(state.set_hanging({"gate", "step"}));
  EXPECT_FALSE(state.set_hanging({"gate", "step"})) << "nothing has changed";
  EXPECT_EQ(state.why_not_ready(), "does not answer: gate, step");
  EXPECT_EQ(state.why_not_alive(), state.why_not_ready());
  EXPECT_TRUE(state.set_hanging({}));
  EXPECT_TRUE(state.ready());
  state.enter(DaemonState::Phase::kStopping);
  EXPECT_EQ(state.why_not_ready(), "the daemon is stopping");
  EXPECT_EQ(state.why_not_alive(), "");
}

class FirstStep : public testing::Test {
 protected:
  GeometryStore geometry;
  ExtentCache extents;
  SceneLibrary scenes{"", GltfLimits{}, geometry};
  GatedDevice device;
  Scheduler scheduler{1, device, [] { return int64_t{0}; }};
  WorkerPool loaders{1}, uploaders{1};
  StreamRegistry streams{1};
  FairShares shares{1.0};
  StepStats stats;
  SessionTable sessions;
  Log log{LogFormat::kText, LogLevel::kOff};

  ServiceParts parts_with(SamplerDevice& sampler) {
    return {scenes,
            geometry,
            extents,
            sampler,
            scheduler,
            loaders,
            uploaders,
            streams,
            shares,
            stats,
            sessions,
            log,
            [] { return int64_t{0}; },
            "test"};
  }
};

TEST_F(FirstStep, SucceedsOnADeviceThatWorks) {
  const Status done = compute_first_step(parts_with(device));
  EXPECT_TRUE(done) << to_string(done.error());
  EXPECT_EQ(stats.steps, 0u) << "it is no step of a session";
}

TEST_F(FirstStep, FailsWithTheErrorOfTheDevice) {
  device.fail_next({ErrorCode::kUnavailable, "", "the context is lost"});
  const Status done = compute_first_step(parts_with(device));
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().message, "the context is lost");
}

// Takes the maps of an empty scene.
class BlindDevice final : public SamplerDevice {
 public:
  std::unique_ptr<Sampler> make_sampler() override { return std::make_unique<Blind>(inner_->make_sampler()); }
  std::string kind() const override { return "blind"; }
  std::string renderer() const override { return "blind"; }
  size_t geometry_bytes() const override { return 0; }

 private:
  class Blind final : public Sampler {
   public:
    explicit Blind(std::unique_ptr<Sampler> inner) : inner_(std::move(inner)) {}
    Status take(const SceneMirror&, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) override {
      return inner_->take(empty_, requests, maps);
    }

   private:
    const SceneMirror empty_;
    const std::unique_ptr<Sampler> inner_;
  };
  const std::unique_ptr<SamplerDevice> inner_ = make_embree_sampler_device();
};

TEST_F(FirstStep, FailsOnADeviceWhoseMapsShowNothing) {
  BlindDevice blind;
  const Status done = compute_first_step(parts_with(blind));
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::kInternal);
}

}  // namespace
}  // namespace sightline
