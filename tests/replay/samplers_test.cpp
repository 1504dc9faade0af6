// One recording, two samplers. Their maps differ only in texels through which a silhouette passes. So from the same
// memory a step is nearly always the same, but over many steps small differences may grow, as they do between two
// seeds.
#include <gtest/gtest.h>

#include "client/replay/result.h"
#include "server/gl/software_renderer.h"
#include "server/sample/sampler_choice.h"
#include "tests/replay/recorded_hall.h"
#include "tests/replay/replayed.h"

namespace sightline {
namespace {

// Makes every map with both samplers. Returns the map of the first one, and counts the texels in which the second one
// sees another instance. So each step is compared from exactly the memory that the first sampler led to.
struct Agreement {
  uint64_t texels = 0, same = 0;     // by what is seen there
  uint64_t maps = 0, same_maps = 0;  // in every texel
  double share() const { return static_cast<double>(same) / static_cast<double>(texels); }
  double share_of_maps() const { return static_cast<double>(same_maps) / static_cast<double>(maps); }
};

class BothSampler final : public Sampler {
 public:
  BothSampler(std::unique_ptr<Sampler> first, std::unique_ptr<Sampler> second, Agreement& agreement)
      : first_(std::move(first)), second_(std::move(second)), agreement_(agreement) {}
  Status take(const SceneMirror& mirror, std::span<const MapRequest> requests, std::vector<DepthMap>& maps) override {
    if (Status taken = second_->take(mirror, requests, others_); !taken) return taken;
    if (Status taken = first_->take(mirror, requests, maps); !taken) return taken;
    for (size_t i = 0; i < maps.size(); ++i) {
      // Surfaces beyond the requested depth need not be found.
      const auto seen = [far_m = requests[i].far_m](const DepthMap& map, size_t texel) {
        const int width = map.view.width, x = static_cast<int>(texel) % width, y = static_cast<int>(texel) / width;
        return map.depth_at(x, y) <= far_m ? map.occluder[texel] : kNoOccluder;
      };
      uint64_t same = 0;
      for (size_t k = 0; k < maps[i].occluder.size(); ++k) same += seen(maps[i], k) == seen(others_[i], k);
      agreement_.texels += maps[i].occluder.size();
      agreement_.same += same;
      agreement_.same_maps += same == maps[i].occluder.size();
    }
    agreement_.maps += maps.size();
    return {};
  }

 private:
  const std::unique_ptr<Sampler> first_, second_;
  Agreement& agreement_;
  std::vector<DepthMap> others_;
};

class BothDevice final : public SamplerDevice {
 public:
  BothDevice(SamplerDevice& first, SamplerDevice& second, Agreement& agreement)
      : first_(first), second_(second), agreement_(agreement) {}
  std::unique_ptr<Sampler> make_sampler() override {
    return std::make_unique<BothSampler>(first_.make_sampler(), second_.make_sampler(), agreement_);
  }
  std::string kind() const override { return first_.kind(); }
  std::string renderer() const override { return first_.renderer(); }
  size_t geometry_bytes() const override { return first_.geometry_bytes(); }

 private:
  SamplerDevice &first_, &second_;
  Agreement& agreement_;
};

class TwoSamplers : public testing::Test {
 protected:
  void SetUp() override {
    prepare_software_rendering();
    auto chosen = choose_sampler_device(SamplerChoice::kEgl, {});
    if (!chosen) GTEST_SKIP() << "no EGL context: " << to_string(chosen.error());
    egl_ = std::move(chosen->device);
  }
  std::unique_ptr<SamplerDevice> egl_;
  const std::unique_ptr<SamplerDevice> embree_ = make_embree_sampler_device();
};

// README.md beside this file has the measured values; these bounds leave some room.
constexpr double kSameTexels = 0.999, kSameMaps = 0.99;

TEST_F(TwoSamplers, SeeTheSameInNearlyEveryMapOfASession) {
  Agreement agreement;
  BothDevice both(*embree_, *egl_, agreement);
  const test::RecordedHall hall = test::record_hall(both, {.ticks = 240});
  // Taking every map twice changes nothing in the session.
  EXPECT_EQ(hall.hash, test::record_hall(*embree_, {.ticks = 240}).hash);
  EXPECT_GT(agreement.maps, 1000u);
  EXPECT_GT(agreement.share(), kSameTexels);
  EXPECT_GT(agreement.share_of_maps(), kSameMaps);
  RecordProperty("same_texels", std::to_string(agreement.share()));
  RecordProperty("same_maps", std::to_string(agreement.share_of_maps()));
}

// One second of open loop: the recorded ticks steer both sessions.
TEST_F(TwoSamplers, CamerasStayTogetherForASecond) {
  const test::RecordedHall hall = test::record_hall(*embree_, {.ticks = 60});
  const auto place = make_local_backend(std::move(egl_));
  const test::Replayed replayed = test::replay_on(*place, test::open_recording(hall.bytes), {}, "another sampler");
  EXPECT_EQ(replayed.replies, 60u);
  EXPECT_LE(replayed.position_m, kVisibleJumpM) << replayed.text;
  EXPECT_NE(replayed.verdict, ReplayVerdict::kDiffers) << replayed.text;
}

}  // namespace
}  // namespace sightline
