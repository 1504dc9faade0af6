// Required targets come first. Where not all targets can be seen, no weight of an optional one draws the camera away
// from a required one.
#include <gtest/gtest.h>

#include <cmath>

#include "server/base/random.h"
#include "tests/support/filming.h"

namespace sightline::test {
namespace {

// A thick wall without end stands between the two; the camera can fly through it. It starts where it sees the optional
// one alone.
struct Parted : Filming {
  Parted(double required_weight, double optional_weight) {
    add_target(1, {-2, 1, 0}, true, required_weight);
    add_target(2, {2, 1, 0}, false, optional_weight);
    add_box(10, {0, 0, 0}, {1.2, 100, 100}, {.collides = false});
    settings.aggregate.candidates = 125;
    place({2, 1.6, 6}, {0, 1, 0});
  }
};

class Required : public testing::TestWithParam<std::pair<const char*, void (*)(StepSettings&)>> {};

TEST_P(Required, ComeBeforeOptionalTargetsOfAnyWeight) {
  CounterRandom random(31, 0, RandomPurpose::kTest);
  for (int trial = 0; trial < 6; ++trial) {
    const double required = std::pow(10.0, random.next_in(-2, 2)), optional = std::pow(10.0, random.next_in(-2, 6));
    SCOPED_TRACE(testing::Message() << "required " << required << ", optional " << optional);
    Parted world(required, trial == 0 ? 11 * required : optional);
    GetParam().second(world.settings);
    StepResult r;
    for (int i = 0; i < 240; ++i) r = world.step(1.0 / 60);
    EXPECT_LT(world.camera().pose.position_m.x, 0.0) << "the required target's side";
    EXPECT_GT(r.targets[0].filtered_share, 0.5);
    EXPECT_EQ(r.targets[1].visible_share, 0.0);
  }
}
INSTANTIATE_TEST_SUITE_P(
    Strategies, Required,
    testing::Values(std::pair("default", [](StepSettings&) {}),
                    std::pair("without_viewpoint_search", [](StepSettings& s) { s.move.search_viewpoints = false; }),
                    std::pair("basic", [](StepSettings& s) { s.move.strategy = Strategy::kBasic; }),
                    std::pair("robust", [](StepSettings& s) { s.move.strategy = Strategy::kRobust; })),
    [](const auto& tested) { return tested.param.first; });

}  // namespace
}  // namespace sightline::test
