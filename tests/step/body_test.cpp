// Targets whose body consists of several instances that move by themselves (Target::part_ids).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "server/base/random.h"
#include "tests/support/filming.h"
#include "tests/support/puppet.h"

namespace sightline::test {
namespace {

constexpr double kTick = 1.0 / 60;
constexpr uint64_t kHips = 1, kPillar = 100;

class PuppetWorld : public World {
 public:
  explicit PuppetWorld(const Puppet& puppet) {
    settings.sample.points = 8;
    for (size_t i = 0; i < kBones; ++i) add(kHips + i, puppet[i].shape(), {});
    show(puppet);
    Target target;
    target.instance_id = kHips;
    for (size_t i = 1; i < kBones; ++i) target.part_ids.push_back(kHips + i);
    targets = {target};
  }
  void show(const Puppet& puppet, const glm::dvec3& velocity_mps = {}) {
    TransformUpdate update;
    for (size_t i = 0; i < kBones; ++i) {
      update.ids.push_back(kHips + i), update.poses.push_back(puppet[i].pose());
      update.velocities_mps.push_back(velocity_mps);
    }
    apply({}, update);
  }
  void remove(uint64_t id) {
    SceneDelta delta;
    delta.remove = {id};
    apply(delta, {});
  }
  void switch_to(uint64_t id, bool visible) {
    SceneDelta delta;
    delta.change = {{id, {.visible = visible}}};
    apply(delta, {});
  }
  // The mean of the visible share over so many steps in which nothing moves.
  double mean_share(int steps) {
    double sum = 0;
    for (int i = 0; i < steps; ++i) sum += step(0).targets[0].visible_share;
    return sum / steps;
  }

 private:
  void apply(const SceneDelta& delta, const TransformUpdate& update) {
    const auto ok = mirror.apply(delta, update);
    ASSERT_TRUE(ok.has_value()) << to_string(ok.error());
  }
};

// ---- a plain rendering, by formulas instead of triangles ----

constexpr double kMiss = std::numeric_limits<double>::infinity();

double first_root(double a, double half_b, double c) {
  const double discriminant = half_b * half_b - a * c;
  return discriminant < 0 || a <= 0 ? kMiss : (-half_b - std::sqrt(discriminant)) / a;
}

// The distance along the ray to a capsule; the eye is outside.
double hit(const Bone& bone, const glm::dvec3& eye, const glm::dvec3& ray) {
  const glm::dvec3 axis = bone.to_m - bone.from_m, from_eye = eye - bone.from_m;
  const double length = glm::length(axis), squared = bone.radius_m * bone.radius_m;
  const glm::dvec3 along = axis / length;
  const glm::dvec3 across = ray - glm::dot(ray, along) * along, aside = from_eye - glm::dot(from_eye, along) * along;
  double nearest = kMiss;
  const double side = first_root(glm::dot(across, across), glm::dot(across, aside), glm::dot(aside, aside) - squared);
  if (const double at = glm::dot(from_eye + side * ray, along); side < kMiss && at >= 0 && at <= length) nearest = side;
  for (const glm::dvec3& end : {bone.from_m, bone.to_m}) {
    const glm::dvec3 to_eye = eye - end;
    nearest = std::min(nearest,
                       first_root(glm::dot(ray, ray), glm::dot(ray, to_eye), glm::dot(to_eye, to_eye) - squared));
  }
  return nearest;
}

struct Box {
  glm::dvec3 middle, half;
};
double hit(const Box& box, const glm::dvec3& eye, const glm::dvec3& ray) {
  double first = 0, last = kMiss;
  for (int axis = 0; axis < 3; ++axis) {
    const double a = (box.middle[axis] - box.half[axis] - eye[axis]) / ray[axis],
                 b = (box.middle[axis] + box.half[axis] - eye[axis]) / ray[axis];
    first = std::max(first, std::min(a, b)), last = std::min(last, std::max(a, b));
  }
  return first <= last ? first : kMiss;
}

// Pixels of all bones that are visible behind the box, over the pixels of all bones alone.
double rendered_share(const Puppet& puppet, const Box& box, const glm::dvec3& eye, const glm::dvec3& look_at) {
  constexpr int kSize = 200;
  constexpr double kHalfWidth = 0.26;  // tangent: 1.3 m to each side at 5 m
  const glm::dmat3 frame = glm::mat3_cast(look_rotation(look_at - eye, {0, 1, 0}, {1, 0, 0}));
  int alone = 0, visible = 0;
  for (int y = 0; y < kSize; ++y)
    for (int x = 0; x < kSize; ++x) {
      const glm::dvec3 ray = frame * glm::dvec3(kHalfWidth * (2 * (x + 0.5) / kSize - 1),
                                                kHalfWidth * (2 * (y + 0.5) / kSize - 1), -1);
      double body = kMiss;
      for (const Bone& bone : puppet) body = std::min(body, hit(bone, eye, ray));
      if (body == kMiss) continue;
      ++alone;
      visible += body < hit(box, eye, ray);
    }
  return static_cast<double>(visible) / alone;
}

// A person in any stance, seen from 5 m with a pillar of 0.5 m between.
struct Scene {
  Puppet puppet;
  Box pillar{{0, 1, 1.5}, {0.25, 1.5, 0.1}};
  glm::dvec3 hips{0, 0.95, 0}, eye{0, 1.2, 5};

