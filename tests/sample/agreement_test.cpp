// The promise of server/sample/sampler.h: EGL's maps equal Embree's, except where a silhouette passes.
#include <gtest/gtest.h>

#include "server/sample/embree_sampler.h"
#include "tests/sample/agreement.h"
#include "tests/sample/egl_device.h"
#include "tests/sample/scene_maker.h"

namespace sightline {
namespace {

using test::Agreement;
using test::SceneMaker;

// One mirror seen by both samplers, and by an Embree scene for the dense rays.
class Pair {
 public:
  Pair(SamplerDevice& egl, SamplerDevice& embree, EmbreeDevice& rays)
      : egl_(egl.make_sampler()), embree_(embree.make_sampler()), scene_(rays, EmbreeScene::Content::kOccluders) {}

  void compare(const SceneMirror& mirror, std::span<const MapRequest> requests, Agreement& agreement,
               double ahead_s = 0.0) {
    scene_.take_in(mirror, ahead_s);
    ASSERT_TRUE(egl_->take(mirror, requests, egl_maps_));
    ASSERT_TRUE(embree_->take(mirror, requests, embree_maps_));
    agreement.add(scene_, requests, egl_maps_, embree_maps_, tolerance);
  }

  test::Tolerance tolerance;
  const std::vector<DepthMap>& egl_maps() const { return egl_maps_; }
  const std::vector<DepthMap>& embree_maps() const { return embree_maps_; }

 private:
  std::unique_ptr<Sampler> egl_, embree_;
  EmbreeScene scene_;
  std::vector<DepthMap> egl_maps_, embree_maps_;
};

// Requests whose ignored slots live as long as they do.
struct Requests {
  std::vector<std::vector<uint32_t>> ignored;
  std::vector<MapRequest> all;
};

Requests random_requests(SceneMaker& maker, size_t slots) {
  Requests out;
  const uint32_t count = 1 + maker.random().next_below(3);
  for (uint32_t i = 0; i < count; ++i) {
    out.ignored.push_back(maker.ignored(slots));
    const uint32_t mask = maker.random().next_below(2) ? 0xFFFFFFFFu : 1 + maker.random().next_below(7);
    out.all.push_back({.view = maker.view(), .layer_mask = mask});
  }
  for (size_t i = 0; i < out.all.size(); ++i) out.all[i].ignored_slots = out.ignored[i];
  return out;
}

class AgreementTest : public ::testing::Test {
 protected:
  std::unique_ptr<SamplerDevice> embree_ = make_embree_sampler_device();
  EmbreeDevice rays_;
};

TEST_F(AgreementTest, AThousandRandomScenesDifferOnlyAtSilhouettes) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(egl);
  Agreement agreement;
  for (uint64_t seed = 0; seed < 1000; ++seed) {
    SceneMaker maker(seed);
    const uint32_t count = 4 + maker.random().next_below(12);
    SceneMirror mirror;
    ASSERT_TRUE(mirror.apply(maker.scene(count), {}));
    Pair pair(egl, *embree_, rays_);
    for (int take = 0; take < 2; ++take) {
      pair.compare(mirror, random_requests(maker, count).all, agreement);
      ASSERT_TRUE(mirror.apply({}, maker.moves(mirror, count)));
    }
  }
  RecordProperty("texels", std::to_string(agreement.texels));
  RecordProperty("different", std::to_string(agreement.different));
  std::printf("%zu texels, %zu hits, %zu different, %zu unexcused\n", agreement.texels, agreement.hits,
              agreement.different, agreement.unexcused);
  EXPECT_GT(agreement.hits, agreement.texels / 5);
  EXPECT_GE(agreement.share(), 0.995);
  EXPECT_EQ(agreement.unexcused, 0u);
}

TEST_F(AgreementTest, HoldsAfterEveryMutationOfTheScene) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(egl);
  Agreement agreement;
  for (uint64_t seed = 5000; seed < 5030; ++seed) {
    SceneMaker maker(seed);
    SceneMirror mirror;
    ASSERT_TRUE(mirror.apply(maker.scene(10), {}));
    Pair pair(egl, *embree_, rays_);
    for (int round = 0; round < 8; ++round) {
      SceneDelta delta;
      const uint64_t victim = 1 + maker.random().next_below(10);
      if (round % 4 == 1 && mirror.find(victim)) delta.remove.push_back(victim);
      if (round % 4 == 2) delta.add.push_back(maker.instance(100 + static_cast<uint64_t>(round)));
      if (round % 4 == 3 && mirror.find(victim)) delta.change.push_back({victim, maker.attributes()});
      ASSERT_TRUE(mirror.apply(delta, {}));
      ASSERT_TRUE(mirror.apply({}, maker.moves(mirror, 10)));
      pair.compare(mirror, random_requests(maker, mirror.instances().size()).all, agreement);
    }
  }
  EXPECT_GE(agreement.share(), 0.995);
  EXPECT_EQ(agreement.unexcused, 0u);
}

