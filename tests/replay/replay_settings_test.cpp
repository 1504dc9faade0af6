// Settings as typed, applied to the messages of a session.
#include "client/replay/settings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sightline {
namespace {

using testing::HasSubstr;

std::vector<ReplaySetting> read(std::initializer_list<const char*> texts) {
  std::vector<ReplaySetting> settings;
  for (const char* text : texts) {
    auto setting = read_replay_setting(text);
    EXPECT_TRUE(setting.has_value()) << to_string(setting.error());
    if (setting) settings.push_back(*setting);
  }
  return settings;
}

TEST(ReplaySettings, ArePutOverTheOpening) {
  v1::OpenSession open;
  open.mutable_tuning()->mutable_aggregate()->set_candidates(100);
  open.mutable_limits()->set_max_speed_mps(7);
  put_over(read({"tuning.aggregate.filter.n=10", "settings.follow=stay", "preset=PAPER", "tuning.sample.jitter=false",
                 "limits.max_speed_mps=3.5", "lens.near_m=0.2", "seed=18446744073709551615"}),
           open);
  EXPECT_EQ(open.tuning().aggregate().filter().n(), 10u);
  EXPECT_EQ(open.tuning().aggregate().candidates(), 100u);
  EXPECT_EQ(open.settings().follow(), v1::Settings::FOLLOW_STAY);
  EXPECT_EQ(open.settings().preset(), v1::Settings::PRESET_PAPER);
  EXPECT_TRUE(open.tuning().sample().has_jitter());
  EXPECT_FALSE(open.tuning().sample().jitter());
  EXPECT_EQ(open.limits().max_speed_mps(), 3.5);
  EXPECT_EQ(open.lens().near_m(), 0.2);
  EXPECT_EQ(open.seed(), 18446744073709551615u);
}

TEST(ReplaySettings, LaterTicksKeepWhatIsNotNamed) {
  const auto settings = read({"tuning.aggregate.filter.n=10", "limits.max_speed_mps=3", "lens.near_m=0.2", "seed=2"});
  v1::Tick tick;
  put_over(settings, tick);
  EXPECT_EQ(tick.ByteSizeLong(), 0u);  // the tick has no settings, so none are added

  tick.mutable_tuning()->mutable_aggregate()->mutable_filter()->set_n(20);
  tick.mutable_tuning()->mutable_aggregate()->mutable_filter()->set_alpha(0.5);
  tick.mutable_limits()->set_max_acceleration_mps2(4);
  tick.mutable_lens()->set_aspect(2);
  put_over(settings, tick);
  EXPECT_EQ(tick.tuning().aggregate().filter().n(), 10u);
  EXPECT_EQ(tick.tuning().aggregate().filter().alpha(), 0.5);
  EXPECT_EQ(tick.limits().max_speed_mps(), 3);
  EXPECT_EQ(tick.limits().max_acceleration_mps2(), 4);
  EXPECT_EQ(tick.lens().aspect(), 2);
  EXPECT_EQ(tick.lens().near_m(), 0.2);
}

TEST(ReplaySettings, PresetReplacesOnlyPresets) {
  const auto settings = read({"preset=paper", "tuning.sample.points=3"});
  v1::Tick without, with;
  without.mutable_settings()->set_move_response_s(0.2);
  put_over(settings, without);
  EXPECT_EQ(without.settings().preset(), v1::Settings::PRESET_UNSPECIFIED);
  with.mutable_settings()->set_preset(v1::Settings::PRESET_SIGHTLINE);
  put_over(settings, with);  // the preset resets the tuning, so the change is applied again
  EXPECT_EQ(with.settings().preset(), v1::Settings::PRESET_PAPER);
  EXPECT_EQ(with.tuning().sample().points(), 3u);
}

TEST(ReplaySettings, ErrorsNameTheKeyAndTheAllowedOnes) {
  const auto error = [](const char* text) {
    const auto setting = read_replay_setting(text);
    EXPECT_FALSE(setting.has_value()) << text;
    return setting ? std::string() : to_string(setting.error());
  };
  EXPECT_THAT(error("speed=3"), HasSubstr("speed: there is no \"speed\" here, only: preset, follow, min_distance_m"));
  EXPECT_THAT(error("speed=3"), HasSubstr("tuning..., limits..., lens..., seed"));
  EXPECT_THAT(error("limits.speed=3"), HasSubstr("max_speed_mps, max_acceleration_mps2"));
  EXPECT_THAT(error("tuning.sample.points.x=3"), HasSubstr("what stands there is a value"));
  EXPECT_THAT(error("tuning.sample=3"), HasSubstr("name one of its values: resolution, points, jitter"));
  EXPECT_THAT(error("tuning.sample.points=-1"), HasSubstr("whole number"));
  EXPECT_THAT(error("tuning.sample.points=3.5"), HasSubstr("whole number"));
  EXPECT_THAT(error("tuning.sample.jitter=yes"), HasSubstr("true or false"));
  EXPECT_THAT(error("tuning.bound.horizon_s=long"), HasSubstr("must be a number"));
  EXPECT_THAT(error("aggregate.candidates=100"), HasSubstr("there is no \"aggregate\" here"));
  EXPECT_THAT(error("tuning.speed=3"), HasSubstr("only: bound..., sample..., aggregate..., move..."));
  EXPECT_THAT(error("preset=PRESET_UNSPECIFIED"), HasSubstr("one of SIGHTLINE, PAPER"));
  EXPECT_THAT(error("tuning.sample.points"), HasSubstr("KEY=VALUE"));
  EXPECT_THAT(error("=3"), HasSubstr("KEY=VALUE"));
}

}  // namespace
}  // namespace sightline
