// The check of reasons: what a step claims of places, and whether rays say so.
#include "client/evaluate/reasons.h"

#include <gtest/gtest.h>

#include "scenes/hall.h"
#include "server/scene/gltf.h"

namespace sightline {
namespace {

// A step that has decided on the second of three candidates, at x = 0, 1 and 2. It steers for the first of two targets.
StepDump decided(MoveReason reason) {
  StepDump dump;
  dump.decision.reason = reason, dump.decision.chosen_candidate = 1;
  for (const double x_m : {0.0, 1.0, 2.0}) dump.sights.candidates.position_m.push_back({x_m, 0, 0});
  dump.targets.ids.push_back(7), dump.targets.ids.push_back(8);
  dump.targets.steered = 0b01;
  return dump;
}

TEST(ReasonClaims, AreOfThePlacesOfTheStep) {
  constexpr double kBodyM = 0.3;
  for (const MoveReason reason : {MoveReason::kAtDesiredPlace, MoveReason::kOtherShot, MoveReason::kBestAllVisible,
                                  MoveReason::kNearestView, MoveReason::kBestPartial}) {
    const auto claim = claim_of(decided(reason), 1.5, kBodyM);
    ASSERT_TRUE(claim) << to_string(reason);
    EXPECT_EQ(claim->reason, reason);
    EXPECT_EQ(claim->time_s, 1.5);
    EXPECT_EQ(claim->target_ids, std::vector<uint64_t>{7}) << "the other one is given up";
    EXPECT_EQ(claim->place_m, glm::dvec3(1, 0, 0));
    EXPECT_EQ(claim->reach_m.size(), reason == MoveReason::kBestPartial ? 3u : 0u);
  }
  for (const MoveReason reason : {MoveReason::kStays, MoveReason::kBestSoon, MoveReason::kFarWay, MoveReason::kPaused})
    EXPECT_FALSE(claim_of(decided(reason), 1.5, kBodyM))
        << to_string(reason) << " says nothing of places that can be checked";
  StepDump no_place = decided(MoveReason::kBestAllVisible);
  no_place.decision.chosen_candidate = -1;
  EXPECT_FALSE(claim_of(no_place, 1.5, kBodyM)) << "a claim without its place would always hold";
}

TEST(ReasonClaims, ReachOnlyWhereTheBodyFits) {
  StepDump dump = decided(MoveReason::kBestPartial);
  dump.sights.position_m = {{0, 0.1, 0}, {1, 0.1, 0}, {2, 0.1, 0}};  // moved to where the body fits better
  dump.sights.clearance_m = {0.29f, 0.31f, 1.0f};
  const auto claim = claim_of(dump, 0.0, 0.3);
  ASSERT_TRUE(claim);
  EXPECT_EQ(claim->place_m, glm::dvec3(1, 0.1, 0));
  EXPECT_EQ(claim->reach_m, (std::vector<glm::dvec3>{{1, 0.1, 0}, {2, 0.1, 0}}));
}

// Claims about a place that sees the targets of the hall, and about one under its ground, from where nothing is seen.
TEST(ReasonClaims, AreFalseWhereRaysSayOtherwise) {
  GeometryStore store;
  const auto walk = scenes::make_hall({.duration_s = 2.0});
  const auto scenario = Scenario::from_asset(*read_gltf(walk, nullptr, store));
  ASSERT_TRUE(scenario) << to_string(scenario.error());
  EmbreeDevice device;
  const auto world = *ScenarioWorld::make(*scenario, store, device);
  ExtentCache extents;
  std::vector<uint64_t> ids;
  for (const Target& target : world->targets()) ids.push_back(target.instance_id);
  const glm::dvec3 sees_m = scenario->camera().position_m, under_ground_m(0, -5, 0);
  ASSERT_FALSE(world->is_aim_hidden(world->targets()[0], sees_m));
  ASSERT_TRUE(world->is_aim_hidden(world->targets()[0], under_ground_m));
  const auto false_claims = [&](const ReasonClaim& claim) {
    const ReasonCounts counts = check_reasons(*world, extents, std::vector{claim});
    EXPECT_EQ(counts.at(claim.reason).claims, 1u);
    return counts.at(claim.reason).false_claims;
  };
  for (const MoveReason reason :
       {MoveReason::kAtDesiredPlace, MoveReason::kOtherShot, MoveReason::kBestAllVisible, MoveReason::kNearestView}) {
    EXPECT_EQ(false_claims({.reason = reason, .target_ids = ids, .place_m = sees_m, .reach_m = {}}), 0u)
        << to_string(reason);
    EXPECT_EQ(false_claims({.reason = reason, .target_ids = ids, .place_m = under_ground_m, .reach_m = {}}), 1u)
        << to_string(reason);
  }
  for (const MoveReason reason : {MoveReason::kBestPartial, MoveReason::kHorizonGrown}) {
    EXPECT_EQ(false_claims({.reason = reason, .target_ids = ids, .place_m = {}, .reach_m = {under_ground_m}}), 0u)
        << to_string(reason);
    EXPECT_EQ(false_claims({.reason = reason, .target_ids = ids, .place_m = {}, .reach_m = {under_ground_m, sees_m}}),
              1u)
        << to_string(reason);
  }
}

// The place of the shot sinks into the ground after a second, and rises again.
TEST(ReasonClaims, AboutObstructionsAreHeldAgainstWhatCame) {
  GeometryStore store;
  const auto walk = scenes::make_hall({.duration_s = 4.0});
  const auto scenario = Scenario::from_asset(*read_gltf(walk, nullptr, store));
  ASSERT_TRUE(scenario) << to_string(scenario.error());
  EmbreeDevice device;
  const auto world = *ScenarioWorld::make(*scenario, store, device);
  const uint64_t target = world->targets()[0].instance_id;
  const auto places = [&](double told_from_s, double told_until_s, double in_s) {
    std::vector<AskedPlace> all;
    for (int i = 0; i <= 180; ++i) {
      const double time_s = i / 60.0;
      AskedPlace& at = all.emplace_back();
      at.time_s = time_s;
      world->set_time(time_s);
      at.place_m = world->targets_center_m() + glm::dvec3(0, time_s > 1.0 && time_s < 1.5 ? -5.0 : 3.0, 0);
      if (time_s >= told_from_s && time_s < told_until_s) at.soon_target = target, at.soon_s = in_s;
    }
    return check_obstructions(*world, all);
  };
  const ObstructionCounts told = places(0.45, 0.75, 0.4);
  EXPECT_EQ(told.announced, 18u);
  EXPECT_EQ(told.came_true, 18u);
  EXPECT_EQ(told.began, 1u) << "for all targets at once";
  EXPECT_EQ(told.began_announced, 1u);
  const ObstructionCounts wrong = places(1.9, 2.2, 0.4);
  EXPECT_EQ(wrong.announced, 18u);
  EXPECT_EQ(wrong.came_true, 0u);
  EXPECT_EQ(wrong.began_announced, 0u);
}

}  // namespace
}  // namespace sightline
