// The truth renderer against plain loops: every sample of the picture, every triangle, in double precision.
#include "client/truth/truth.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "server/base/random.h"
#include "server/scene/primitives.h"

namespace sightline {
namespace {

// The distance along `direction` to the triangle, or nothing: the plane first, then three edge tests.
std::optional<double> meet(const glm::dvec3& origin, const glm::dvec3& direction, const glm::dvec3& a,
                           const glm::dvec3& b, const glm::dvec3& c) {
  const glm::dvec3 normal = glm::cross(b - a, c - a);
  const double slope = glm::dot(normal, direction);
  if (slope == 0) return std::nullopt;
  const double t = glm::dot(normal, a - origin) / slope;
  const glm::dvec3 p = origin + t * direction;
  for (const auto& [from, to] : {std::pair(a, b), std::pair(b, c), std::pair(c, a)})
    if (glm::dot(glm::cross(to - from, p - from), normal) < 0) return std::nullopt;
  return t;
}

class Bench {
 public:
  Bench()
      : occluders_(device_, EmbreeScene::Content::kOccluders), colliders_(device_, EmbreeScene::Content::kColliders) {}

  void add(uint64_t id, const Shape& shape, const glm::dvec3& at, InstanceAttributes attributes = {},
           const glm::dquat& rotation = {1, 0, 0, 0}) {
    SceneDelta delta;
    delta.add.push_back({id, *store_.intern(*tessellate(shape)), Pose{at, rotation}, glm::dmat3(1.0), attributes});
    ASSERT_TRUE(mirror_.apply(delta, {}));
    occluders_.take_in(mirror_);
    colliders_.take_in(mirror_);
  }
  void add_target(uint64_t id, const Shape& shape, const glm::dvec3& at, const glm::dquat& rotation = {1, 0, 0, 0}) {
    add(id, shape, at, {}, rotation);
    Target target;
    target.instance_id = id;
    targets.push_back(target);
  }
  PictureTruth look(int size = kTruthSize) const {
    return sightline::measure_picture(occluders_, mirror_, targets, camera, lens, size);
  }
  const EmbreeScene& colliders() const { return colliders_; }

  // The same without Embree, bounds or shortcuts.
  PictureTruth look_slowly(int size) const {
    PictureTruth picture;
    for (const Target& target : targets) {
      TargetTruth truth;
      truth.id = target.instance_id;
      for (int y = 0; y < size; ++y)
        for (int x = 0; x < size; ++x) count_slowly(target, x, y, size, truth);
      picture.targets.push_back(truth);
    }
    return picture;
  }

  std::vector<Target> targets;
  Pose camera;
  Lens lens;

 private:
  void count_slowly(const Target& target, int x, int y, int size, TargetTruth& truth) const {
    const double half_height = std::tan(lens.vertical_fov_rad / 2);
    const glm::dvec3 direction = camera.rotation * glm::dvec3((2 * (x + 0.5) / size - 1) * half_height * lens.aspect,
                                                              (2 * (y + 0.5) / size - 1) * half_height, -1.0);
    double own = INFINITY, other = INFINITY;
    for (const Instance& instance : mirror_.instances()) {
      const bool is_part = std::find(target.part_ids.begin(), target.part_ids.end(), instance.id) !=
                           target.part_ids.end();
      double& nearest = instance.id == target.instance_id || is_part ? own : other;
      if (&nearest == &other && !(instance.attributes.layers & target.layer_mask)) continue;
      if (!instance.occludes()) continue;
      nearest = std::min(nearest, nearest_hit(instance, direction));
    }
    truth.alone_pixels += std::isfinite(own);
    truth.visible_pixels += std::isfinite(own) && own <= other;
  }
  double nearest_hit(const Instance& instance, const glm::dvec3& direction) const {
    const Geometry& geometry = *instance.geometry;
    double nearest = INFINITY;
    const auto corner = [&](size_t k) {
      return transform_point(instance.world_from_instance, glm::dvec3(geometry.positions[geometry.indices[k]]));
    };
    for (size_t k = 0; k < geometry.indices.size(); k += 3)
      if (const auto t = meet(camera.position_m, direction, corner(k), corner(k + 1), corner(k + 2)))
        if (*t > lens.near_m) nearest = std::min(nearest, *t);
    return nearest;
  }

