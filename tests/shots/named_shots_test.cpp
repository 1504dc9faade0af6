// The named shots: every one is a valid part of a tick, and the camera takes it.
#include "client/shots/named_shots.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <sstream>

#include "client/shots/shots_command.h"
#include "server/wire/from_proto.h"
#include "server/wire/from_proto_shot.h"
#include "server/wire/from_proto_values.h"
#include "tests/support/filming.h"

namespace sightline::test {
namespace {

TEST(NamedShots, AreListedWithTheNamesThatFilmMakersKnow) {
  std::set<std::string> names;
  for (const NamedShot& shot : named_shots()) EXPECT_TRUE(names.insert(shot.name).second) << shot.name;
  EXPECT_EQ(names, (std::set<std::string>{"wide", "medium", "close", "two-shot", "over-right-shoulder",
                                          "over-left-shoulder", "chase", "side", "top-down", "orbit", "tripod"}));
  std::ostringstream out, err;
  EXPECT_EQ(run_shots_command({}, out, err), 0);
  for (const std::string& name : names) EXPECT_NE(out.str().find(name), std::string::npos);
}

TEST(NamedShots, EachIsAPartOfATickThatTheServerTakes) {
  for (const NamedShot& shot : named_shots()) {
    const auto tick = named_shot(shot.name, 1, 2);
    ASSERT_TRUE(tick) << shot.name << ": " << to_string(tick.error());
    StepSettings settings = preset_settings(Preset::kSightline);
    EXPECT_TRUE(read_settings(tick->settings(), {}, "tick.", settings)) << shot.name;
    EXPECT_TRUE(validate(settings)) << shot.name;
    AskedShot asked;
    EXPECT_TRUE(!tick->has_shot() || read_shot(tick->shot(), gltf_convention(), Lens{}.aspect, "tick.shot", asked))
        << shot.name;
  }
}

TEST(NamedShots, AMissingIdAndAnUnknownNameAreToldByName) {
  EXPECT_EQ(named_shot("chase", 0, 0).error().field, "subject");
  EXPECT_EQ(named_shot("two-shot", 1, 0).error().field, "other");
  EXPECT_EQ(named_shot("worm", 1, 2).error().code, ErrorCode::kNotFound);
  EXPECT_EQ(read_shot_text("{\"targets\":{}}", 1, 2).error().field, "shot");
  EXPECT_EQ(read_shot_text("{\"sequence\":\"4\"}", 1, 2).error().field, "shot");
  EXPECT_EQ(read_shot_text("{\"shot\":{\"size\":0.3}}", 0, 0)->shot().size(), 0.3);
  std::ostringstream out, err;
  EXPECT_EQ(run_shots_command({.name = "worm"}, out, err), 1);
  EXPECT_NE(err.str().find("worm"), std::string::npos);
}

// Two people stand 3 m apart on open ground. After 8 s the picture is worth what the shot asks for.
TEST(NamedShots, OnOpenGroundEachIsTakenAndKept) {
  for (const NamedShot& named : named_shots()) {
    if (named.name == "tripod") continue;
    OneFilmed world({1, 1.8, 7});
    const bool over = named.name.starts_with("over");
    if (over)
      world.add(2, CapsuleShape{0.3f, 0.6f}, {0, 1, 3.0}), world.targets[0].instance_id = 2;
    else if (named.needs_other())
      world.add_target(2, {0, 1, 3.0});
    const auto tick = named_shot(named.name, 1, 2);
    ASSERT_TRUE(tick) << named.name;
    ASSERT_TRUE(read_settings(tick->settings(), {}, "tick.", world.settings));
    ASSERT_TRUE(read_shot(tick->shot(), gltf_convention(), Lens{}.aspect, "tick.shot", world.shot));
    world.shot.number = 1;
    Watch watch(world);
    StepResult result;
    for (int i = 0; i < 480; ++i) world.step_in(watch, result);
    ASSERT_TRUE(result.shot) << named.name;
    EXPECT_GT(result.shot->worth, 0.9) << named.name;
    EXPECT_EQ(result.status, TrackingStatus::kTracking) << named.name;
  }
}

}  // namespace
}  // namespace sightline::test
