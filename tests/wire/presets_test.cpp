// Settings on the wire: what a session starts from, and what a tick changes of it.

#include "tests/wire/every_setting.h"
#include "tests/wire/from_proto_fixture.h"

namespace sightline::test {
namespace {

StepSettings with_two(StepSettings settings) {
  settings.aggregate.filter.alpha = 0.25, settings.move.strategy = Strategy::kBasic;
  return settings;
}

// Sets the same two fields, one of them an enum. Every group is present, but no other field is set.
template <typename Message>
void ask_for_two(Message& message) {
  message.mutable_settings();
  tuning::v1alpha1::Tuning& tuning = *message.mutable_tuning();
  tuning.mutable_bound(), tuning.mutable_sample(), tuning.mutable_move()->mutable_cost();
  tuning.mutable_aggregate()->mutable_filter()->set_alpha(0.25);
  tuning.mutable_move()->set_strategy(tuning::v1alpha1::STRATEGY_BASIC);
}

TEST_F(FromProto, ASessionStartsFromThePresetAndWhatIsSentIsPutOverIt) {
  v1::OpenSession open = make_open();
  EXPECT_EQ(text_of(must_read(open).settings), text_of(preset_settings(Preset::kSightline)));
  open.mutable_settings()->set_preset(v1::Settings::PRESET_PAPER);
  EXPECT_EQ(text_of(must_read(open).settings), text_of(preset_settings(Preset::kPaper)));
  ask_for_two(open);
  EXPECT_EQ(text_of(must_read(open).settings), text_of(with_two(preset_settings(Preset::kPaper))));
  open.mutable_settings()->set_preset(v1::Settings::PRESET_SIGHTLINE);
  EXPECT_EQ(text_of(must_read(open).settings), text_of(with_two(preset_settings(Preset::kSightline))));
}

TEST_F(FromProto, ThePresetsDiffer) {
  EXPECT_NE(text_of(preset_settings(Preset::kSightline)), text_of(preset_settings(Preset::kPaper)));
}

// Settings that equal no preset: a zoom range, and another value of every kind.
SessionOptions with_own_settings() {
  SessionOptions options;
  options.settings = preset_settings(Preset::kPaper);
  options.settings.move.follow = Follow::kStay;
  options.settings.sample.resolution = 9;
  options.settings.framing.min_vertical_fov_rad = 0.5, options.settings.framing.max_vertical_fov_rad = 0.8;
  return options;
}

TEST_F(FromProto, ATickWithoutSettingsChangesNone) {
  const TickInput tick = must_read(make_tick(1), with_own_settings());
  EXPECT_FALSE(tick.settings || tick.limits || tick.lens);
}

TEST_F(FromProto, ATickPutsWhatItSendsOverThePresentSettings) {
  const SessionOptions present = with_own_settings();
  v1::Tick wire = make_tick(1);
  wire.mutable_settings();
  EXPECT_EQ(text_of(*must_read(wire, present).settings), text_of(present.settings));
  ask_for_two(wire);
  EXPECT_EQ(text_of(*must_read(wire, present).settings), text_of(with_two(present.settings)));
}

TEST_F(FromProto, ATickThatNamesAPresetStartsAnewFromIt) {
  v1::Tick wire = make_tick(1);
  wire.mutable_settings()->set_preset(v1::Settings::PRESET_SIGHTLINE);
  ask_for_two(wire);
  EXPECT_EQ(text_of(*must_read(wire, with_own_settings()).settings),
            text_of(with_two(preset_settings(Preset::kSightline))));
}

TEST_F(FromProto, AnEndOfThePresentZoomCanBeMovedAlone) {
  v1::Tick wire = make_tick(1);
  SessionOptions expected = with_own_settings();
  expected.settings.framing.max_vertical_fov_rad = 0.6;
  wire.mutable_settings()->set_max_vertical_fov_rad(0.6);
  EXPECT_EQ(text_of(*must_read(wire, with_own_settings()).settings), text_of(expected.settings));
  EXPECT_EQ(read(wire).error().field, "tick.settings.min_vertical_fov_rad");
  wire.mutable_settings()->set_max_vertical_fov_rad(0.4);
  EXPECT_EQ(read(wire, with_own_settings()).error().field, "tick.settings.max_vertical_fov_rad");
  wire.mutable_settings()->clear_max_vertical_fov_rad();
  wire.mutable_settings()->set_min_vertical_fov_rad(0.9);
  EXPECT_EQ(read(wire, with_own_settings()).error().field, "tick.settings.min_vertical_fov_rad");
}

TEST_F(FromProto, ATickPutsTheLimitsThatItSendsOverThePresentOnes) {
  SessionOptions present;
  present.limits = {1, 2, 3, 4, 0.5};
  v1::Tick wire = make_tick(1);
  wire.mutable_limits()->set_max_acceleration_mps2(7);
  const CameraLimits limits = *must_read(wire, present).limits;
  EXPECT_EQ(limits.max_speed_mps, 1);
  EXPECT_EQ(limits.max_acceleration_mps2, 7);
  EXPECT_EQ(limits.max_angular_speed_radps, 3);
  EXPECT_EQ(limits.max_angular_acceleration_radps2, 4);
  EXPECT_EQ(limits.body_radius_m, 0.5);
}

}  // namespace
}  // namespace sightline::test