  GeometryStore store_;
  EmbreeDevice device_;
  SceneMirror mirror_;
  EmbreeScene occluders_, colliders_;
};

constexpr double kAheadM = -10.0;  // z of what stands ten metres before the camera

// The edges of a picture of 60 degrees that is twice as wide as high, 10 m away: 5.77 m up and down, 11.55 m to the
// sides.
TEST(Truth, ACentreIsInTheFrameBetweenAllFourEdges) {
  Bench bench;
  bench.lens.vertical_fov_rad = std::numbers::pi / 3, bench.lens.aspect = 2.0;
  const std::pair<glm::dvec3, bool> cases[] = {
      {{0, 0, -10}, true},      {{0, 5.7, -10}, true},    {{0, 5.9, -10}, false},  {{0, -5.7, -10}, true},
      {{0, -5.9, -10}, false},  {{11.4, 0, -10}, true},   {{11.7, 0, -10}, false}, {{-11.4, 0, -10}, true},
      {{-11.7, 0, -10}, false}, {{11.4, 5.7, -10}, true}, {{0, 0, 10}, false},     {{0, 1, 10}, false}};
  uint64_t id = 1;
  for (const auto& [at, is_in] : cases) bench.add_target(id++, SphereShape{0.5f}, at);
  const PictureTruth picture = bench.look(32);
  for (size_t i = 0; i < std::size(cases); ++i)
    EXPECT_EQ(picture.targets[i].in_frame, cases[i].second) << "target " << i;
}

TEST(Truth, ATargetInTheOpenIsSeenWhole) {
  Bench bench;
  bench.add_target(1, SphereShape{0.5f}, {0, 0, kAheadM});
  const TargetTruth truth = bench.look().targets[0];
  EXPECT_GT(truth.alone_pixels, 0u);
  EXPECT_EQ(truth.visible_pixels, truth.alone_pixels);
  EXPECT_EQ(truth.visible_share(), 1.0);
  EXPECT_TRUE(truth.in_frame);
}

TEST(Truth, ItsPixelsAreItsAreaInThePicture) {
  Bench bench;
  bench.add_target(1, BoxShape{{1.0f, 0.5f, 0.001f}}, {0, 0, kAheadM});
  const double half_height = 10 * std::tan(bench.lens.vertical_fov_rad / 2);
  const double expected = kTruthSize * kTruthSize * (1.0 / (half_height * bench.lens.aspect)) * (0.5 / half_height);
  EXPECT_NEAR(bench.look().targets[0].alone_pixels, expected, 0.02 * expected);
}

TEST(Truth, AHalfHiddenBoxHasShareOneHalf) {
  Bench bench;
  bench.add_target(1, BoxShape{{1, 1, 0.01f}}, {0, 0, kAheadM});
  bench.add(2, BoxShape{{5, 5, 0.01f}}, {-5, 0, -5});  // its right edge stands before the target's middle
  const PictureTruth picture = bench.look();
  EXPECT_NEAR(picture.targets[0].visible_share(), 0.5, 0.02);
  EXPECT_FALSE(picture.fully_hidden());
  EXPECT_TRUE(picture.partly_hidden());
  EXPECT_TRUE(picture.partly_hidden(kPartialTolerance));
  EXPECT_TRUE(picture.all_seen());
}

TEST(Truth, AgreesWithEveryRayAgainstEveryTriangle) {
  for (uint64_t scene = 0; scene < 25; ++scene) {
    CounterRandom random(17, scene, RandomPurpose::kTest);
    const auto in = [&](double low, double high) { return random.next_in(low, high); };
    const auto any_rotation = [&] { return glm::normalize(glm::dquat(in(-1, 1), in(-1, 1), in(-1, 1), in(-1, 1))); };
    Bench bench;
    bench.camera = {{in(-2, 2), in(-2, 2), in(-2, 2)}, {1, 0, 0, 0}};
    bench.camera.rotation = look_rotation({in(-0.5, 0.5), in(-0.5, 0.5), -1}, {0, 1, 0}, {1, 0, 0});
    bench.lens = {in(0.4, 1.6), in(0.5, 2.5), in(0.05, 3)};
    for (uint64_t id = 1; id <= 3; ++id)
      bench.add_target(id, BoxShape{{0.9f, 0.4f, 0.6f}}, {in(-4, 4), in(-3, 3), in(-9, 2)}, any_rotation());
    for (uint64_t id = 10; id < 16; ++id)
      bench.add(id, BoxShape{{0.8f, 0.7f, 0.1f}}, {in(-3, 3), in(-2, 2), in(-6, 0)}, {}, any_rotation());
    if (scene % 2 == 1) bench.targets[1].part_ids = {10, 13}, bench.targets[2].part_ids = {12};
    constexpr int kSize = 48;
    const PictureTruth fast = bench.look(kSize), slow = bench.look_slowly(kSize);
    for (size_t k = 0; k < 3; ++k) {
      // Samples that fall on an edge to within rounding may go either way.
      EXPECT_NEAR(fast.targets[k].alone_pixels, slow.targets[k].alone_pixels, 1) << "scene " << scene;
      EXPECT_NEAR(fast.targets[k].visible_pixels, slow.targets[k].visible_pixels, 1) << "scene " << scene;
    }
  }
}

TEST(Truth, OneTargetHidesAnother) {
  Bench bench;
  bench.add_target(1, SphereShape{0.5f}, {0, 0, kAheadM});
  bench.add_target(2, SphereShape{0.5f}, {0, 0, -5});
  const PictureTruth picture = bench.look();
  EXPECT_EQ(picture.targets[0].visible_pixels, 0u);
  EXPECT_EQ(picture.targets[1].visible_share(), 1.0);
  EXPECT_FALSE(picture.fully_hidden()) << "the nearer one is seen";
  EXPECT_TRUE(picture.partly_hidden());
  EXPECT_FALSE(picture.all_seen());
}

TEST(Truth, ATargetOffScreenCountsAsNotVisible) {
  Bench bench;
  bench.add_target(1, SphereShape{0.5f}, {0, 0, kAheadM});
  bench.add_target(2, SphereShape{0.5f}, {0, 0, 10});
  bench.add_target(3, SphereShape{0.5f}, {40, 0, kAheadM});
  const PictureTruth picture = bench.look();
  for (const size_t off : {1u, 2u}) {
    EXPECT_EQ(picture.targets[off].alone_pixels, 0u);
    EXPECT_EQ(picture.targets[off].visible_share(), 0.0);
    EXPECT_FALSE(picture.targets[off].in_frame);
  }
  EXPECT_TRUE(picture.partly_hidden());
  bench.targets.erase(bench.targets.begin());
  EXPECT_TRUE(bench.look().fully_hidden());
}

TEST(Truth, ATargetThatTheEdgeCutsIsJudgedByThePartInside) {
  Bench bench;
  const double half_width = 10 * std::tan(bench.lens.vertical_fov_rad / 2) * bench.lens.aspect;
  bench.add_target(1, BoxShape{{1, 1, 0.01f}}, {half_width, 0, kAheadM});
  const uint32_t cut = bench.look().targets[0].alone_pixels;
  EXPECT_EQ(bench.look().targets[0].visible_share(), 1.0);
  bench.camera.position_m.x = half_width;
  EXPECT_NEAR(cut, bench.look().targets[0].alone_pixels / 2.0, 0.02 * cut);
}

TEST(Truth, WhatStandsBeforeTheNearPlaneIsNotSeen) {
  Bench bench;
  bench.lens.near_m = 0.5;
  bench.add_target(1, SphereShape{0.5f}, {0, 0, kAheadM});
  bench.add(2, BoxShape{{1, 1, 0.01f}}, {0, 0, -0.4});
  EXPECT_EQ(bench.look().targets[0].visible_share(), 1.0);
  bench.lens.near_m = 0.3;
  EXPECT_EQ(bench.look().targets[0].visible_share(), 0.0);
}

TEST(Truth, MasksOpacityAndAttachmentsDecideWhatOccludes) {
  Bench bench;
  bench.add_target(1, SphereShape{0.5f}, {0, 0, kAheadM});
  InstanceAttributes on_layer_two;
  on_layer_two.layers = 2;
  bench.add(2, BoxShape{{2, 2, 0.01f}}, {0, 0, -5}, on_layer_two);
  EXPECT_EQ(bench.look().targets[0].visible_share(), 0.0);
  bench.targets[0].layer_mask = 1;
  EXPECT_EQ(bench.look().targets[0].visible_share(), 1.0);
  bench.targets[0].layer_mask = 0xFFFFFFFF;
  bench.targets[0].attached_ids = {2};
  EXPECT_EQ(bench.look().targets[0].visible_share(), 1.0);
  bench.targets[0].attached_ids.clear();
  bench.targets[0].ignored_ids = {2, 77};
  EXPECT_EQ(bench.look().targets[0].visible_share(), 1.0);
  InstanceAttributes glass;
  glass.opacity = 0.5f;
  bench.add(3, BoxShape{{2, 2, 0.01f}}, {0, 0, -4}, glass);
  EXPECT_EQ(bench.look().targets[0].visible_share(), 1.0);
}

TEST(Truth, ToleranceForgivesFivePercent) {
  PictureTruth picture;
  picture.targets = {{1, 1000, 960, true}, {2, 1000, 1000, true}};
  EXPECT_TRUE(picture.partly_hidden());
  EXPECT_FALSE(picture.partly_hidden(kPartialTolerance));
  picture.targets[1].visible_pixels = 940;
  EXPECT_TRUE(picture.partly_hidden(kPartialTolerance));
}

TEST(Truth, WithoutTargetsNothingIsHidden) {
  EXPECT_FALSE(Bench().look().fully_hidden());
  EXPECT_FALSE(Bench().look().partly_hidden());
}

TEST(TruthBounds, APixelOutsideASpheresRectangleNeverMeetsIt) {
  CounterRandom random(5, 0, RandomPurpose::kTest);
  for (int round = 0; round < 400; ++round) {
    const Lens lens{random.next_in(0.2, 2.5), random.next_in(0.3, 3), 0.1};
    const glm::dvec3 center(random.next_in(-6, 6), random.next_in(-6, 6), random.next_in(-8, 3));
    const double radius = random.next_in(0.05, 3);
    constexpr int kColumns = 23, kRows = 19;
    const PixelBox box = sphere_pixels({}, lens, center, radius, kColumns, kRows);
    for (int y = 0; y < kRows; ++y)
      for (int x = 0; x < kColumns; ++x) {
        if (x >= box.x0 && x < box.x1 && y >= box.y0 && y < box.y1) continue;
        const glm::dvec3 d = glm::normalize(sample_direction({}, lens, x + 0.5, y + 0.5, kColumns, kRows));
        const double along = std::max(0.0, glm::dot(center, d));
        EXPECT_GE(glm::distance(center, along * d), radius * (1 - 1e-9)) << "round " << round;
      }
  }
}

TEST(TruthBody, ClearanceIsTheDistanceToTheNearestCollider) {
  Bench bench;
  bench.add(1, BoxShape{{1, 1, 1}}, {0, 0, -4});
  const BodyTruth body = measure_body(bench.colliders(), {0, 0, 0}, {0, 0, -2.5});
  EXPECT_NEAR(body.clearance_m, 0.5, 1e-5);
  EXPECT_FALSE(body.crossed);
  EXPECT_FALSE(body.touches(0.4));
  EXPECT_TRUE(body.touches(0.6));
}

TEST(TruthBody, PassingThroughAWallIsSeenFromOutsideToOutside) {
  Bench bench;
  bench.add(1, BoxShape{{5, 5, 0.05f}}, {0, 0, -4});
  EXPECT_TRUE(measure_body(bench.colliders(), {0, 0, -2}, {0, 0, -6}).touches(0.3));
  EXPECT_FALSE(measure_body(bench.colliders(), {0, 0, -2}, {1, 0, -3}).touches(0.3));
}

TEST(TruthBody, WhatDoesNotCollideIsPassed) {
  Bench bench;
  InstanceAttributes ghost;
  ghost.collides = false;
  bench.add(1, BoxShape{{5, 5, 0.05f}}, {0, 0, -4}, ghost);
  EXPECT_FALSE(measure_body(bench.colliders(), {0, 0, -2}, {0, 0, -6}).touches(0.3));
}

}  // namespace
}  // namespace sightline
