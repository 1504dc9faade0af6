#include "server/step/step.h"

#include <gtest/gtest.h>

#include <cstring>

#include "server/base/random.h"
#include "tests/support/world.h"

namespace sightline::test {
namespace {

constexpr double kTick = 1.0 / 60;

// Two people 2 m apart, the camera 6 m in front of them.
struct TwoPeople : World {
  TwoPeople() {
    add_target(1, {-1, 1, 0});
    add_target(2, {1, 1, 0});
    place({0, 1.6, 6}, {0, 1, 0});
  }
};

bool all_seen(const StepResult& result) {
  return std::all_of(result.targets.begin(), result.targets.end(),
                     [](const auto& t) { return t.visible_share == 1.0; });
}

TEST(Step, StaysWhereItIsWhenEverythingIsSeen) {
  TwoPeople world;
  for (int i = 0; i < 60; ++i) {
    const StepResult result = world.step(kTick);
    EXPECT_EQ(result.status, TrackingStatus::kTracking);
    EXPECT_EQ(result.reason, MoveReason::kAtDesiredPlace);
    EXPECT_TRUE(all_seen(result));
  }
  EXPECT_LT(glm::distance(world.camera().pose.position_m, glm::dvec3(0, 1.6, 6)), 1e-3);
}

TEST(Step, FollowsWalkingTargetsAtTheirOffset) {
  TwoPeople world;
  for (int i = 0; i < 240; ++i) {
    const double x = 1.4 * i * kTick;
    world.move(1, {-1 + x, 1, 0}, {1.4, 0, 0});
    world.move(2, {1 + x, 1, 0}, {1.4, 0, 0});
    world.step(kTick);
  }
  EXPECT_NEAR(world.camera().pose.position_m.x, 1.4 * 239 * kTick, 0.1);
  EXPECT_NEAR(world.camera().pose.position_m.z, 6, 0.1);
}

// Basic finds a candidate that sees all targets and goes there. It then hovers at the edge of the view, because the
// nearest such candidate lies there. The paper's later strategies correct this.
TEST(Step, GoesRoundAnOccluderUntilBothAreSeen) {
  TwoPeople world;
  world.add_box(10, {0.5, 1, 3}, {0.35, 2, 0.05});
  StepResult result = world.step(kTick);
  EXPECT_FALSE(all_seen(result));
  EXPECT_EQ(result.reason, MoveReason::kNearestAllVisible);
  int first_seen = 0;
  while (!all_seen(result) && first_seen < 600) {
    result = world.step(kTick);
    ++first_seen;
  }
  EXPECT_LT(first_seen, 60) << "within a second";
}

TEST(Step, NamesTheOccluder) {
  World world;
  world.add_target(1, {0, 1, 0});
  world.add_box(77, {0, 1, 3}, {3, 3, 0.05});
  world.place({0, 1, 6}, {0, 1, 0});
  const StepResult result = world.step(kTick);
  EXPECT_EQ(result.targets[0].visible_share, 0.0);
  EXPECT_EQ(result.targets[0].main_occluder_id(), 77u);
}

TEST(Step, EscapeGrowsTheHorizonAndShrinksItWhenFound) {
  World world;
  world.add_target(1, {0, 1, 0});
  world.add_box(77, {0, 0, 3}, {4, 8, 0.05});
  world.place({0, 1, 6}, {0, 1, 0});
  StepResult result = world.step(kTick);
  EXPECT_EQ(result.status, TrackingStatus::kLost);
  const double first = world.stepper.dump().bound.radius_m;
  for (int i = 0; i < 60; ++i) result = world.step(kTick);
  EXPECT_GT(world.stepper.dump().bound.radius_m, 2 * first);
  const auto sees_a_view = [&] { return world.dump().decision.status == MoveStatus::kTracking; };
  for (int i = 0; i < 60 * 8 && !sees_a_view(); ++i) result = world.step(kTick);
  EXPECT_TRUE(sees_a_view()) << "a place beside the wall was found";
  world.mirror.apply({.base_revision = {}, .remove = {77}, .add = {}, .change = {}}, {});
  for (int i = 0; i < 120; ++i) world.step(kTick);
  EXPECT_NEAR(world.stepper.dump().bound.horizon_s, world.settings.bound.horizon_s, 1e-9);
}

class StepTargets : public testing::TestWithParam<int> {};
TEST_P(StepTargets, AnyNumberOfTargetsIsSteeredFor) {
  World world;
  const int n = GetParam();
  for (int i = 0; i < n; ++i) world.add_target(i + 1, {2.0 * (i % 8) - 7, 1, -2.0 * (i / 8)});
  world.add_box(1000, {0, 1, 12}, {0.5, 3, 0.1});
  world.place({0, 6, 22}, {0, 1, 0});
  StepResult result = world.step(kTick);
  for (int i = 0; i < 120; ++i) result = world.step(kTick);
  ASSERT_EQ(result.targets.size(), static_cast<size_t>(n));
  EXPECT_EQ(world.counts().visible_by_target.size(), static_cast<size_t>(n));
  EXPECT_EQ(world.counts().total,
            world.counts().all_visible + world.counts().some_visible + world.counts().none_visible);
  EXPECT_TRUE(std::all_of(result.targets.begin(), result.targets.end(), [](const auto& t) { return t.in_picture; }));
}
INSTANTIATE_TEST_SUITE_P(Counts, StepTargets, testing::Values(1, 2, 3, 8, 32));

// The default's strategy and filter need the lattice.
void use_pairs(StepSettings& settings) {
  settings.aggregate.volume = Volume::kPair;
  settings.aggregate.filter.mode = FilterMode::kNone;
  settings.move.strategy = Strategy::kBasic;
}

TEST(Step, PairVolumeIsUsedWhenAskedFor) {
  TwoPeople world;
  use_pairs(world.settings);
  world.settings.bound.horizon_s = 0.35;
  const StepResult result = world.step(kTick);
  EXPECT_EQ(result.volume, Volume::kPair);
  EXPECT_EQ(result.pair_gap, PairGap::kNone);
  EXPECT_GT(world.counts().all_visible, 50u);
}

TEST(Step, WithoutAPairVolumeItUsesTheLatticeAndSaysWhy) {
  struct Shot {
    glm::dvec3 a, b, camera;
    PairGap gap;
  };
  const Shot shots[] = {
      {{-0.2, 1, 0}, {0.2, 1, 0}, {0, 1, 6}, PairGap::kNone},               // a close pair
      {{-1, 1, 0}, {1, 1, 0}, {-4, 1.3, 0}, PairGap::kNone},                // over the shoulder
      {{-4, 1, 0}, {4, 1, 0}, {0, 1.2, 0.1}, PairGap::kNone},               // between the targets
      {{0, 1, 0}, {0, 1, 0}, {0, 1, 6}, PairGap::kTooClose},                // at one place
      {{-1, 1, 0}, {1, 1, 0}, {6, 1, 0}, PairGap::kOnLine},                 // on the line AB
      {{-1, 1, 0}, {1.5, 1, 0}, {1.5, 1.1, 0.9}, PairGap::kTargetInBound},  // a target inside the ball
  };
  for (const Shot& shot : shots) {
    World world;
    world.add_target(1, shot.a);
    world.add_target(2, shot.b);
    world.place(shot.camera, {0, 1, 0.01});
    use_pairs(world.settings);
    const StepResult result = world.step(kTick);
    EXPECT_EQ(result.volume, shot.gap == PairGap::kNone ? Volume::kPair : Volume::kLattice);
    EXPECT_TRUE(result.pair_asked);
    EXPECT_EQ(result.pair_gap, shot.gap);
    EXPECT_GT(world.counts().total, shot.gap == PairGap::kNone ? 2u : 100u) << "and candidates were composed";
  }
}

// Targets in a row, 1.5 m apart, the camera in front of them; pair volumes asked for, no prediction.
struct Row : World {
  explicit Row(int count) {
    for (int i = 0; i < count; ++i) add_target(i + 1, {1.5 * i - 0.75 * (count - 1), 1, 0});
    place({0, 1.6, 3.0 + count}, {0, 1, 0});
    use_pairs(settings);
    settings.bound.horizon_s = 0.3;
  }
};

class StepChain : public testing::TestWithParam<int> {};

// Each target is rendered once for all the volumes that it belongs to. The other map of each target is its sight to the
// camera.
TEST_P(StepChain, TakesOneMapOverTheBoundOfEveryTarget) {
  const int n = GetParam();
  for (const FilterMode mode : {FilterMode::kNone, FilterMode::kJoint})
    for (const int points : {0, 1, 8}) {
      Row world(n);
      world.settings.aggregate.filter.mode = mode;
      world.settings.sample.points = points;
      const uint64_t before = world.maps_taken();
      const StepResult result = world.step(kTick);
      EXPECT_EQ(result.volume, Volume::kPair);
      EXPECT_EQ(result.pair_gap, PairGap::kNone);
      EXPECT_FALSE(result.pair_needs_two);
      EXPECT_EQ(world.maps_taken() - before, 2u * n);
    }
}
INSTANTIATE_TEST_SUITE_P(Targets, StepChain, testing::Values(2, 3, 4, 8));

TEST(Step, ThreeTargetsAreChainedAndTheirOccluderIsSeen) {
  Row clear(3), blocked(3);
  clear.settings.sample.resolution = blocked.settings.sample.resolution = 15;
  blocked.add_box(10, {0.9, 1, 2.0}, {0.2, 2, 0.05});  // before the third
  ASSERT_EQ(clear.step(kTick).volume, Volume::kPair);
  ASSERT_EQ(blocked.step(kTick).volume, Volume::kPair);
  const SightCounts &all = clear.counts(), &some = blocked.counts();
  EXPECT_GT(all.total, 200u);
  EXPECT_EQ(all.all_visible, all.total);
  EXPECT_EQ(some.total, all.total) << "the candidates are the same places";
  EXPECT_EQ(some.visible_by_target[0], some.total);
  EXPECT_LT(some.visible_by_target[2], some.total);
  EXPECT_EQ(some.all_visible, std::min(some.visible_by_target[1], some.visible_by_target[2]));
}

// As PairVolumeAndLatticeSeeTheSameShares, with a third target that the first pair of volumes does not hold.
TEST(Step, ChainAndLatticeSeeTheSameShares) {
  Row lattice(3), chain(3);
  lattice.settings.aggregate.volume = Volume::kLattice;
  for (World* world : {static_cast<World*>(&lattice), static_cast<World*>(&chain)}) {
    world->settings.sample.resolution = 32;
    world->settings.sample.jitter = false;
    world->settings.aggregate.candidates = 8000;
    world->add_box(10, {1.0, 1, 2.5}, {0.15, 2, 0.05});
  }
  lattice.step(kTick);
  ASSERT_EQ(chain.step(kTick).volume, Volume::kPair);
  const auto share = [](const SightCounts& c) { return double(c.visible_by_target[2]) / c.total; };
  EXPECT_GT(share(lattice.counts()), 0.1);
  EXPECT_LT(share(lattice.counts()), 0.9);
  EXPECT_NEAR(share(lattice.counts()), share(chain.counts()), 0.08);
}

TEST(Step, AFilteredChainAnswersForItsOwnCandidates) {
  Row world(3);
  world.limits.max_jerk_mps3 = 0;
  world.settings.aggregate.filter.mode = FilterMode::kJoint;
  world.add_box(10, {0.9, 1, 2.0}, {0.2, 2, 0.05});
  for (int i = 0; i < 20; ++i) ASSERT_EQ(world.step(kTick).volume, Volume::kPair);
  const CandidateSights& sights = world.stepper.dump().sights;
  EXPECT_FALSE(sights.on_lattice);
  EXPECT_EQ(sights.candidates.filtered_targets.size(), sights.candidates.size());
  EXPECT_EQ(sights.texels.size(), sights.candidates.size());
  EXPECT_GT(world.counts().all_visible, 5u);
  EXPECT_LT(world.counts().all_visible, world.counts().total);
}

TEST(Step, AChainThatCannotHoldATargetFallsToTheLatticeAndSaysWhy) {
  Row world(3);
  world.move(3, world.camera().pose.position_m + glm::dvec3(0.1, 0, 0));
  const StepResult result = world.step(kTick);
  EXPECT_EQ(result.volume, Volume::kLattice);
  EXPECT_TRUE(result.pair_asked);
  EXPECT_FALSE(result.pair_needs_two);
  EXPECT_EQ(result.pair_gap, PairGap::kTargetInBound);
  EXPECT_GT(world.counts().total, 100u) << "and the lattice was composed";
}

TEST(Step, PairVolumeNeedsTwoTargets) {
  World world;
  world.add_target(1, {0, 1, 0});
  world.place({0, 1, 6}, {0, 1, 0});
  use_pairs(world.settings);
  const StepResult result = world.step(kTick);
  EXPECT_EQ(result.volume, Volume::kLattice);
  EXPECT_TRUE(result.pair_needs_two);
}

// The two volumes sample the same visibility. In a scene of large occluders they agree on how much of the bound sees
// which targets.
TEST(Step, PairVolumeAndLatticeSeeTheSameShares) {
  TwoPeople lattice, pair;
  for (World* world : {static_cast<World*>(&lattice), static_cast<World*>(&pair)}) {
    world->settings.bound.horizon_s = 0.35;
    world->settings.sample.resolution = 32;
    world->settings.sample.jitter = false;
    world->settings.aggregate.candidates = 8000;
    world->add_box(10, {0.55, 1, 3}, {0.2, 2, 0.05});
  }
  use_pairs(pair.settings);
  lattice.step(kTick);
  ASSERT_EQ(pair.step(kTick).volume, Volume::kPair);
  const auto share = [](const SightCounts& c) { return double(c.all_visible) / c.total; };
  EXPECT_GT(share(lattice.counts()), 0.1);
  EXPECT_LT(share(lattice.counts()), 0.9);
  EXPECT_NEAR(share(lattice.counts()), share(pair.counts()), 0.08);
}

// A walk through a crowd of boxes with irregular steps, taken twice: every double of every pose must be the same.
TEST(Step, EqualInputsGiveEqualResultsBitForBit) {
  const auto run = [] {
    TwoPeople world;
    CounterRandom random(81, 0, RandomPurpose::kTest);
    for (uint64_t id = 10; id < 30; ++id)
      world.add_box(id, {random.next_in(-6, 6), 1, random.next_in(1, 4)}, {0.2, 1, 0.2});
    std::vector<CameraState> path;
    for (int i = 0; i < 200; ++i) {
      world.move(1, {-1 + 0.02 * i, 1, 0}, {1.2, 0, 0});
      path.push_back(world.step(random.next_in(0.005, 0.03)).camera);
    }
    return path;
  };
  const auto first = run(), second = run();
  EXPECT_EQ(0, std::memcmp(first.data(), second.data(), first.size() * sizeof first[0]));
}

TEST(Step, AnotherSeedJittersOtherTexels) {
  TwoPeople one, other;
  other.seed = 2;
  one.step(kTick);
  other.step(kTick);
  EXPECT_NE(one.stepper.dump().maps[0].view.jitter, other.stepper.dump().maps[0].view.jitter);
}

TEST(Step, AttachedAndIgnoredInstancesDoNotOcclude) {
  World world;
  world.add_target(1, {0, 1, 0});
  world.add_box(10, {0, 1, 2}, {3, 3, 0.05});
  world.add_box(11, {0, 1, 3}, {3, 3, 0.05});
  world.place({0, 1, 6}, {0, 1, 0});
  EXPECT_FALSE(all_seen(world.step(kTick)));
  world.targets[0].attached_ids = {10};
  EXPECT_FALSE(all_seen(world.step(kTick)));
  world.targets[0].ignored_ids = {11};
  EXPECT_TRUE(all_seen(world.step(kTick)));
}

TEST(Step, OtherTargetsAreOccluders) {
  World world;
  world.add_target(1, {0, 1, 0});
  world.add_target(2, {0, 1, 2});
  world.place({0, 1, 6}, {0, 1, 0});
  const StepResult result = world.step(kTick);
  EXPECT_EQ(result.targets[0].visible_share, 0.0);
  EXPECT_EQ(result.targets[0].main_occluder_id(), 2u);
  EXPECT_EQ(result.targets[1].visible_share, 1.0);
}

TEST(Step, ASamplerThatFailsLeavesTheCameraWhereItWas) {
  class Broken : public Sampler {
    Status take(const SceneMirror&, std::span<const MapRequest>, std::vector<DepthMap>&) override {
      return fail(ErrorCode::kUnavailable, "", "gone");
    }
  } broken;
  TwoPeople world;
  const Pose before = world.camera().pose;
  const StepInput input{world.mirror, world.targets, world.limits, world.settings, world.lens, 1, 1, kTick};
  EXPECT_FALSE(world.stepper.take(input, broken, [] { return int64_t{0}; }));
  EXPECT_EQ(world.camera().pose.position_m, before.position_m);
}

// A wall that reaches to the waist hides half of the person. One point gives a share of 0 or 1, eight points about one
// half.
TEST(Step, SurfacePointsSeePartialOcclusionAtOnce) {
  const auto shares = [](int points) {
    World world;
    world.settings.sample.points = points;
    world.settings.move.follow = Follow::kStay;
    world.add_target(1, {0, 0.9, 0});
    world.add_box(10, {0, 0.45, 1}, {3, 0.45, 0.05});
    world.place({0, 0.9, 6}, {0, 0.9, 0});
    std::vector<double> taken;
    for (int i = 0; i < 16; ++i) taken.push_back(world.step(0.0).targets[0].visible_share);
    return taken;
  };
  for (const double share : shares(8)) {
    EXPECT_GT(share, 0.25);
    EXPECT_LT(share, 0.85);
  }
  double sum = 0;
  for (const double share : shares(1)) {
    EXPECT_TRUE(share == 0.0 || share == 1.0) << "the paper: one point a frame";
    sum += share;
  }
  EXPECT_GT(sum, 3);
  EXPECT_LT(sum, 13);
}

// A post passes between camera and target for a tenth of a second.
TEST(Step, TheFilterOverlooksAPassingPost) {
  const auto travelled = [](FilterMode mode) {
    World world;
    world.limits.max_jerk_mps3 = 0;
    world.settings.aggregate.filter.mode = mode;
    world.settings.sample.resolution = 15;
    world.add_target(1, {0, 1, 0});
    world.add_box(10, {-3, 1, 3}, {0.2, 3, 0.05}, {.collides = false});
    world.place({0, 1.2, 6}, {0, 1, 0});
    double path = 0;
    for (int i = 0; i < 120; ++i) {
      world.move(10, {-3 + 0.05 * i, 1, 3}, {3, 0, 0});
      const glm::dvec3 before = world.camera().pose.position_m;
      world.step(kTick);
      path += glm::distance(before, world.camera().pose.position_m);
    }
    return path;
  };
  const double without = travelled(FilterMode::kNone), with = travelled(FilterMode::kPerTarget);
  EXPECT_GT(without, 0.05) << "it would have moved";
  EXPECT_LT(with, 0.25 * without);
}

TEST(Step, ALastingOcclusionIsReactedToWithin350Milliseconds) {
  World world;
  world.settings.aggregate.filter.mode = FilterMode::kPerTarget;
  world.add_target(1, {0, 1, 0});
  world.add_box(10, {-30, 1, 3}, {0.6, 3, 0.05}, {.collides = false});
  world.place({0, 1.2, 6}, {0, 1, 0});
  for (int i = 0; i < 60; ++i) world.step(kTick);
  world.move(10, {0.2, 1, 3});
  int steps = 0;
  while (world.step(kTick).reason == MoveReason::kAtDesiredPlace && steps < 60) ++steps;
  EXPECT_LE(steps * kTick, 0.35);
  EXPECT_GE(steps * kTick, 0.10) << "and not at the first flicker";
}

// The deepest position on the free side is chosen, not the first one beyond the shadow's edge.
TEST(Step, RobustMoveShelters) {
  const auto depth = [](Strategy strategy) {
    World world;
    world.settings.move.strategy = strategy;
    world.settings.sample.resolution = 15;
    world.add_target(1, {0, 1, 0});
    world.add_box(10, {0.8, 1, 3}, {0.9, 4, 0.05}, {.collides = false});
    world.place({0, 1.2, 6}, {0, 1, 0});
    for (int i = 0; i < 120; ++i) world.step(kTick);
    // The edge of the shadow at the camera's depth: the line from the target over the box's left side.
    const double edge = -0.1 * world.camera().pose.position_m.z / 3.0;
    return edge - world.camera().pose.position_m.x;
  };
  EXPECT_GT(depth(Strategy::kRobust), 0.5);
  EXPECT_GT(depth(Strategy::kMinCost), 0.2);
  EXPECT_LT(depth(Strategy::kBasic), depth(Strategy::kMinCost));
}

// A target walks past pillars, parallel to the picture. Prediction moves the camera before the target is lost.
TEST(Step, PredictionMovesBeforeTheTargetIsHidden) {
  const auto hidden_frames = [](double prediction_s) {
    World world;
    world.settings.move.prediction_s = prediction_s;
    world.settings.sample.resolution = 15;
    world.add_target(1, {-4, 1, 0});
    for (uint64_t k = 0; k < 3; ++k) world.add_box(10 + k, {-2.0 + 2.5 * k, 1, 2}, {0.4, 3, 0.4}, {.collides = false});
    world.place({-4, 1.2, 6}, {-4, 1, 0});
    int hidden = 0;
    for (int i = 0; i < 240; ++i) {
      world.move(1, {-4 + 2.0 * i * kTick, 1, 0}, {2, 0, 0});
      hidden += world.step(kTick).targets[0].visible_share == 0.0;
    }
    return hidden;
  };
  EXPECT_LT(hidden_frames(0.5), hidden_frames(0.0));
}

// A screen slides in front of the camera and stops. A camera that moves only to the edge of the coming shadow is too
// late.
TEST(Step, RobustMoveWithPredictionIsOutOfASlidingScreensWay) {
  const auto hidden_frames = [](double prediction_s) {
    const double speed_mps = 6.0, rest_x = -2.2;  // its edge stops at 0.8
    World world;
    world.settings.move.strategy = Strategy::kRobust;
    world.settings.move.prediction_s = prediction_s;
    world.add_target(1, {0, 1, 0});
    world.add_box(10, {-6, 1.5, 4.8}, {3, 1.5, 0.03}, {.collides = false});
    world.place({0, 1.2, 6}, {0, 1, 0});
    int hidden = 0;
    for (int i = 0; i < 120; ++i) {
      const double x = std::min(-6 + speed_mps * i * kTick, rest_x);
      world.move(10, {x, 1.5, 4.8}, {x < rest_x ? speed_mps : 0.0, 0, 0});
      hidden += world.step(kTick).targets[0].visible_share == 0.0;
    }
    return hidden;
  };
  EXPECT_EQ(hidden_frames(0.3), 0);
  EXPECT_GT(hidden_frames(0.0), 6);
}

}  // namespace
}  // namespace sightline::test