  explicit Scene(uint64_t index) {
    CounterRandom random(11, index, RandomPurpose::kTest);
    hips.x = random.next_in(-0.6, 0.6), eye.y = random.next_in(0.5, 3.0);
    puppet = puppet_at(hips, random.next_in(0, 6.28), any_stance(random));
  }
  double truth() const { return rendered_share(puppet, pillar, eye, hips); }
};

constexpr int kScenes = 60, kSteps = 32;

// Eight points drawn independently would give the mean of kSteps steps this standard error, and points that are spread
// evenly do better.
double standard_error(double share) {
  return std::sqrt(share * (1 - share) / (8.0 * kSteps));
}

TEST(Body, ItsVisibleShareIsThatOfItsPixels) {
  double error = 0, allowed = 0, bias = 0, of_one_step = 0, allowed_of_one = 0;
  PuppetWorld world(Scene(0).puppet);
  world.add_box(kPillar, Scene(0).pillar.middle, glm::vec3(Scene(0).pillar.half));
  for (int i = 0; i < kScenes; ++i) {
    const Scene scene(i);
    world.show(scene.puppet);
    world.place(scene.eye, scene.hips);
    const double truth = scene.truth(), first = world.step(0).targets[0].visible_share, mean = world.mean_share(kSteps);
    error += std::abs(mean - truth), allowed += standard_error(truth), bias += mean - truth;
    of_one_step += std::abs(first - truth), allowed_of_one += standard_error(truth) * std::sqrt(kSteps);
  }
  EXPECT_LT(error, allowed) << "mean over the scenes: " << error / kScenes << ", allowed " << allowed / kScenes;
  EXPECT_LT(of_one_step, allowed_of_one) << "mean over the scenes: " << of_one_step / kScenes << ", allowed "
                                         << allowed_of_one / kScenes;
  EXPECT_LT(std::abs(bias) / kScenes, 0.01);
}

// The capsule that most games use for a character is as tall as the person and knows nothing of the limbs.
TEST(Body, ARigidCapsuleWouldBeWrongThere) {
  double error = 0, allowed = 0;
  World world;
  world.settings.sample.points = 8;
  world.add_target(kHips, {0, 0.9, 0});
  world.add_box(kPillar, Scene(0).pillar.middle, glm::vec3(Scene(0).pillar.half));
  for (int i = 0; i < kScenes; ++i) {
    const Scene scene(i);
    world.move(kHips, {scene.hips.x, 0.9, 0});
    world.place(scene.eye, scene.hips);
    double mean = 0;
    for (int k = 0; k < kSteps; ++k) mean += world.step(0).targets[0].visible_share / kSteps;
    error += std::abs(mean - scene.truth()), allowed += standard_error(scene.truth());
  }
  EXPECT_GT(error, 3 * allowed) << "mean over the scenes: " << error / kScenes;
}

// ---- which instances count ----

// Only the left forearm reaches out beyond a wall that hides the rest.
struct BehindAWall : PuppetWorld {
  static Puppet pointing() {
    Stance stance = standing();
    stance.upper_arm[0] = stance.forearm[0] = {-1, 0, 0};
    return puppet_at({0, 0.95, 0}, 0, stance);
  }
  BehindAWall() : PuppetWorld(pointing()) {
    add_box(kPillar, {1.0 - 0.58 * 5 / 6, 1, 1}, {1.0f, 3.0f, 0.05f});
    place({0, 1.4, 6}, {0, 1.4, 0});
  }
};
constexpr uint64_t kLeftForearm = kHips + kForearms[0];

TEST(Body, AnArmThatSticksOutCounts) {
  BehindAWall world;
  const double share = world.mean_share(16);
  EXPECT_GT(share, 0.01);
  EXPECT_LT(share, 0.15);
  EXPECT_EQ(world.step(0).targets[0].main_occluder_id(), kPillar);
  world.targets[0].part_ids.clear();
  world.targets[0].ignored_ids = {kLeftForearm};
  EXPECT_EQ(world.mean_share(16), 0.0) << "the hips alone are hidden";
}

TEST(Body, APartThatIsRemovedOrSwitchedOffDoesNotCount) {
  BehindAWall world;
  world.switch_to(kLeftForearm, false);
  EXPECT_EQ(world.mean_share(16), 0.0);
  world.switch_to(kLeftForearm, true);
  EXPECT_GT(world.mean_share(16), 0.0);
  world.remove(kLeftForearm);
  EXPECT_EQ(world.mean_share(16), 0.0);
  world.add(kLeftForearm, BehindAWall::pointing()[kForearms[0]].shape(), {-0.75, 1.43, 0});
  EXPECT_GT(world.mean_share(16), 0.0) << "an instance that is added under its id belongs to the body again";
}

TEST(Body, OfASwitchedOffInstanceThePartsAloneCount) {
  World world;
  world.settings.sample.points = 8;
  world.add_target(1, {0, 1, 0});
  world.add(2, CapsuleShape{0.3f, 0.6f}, {2, 1, 0});
  world.targets[0].part_ids = {2};
  world.add_box(kPillar, {0, 1, 2}, {0.8f, 2, 0.1f});
  world.place({0, 1, 6}, {0, 1, 0});
  const auto switch_own = [&](bool visible) {
    SceneDelta delta;
    delta.change = {{1, {.visible = visible}}};
    ASSERT_TRUE(world.mirror.apply(delta, {}).has_value());
  };
  EXPECT_NEAR(world.step(0).targets[0].visible_share, 0.5, 0.13);
  switch_own(false);
  EXPECT_EQ(world.step(0).targets[0].visible_share, 1.0);
  world.targets[0].part_ids.clear();
  EXPECT_EQ(world.step(0).targets[0].visible_share, 0.0) << "without a part the instance itself counts";
}

// A part stands before its own body and before another person. It hides the second alone.
TEST(Body, PartsHideOthersAndNeverTheirOwn) {
  World world;
  world.settings.sample.points = 8;
  world.add_target(1, {0, 1, 0});
  world.add_target(2, {3, 1, 0});
  world.add_box(3, {1.2, 1, 3}, {3, 2, 0.05f});
  world.targets[0].part_ids = {3};
  world.place({0, 1, 6}, {0, 1, 0});
  for (int i = 0; i < 8; ++i) {
    const StepResult result = world.step(0);
    EXPECT_EQ(result.targets[0].visible_share, 1.0);
    EXPECT_TRUE(result.targets[0].occlusions.empty());
    EXPECT_EQ(result.targets[1].visible_share, 0.0);
    EXPECT_EQ(result.targets[1].main_occluder_id(), 3u);
  }
}

// A box hides the target's instance, and another one does not. Points of the hidden instance would count the first box
// twice.
TEST(Body, WhatItHidesOfItselfHasNoPoints) {
  World world;
  world.settings.sample.points = 16;
  world.add_target(1, {0, 1, -3});
  world.add_box(2, {0, 1, 0}, {1.0f, 0.9f, 0.05f});
  world.add_box(3, {1.5, 1, 0}, {0.5f, 0.9f, 0.05f});
  world.targets[0].part_ids = {2, 3};
  world.place({0, 1, 6}, {0, 1, 0});
  int on_first = 0, all = 0;
  for (int i = 0; i < 16; ++i) {
    world.step(0);
    for (const glm::dvec3& sight_m : world.dump().plan.now.sights_m) {
      EXPECT_GT(sight_m.z, -0.1);
      ++all, on_first += sight_m.x < 1;
    }
  }
  EXPECT_EQ(all, 16 * 16);
  EXPECT_NEAR(static_cast<double>(on_first) / all, 2.0 / 3, 0.04);
}

// ---- framing ----

TEST(Body, ThePictureHoldsAllOfIt) {
  Stance wide = standing();
  wide.upper_arm[0] = wide.forearm[0] = {-1, 0, 0}, wide.upper_arm[1] = wide.forearm[1] = {1, 0, 0};
  const Puppet puppet = puppet_at({0, 0.95, 0}, 0, wide);
  PuppetWorld world(puppet);
  world.settings = Filming().settings;
  world.place({0, 1.2, 1.5}, {0, 0.95, 0});  // too near for so narrow a lens
  const auto all_inside = [&](const StepResult& result) {
    Lens lens = world.lens;
    lens.vertical_fov_rad = result.vertical_fov_rad;
    return std::ranges::all_of(puppet, [&](const Bone& bone) {
      return in_picture(result.camera.pose, lens, bone.from_m) && in_picture(result.camera.pose, lens, bone.to_m);
    });
  };
  StepResult result = world.step(kTick);
  EXPECT_FALSE(all_inside(result));
  EXPECT_LT(result.targets[0].picture_share, 1.0);
  for (int i = 0; i < 240; ++i) result = world.step(kTick);
  EXPECT_TRUE(all_inside(result));
  EXPECT_EQ(result.targets[0].picture_share, 1.0);
  const TrackedTarget& tracked = world.dump().targets.tracked_targets[0];
  for (const Bone& bone : puppet)
    for (const glm::dvec3& end : {bone.from_m, bone.to_m})
      EXPECT_LE(glm::distance(tracked.aim_m, end) + bone.radius_m, tracked.radius_m + 1e-6);
}

// ---- prediction ----

bool lies_on(std::span<const Bone> puppet, const glm::dvec3& point, const glm::dvec3& moved) {
  return std::ranges::any_of(puppet, [&](const Bone& bone) {
    const glm::dvec3 axis = bone.to_m - bone.from_m, to_point = point - moved - bone.from_m;
    const double at = std::clamp(glm::dot(to_point, axis) / glm::dot(axis, axis), 0.0, 1.0);
    const double distance = glm::length(to_point - at * axis);
    return distance > 0.97 * bone.radius_m && distance < bone.radius_m + 1e-4;  // within the error of the tessellation
  });
}

// The point whose margin (sample_stage.cpp) leads to this point. One or two targets are 0.35 m wider to each side, at
// most twice as wide, and their upper half is 0.45 m higher, at most half as high again.
glm::dvec3 without_margin(const glm::dvec3& point, const glm::dvec3& middle) {
  const glm::dvec3 out = point - middle;
  const double aside = std::hypot(out.x, out.z), narrower = aside > 0.7 ? (aside - 0.35) / aside : 0.5;
  const double up = out.y <= 0 ? out.y : out.y > 1.35 ? out.y - 0.45 : out.y / 1.5;
  return middle + glm::dvec3(narrower * out.x, up, narrower * out.z);
}

TEST(Body, ItsPartsGoTheWayThatIsPredictedForTheTarget) {
  const glm::dvec3 velocity_mps(2, 0, 0);
  Stance stance = standing();
  stance.upper_arm[1] = stance.forearm[1] = {1, 0, 0};
  const auto puppet_after = [&](double time_s) {
    return puppet_at(glm::dvec3(-2, 0.95, 0) + time_s * velocity_mps, 0.3, stance);
  };
  PuppetWorld world(puppet_after(0));
  world.settings = Filming().settings;
  world.settings.sample.points = 8;
  world.settings.move.turn_probability = 0;
  world.place({0, 1.5, 7}, {0, 1, 0});
  size_t ahead = 0, beyond_hips = 0, in_slices = 0;
  for (int i = 0; i < 60; ++i) {
    const Puppet puppet = puppet_after(i * kTick);
    world.show(puppet, velocity_mps);
    world.step(kTick);
    const SamplePlan& plan = world.dump().plan;
    for (const glm::dvec3& point : plan.now.points_m) EXPECT_TRUE(lies_on(puppet, point, {}));
    for (const glm::dvec3& point : plan.ahead.points_m) {
      EXPECT_TRUE(lies_on(puppet, point, plan.ahead_s * velocity_mps));
      ++ahead, beyond_hips += !lies_on(std::span(puppet).first(1), point, plan.ahead_s * velocity_mps);
    }
    if (i < 5) continue;  // the motion is not known yet
    for (const SampledSlice& slice : plan.slices)
      for (const glm::dvec3& point : slice.sampled.points_m) {
        const glm::dvec3 way_m = std::min(slice.due.ahead_s, world.settings.move.prediction_s) * velocity_mps;
        const glm::dvec3 hips_m = (puppet[0].from_m + puppet[0].to_m) / 2.0;
        EXPECT_TRUE(lies_on(puppet, without_margin(point, hips_m + way_m), way_m)) << slice.due.ahead_s;
        ++in_slices;
      }
  }
  EXPECT_GT(ahead, 60u);
  EXPECT_GT(beyond_hips, ahead / 2);
  EXPECT_GT(in_slices, 100u);
}

}  // namespace
}  // namespace sightline::test
