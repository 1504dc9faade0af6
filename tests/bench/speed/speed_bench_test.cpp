#include "tests/bench/speed/plain_settings.h"

#include <fstream>
#include <memory>
#include <regex>
#include <sstream>
#include <stdexcept>

#include <gtest/gtest.h>

#include "client/evaluate/policy.h"
#include "server/sample/embree_sampler.h"
#include "server/wire/settings_to_proto.h"
#include "tests/bench/speed/map_agreement.h"
#include "tests/bench/speed/timed_steps.h"
#include "tests/bench/step_timing.h"

namespace sightline::bench {
namespace {

TEST(PlainSettings, HaveThePapersBoundAndNotTheDefaults) {
  const BoundSettings bound = plain_settings(7, 343).bound, paper = preset_settings(Preset::kPaper).bound;
  EXPECT_EQ(bound.mode, BoundMode::kHorizon);
  EXPECT_EQ(bound.horizon_s, paper.horizon_s);
  EXPECT_EQ(bound.target_reach_m, 0);
}

// The settings in `plain=(...)` of make.sh, which are those of the service's loads over PRESET_PAPER.
std::string settings_of_loads() {
  std::ifstream file(SPEED_MAKE);
  std::stringstream text;
  text << file.rdbuf();
  const std::string script = text.str();
  std::smatch found;
  if (!std::regex_search(script, found,
                         std::regex("plain=\\(--preset paper --settings '\\{\"settings\":\\{(.*)\\}'\\)")))
    return "";
  return "plain={\"settings\":{\"preset\":\"PRESET_PAPER\"," + found[1].str() + "}";
}

TEST(PlainSettings, AreThoseOfTheServicesLoads) {
  const auto loads = read_named_settings(settings_of_loads());
  ASSERT_TRUE(loads) << to_string(loads.error());
  StepSettings settings = loads->settings;
  settings.sample.resolution = 7;
  settings.sample.points = 8;
  settings.aggregate.candidates = 343;
  EXPECT_EQ(settings_to_proto(settings).SerializeAsString(),
            settings_to_proto(plain_settings(7, 343, 8)).SerializeAsString());
}

// The agreement of the plain steps with Embree's rays through the city, frame by frame from the start.
struct Agreement {
  double share, share_on_rays;
};
Agreement agreement_in_city(const StepSettings& settings, int frames) {
  const auto loaded = LoadedScene::load("city");
  if (!loaded) throw std::runtime_error(to_string(loaded.error()));
  LoadedScene& city = **loaded;
  const auto world = ScenarioWorld::make(*city.scenario, city.store, city.device);
  if (!world) throw std::runtime_error(to_string(world.error()));
  const SceneMirror& mirror = (*world)->mirror();
  std::vector<const ExtentTable*> tables;
  for (const auto& table : city.tables) tables.push_back(table.get());
  const auto device = make_embree_sampler_device();
  TimedSteps steps("embree", {mirror, (*world)->targets(), tables, city.scenario->lens()}, settings, *device);
  const auto rays = make_embree_peer(mirror);
  MapAgreement agreement(*rays);
  steps.place(city.scenario->camera());
  std::vector<uint32_t> seen;
  for (int frame = 0; frame < frames; ++frame) {
    (*world)->set_time(frame / 60.0);
    steps.step();
    std::vector<SeenFrom> from;
    for (size_t t = 0; t < (*world)->targets().size(); ++t)
      from.push_back(
          {steps.dump().targets.tracked_targets[t].aim_m, *mirror.slot_of((*world)->targets()[t].instance_id)});
    std::vector<glm::dvec3> place_m;
    list_places(steps.dump().sights.candidates.position_m, place_m);
    rays->prepare();
    rays->look(from, place_m, seen);
    agreement.add(steps.dump(), from, place_m, seen);
  }
  return {agreement.share(), agreement.share_on_rays()};
}

TEST(MapAgreement, OfPlainStepsIsHighAndNearlyPerfectOnTheMapsRays) {
  constexpr int kFrames = 300;
  const Agreement plain = agreement_in_city(plain_settings(5, 125), kFrames);
  EXPECT_GE(plain.share, 0.985);
  EXPECT_GE(plain.share_on_rays, 0.999);

  // A ball that reaches towards the targets takes wider maps, in which a candidate is farther from the nearest ray.
  StepSettings reaching = plain_settings(5, 125);
  reaching.bound.target_reach_m = 5.0;
  const Agreement wide = agreement_in_city(reaching, kFrames);
  EXPECT_LT(wide.share, plain.share);
  EXPECT_GE(wide.share_on_rays, 0.99);
}

// A target that the ball contains, or comes near to, has several maps. A frame without any other target has nothing to
// compare on rays.
TEST(MapAgreement, LeavesOutFramesWithNothingToCompare) {
  StepSettings near = plain_settings(5, 125);
  near.bound.horizon_s = 0.85;
  near.bound.target_reach_m = 2.0;
  EXPECT_GE(agreement_in_city(near, 300).share_on_rays, 0.98);
  near.bound.horizon_s = 2.0;
  near.bound.target_reach_m = 100.0;
  EXPECT_EQ(agreement_in_city(near, 30).share_on_rays, -1);
}

}  // namespace
}  // namespace sightline::bench