TEST_F(AgreementTest, HoldsTenKilometresFromTheOrigin) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(egl);
  Agreement agreement;
  for (uint64_t seed = 6000; seed < 6050; ++seed) {
    SceneMaker maker(seed, glm::dvec3(-7000.0, 300.0, 7100.0));
    SceneMirror mirror;
    ASSERT_TRUE(mirror.apply(maker.scene(12), {}));
    // The same tolerance as at the origin: both samplers work relative to the scene, in double up to there.
    Pair(egl, *embree_, rays_).compare(mirror, random_requests(maker, 12).all, agreement);
  }
  EXPECT_GE(agreement.share(), 0.995);
  EXPECT_EQ(agreement.unexcused, 0u);
}

// Every second one turns as well.
TransformUpdate with_random_velocities(SceneMaker& maker, TransformUpdate update) {
  const auto within = [&](double most) { return maker.random().next_in(-most, most); };
  for (size_t i = 0; i < update.ids.size(); ++i) {
    update.velocities_mps.emplace_back(within(3), within(1), within(3));
    update.angular_velocities_radps.push_back(i % 2 == 0 ? glm::dvec3(0.0)
                                                         : glm::dvec3(within(1), within(4), within(1)));
  }
  return update;
}

// Where an instance is after that time, in many small steps.
Pose moved_on(Pose pose, const glm::dvec3& velocity_mps, const glm::dvec3& angular_velocity_radps, double time_s) {
  constexpr int kSteps = 20'000;
  const glm::dvec3 turn = angular_velocity_radps * (time_s / kSteps);
  for (int k = 0; k < kSteps; ++k)
    pose.rotation = glm::normalize(glm::dquat(1, turn.x / 2, turn.y / 2, turn.z / 2) * pose.rotation);
  pose.position_m += time_s * velocity_mps;
  return pose;
}

// Predicted maps and present ones in one call: EGL and Embree agree, and both show what they would show if the movers
// had really moved on for that time.
TEST_F(AgreementTest, HoldsForMapsOfTheTimeAhead) {
  SIGHTLINE_EGL_DEVICE_OR_SKIP(egl);
  constexpr double kAheadS = 0.4;
  Agreement agreement;
  size_t texels = 0, as_if_moved = 0;
  for (uint64_t seed = 7000; seed < 7060; ++seed) {
    SceneMaker maker(seed);
    SceneMirror mirror, later;
    const SceneDelta scene = maker.scene(12);
    ASSERT_TRUE(mirror.apply(scene, {}));
    ASSERT_TRUE(later.apply(scene, {}));
    TransformUpdate moves = with_random_velocities(maker, maker.moves(mirror, 12));
    ASSERT_TRUE(mirror.apply({}, moves));
    for (size_t i = 0; i < moves.ids.size(); ++i)
      moves.poses[i] = moved_on(moves.poses[i], moves.velocities_mps[i], moves.angular_velocities_radps[i], kAheadS);
    ASSERT_TRUE(later.apply({}, moves));

    Requests requests = random_requests(maker, 12);
    for (size_t i = 0; i < requests.all.size(); i += 2) requests.all[i].ahead_s = kAheadS;
    Pair pair(egl, *embree_, rays_);
    pair.compare(mirror, requests.all, agreement, kAheadS);
    MapRequest moved = requests.all[0];
    moved.ahead_s = 0.0;
    std::vector<DepthMap> reference;
    ASSERT_TRUE(embree_->make_sampler()->take(later, {&moved, 1}, reference));
    for (size_t texel = 0; texel < reference[0].occluder.size(); ++texel, ++texels)
      as_if_moved += reference[0].occluder[texel] == pair.embree_maps()[0].occluder[texel];
  }
  EXPECT_GE(agreement.share(), 0.995);
  EXPECT_EQ(agreement.unexcused, 0u);
  EXPECT_GE(as_if_moved, texels * 0.999) << "the same scene, but for rounding at silhouettes";
}

}  // namespace
}  // namespace sightline
