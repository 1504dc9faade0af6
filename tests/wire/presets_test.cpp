// Settings on the wire: what a session starts from, and what a tick changes of it.
#include "server/step/presets.h"

#include <map>

#include "tests/wire/from_proto_fixture.h"

namespace sightline::test {
namespace {

// Every setting by its name, so that two sets can be compared field by field.
using Values = std::map<std::string, double>;
Values values_of(const StepSettings& s) {
  const FilterSettings& f = s.aggregate.filter;
  return {{"bound.mode", static_cast<double>(s.bound.mode)},
          {"bound.horizon_s", s.bound.horizon_s},
          {"bound.max_horizon_s", s.bound.max_horizon_s},
          {"bound.paper_n", s.bound.paper_n},
          {"sample.resolution", s.sample.resolution},
          {"sample.points", s.sample.points},
          {"sample.jitter", s.sample.jitter_texels},
          {"aggregate.volume", static_cast<double>(s.aggregate.volume)},
          {"aggregate.candidates", s.aggregate.candidates},
          {"aggregate.needed_share", s.aggregate.needed_share},
          {"aggregate.relative_bias", s.aggregate.relative_bias},
          {"aggregate.filter.mode", static_cast<double>(f.mode)},
          {"aggregate.filter.alpha", f.alpha},
          {"aggregate.filter.n", f.n},
          {"aggregate.filter.window_s", f.window_s},
          {"aggregate.filter.on", f.on},
          {"aggregate.filter.off", f.off},
          {"aggregate.filter.min_occlusion_s", f.min_occlusion_s},
          {"aggregate.filter.hold_s", f.hold_s},
          {"move.strategy", static_cast<double>(s.move.strategy)},
          {"move.follow", static_cast<double>(s.move.follow)},
          {"move.blend.distance", s.move.blend.distance},
          {"move.blend.shelter", s.move.blend.shelter},
          {"move.blend.full_depth_m", s.move.blend.full_depth_m},
          {"move.prediction_s", s.move.prediction_s},
          {"move.predictive_power", s.move.predictive_power},
          {"move.min_distance_m", s.move.min_distance_m},
          {"move.max_distance_m", s.move.max_distance_m},
          {"move.min_elevation_rad", s.move.min_elevation_rad},
          {"move.max_elevation_rad", s.move.max_elevation_rad},
          {"framing.margin", s.framing.margin},
          {"framing.dead_zone", s.framing.dead_zone},
          {"framing.response_s", s.framing.response_s},
          {"framing.min_vertical_fov_rad", s.framing.min_vertical_fov_rad},
          {"framing.max_vertical_fov_rad", s.framing.max_vertical_fov_rad}};
}

Values changed(Values values, const Values& by) {
  for (const auto& [name, value] : by) values.at(name) = value;
  return values;
}

// Two fields, one of them an enum, beside a mention of every group and of no other field.
void ask_for_two(v1::Settings& s) {
  s.mutable_bound(), s.mutable_sample(), s.mutable_aggregate()->mutable_filter(), s.mutable_framing();
  s.mutable_aggregate()->mutable_filter()->set_alpha(0.25);
  s.mutable_move()->mutable_blend(), s.mutable_move()->set_strategy(v1::Move::BASIC);
}
const Values kTwo{{"aggregate.filter.alpha", 0.25}, {"move.strategy", static_cast<double>(Strategy::kBasic)}};

TEST_F(FromProto, ASessionStartsFromThePresetAndWhatIsSentIsPutOverIt) {
  v1::OpenSession open = make_open();
  EXPECT_EQ(values_of(must_read(open).settings), values_of(preset_settings(Preset::kSightline)));
  open.mutable_settings()->set_preset(v1::Settings::PAPER);
  EXPECT_EQ(values_of(must_read(open).settings), values_of(preset_settings(Preset::kPaper)));
  ask_for_two(*open.mutable_settings());
  EXPECT_EQ(values_of(must_read(open).settings), changed(values_of(preset_settings(Preset::kPaper)), kTwo));
  open.mutable_settings()->set_preset(v1::Settings::SIGHTLINE);
  EXPECT_EQ(values_of(must_read(open).settings),
            changed(values_of(preset_settings(Preset::kSightline)), kTwo));
}

TEST_F(FromProto, ThePresetsDiffer) {
  EXPECT_NE(values_of(preset_settings(Preset::kSightline)), values_of(preset_settings(Preset::kPaper)));
}

// A present set that is no preset: a zoom, and something else of every kind.
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
  EXPECT_EQ(values_of(*must_read(wire, present).settings), values_of(present.settings));
  ask_for_two(*wire.mutable_settings());
  EXPECT_EQ(values_of(*must_read(wire, present).settings), changed(values_of(present.settings), kTwo));
}

TEST_F(FromProto, ATickThatNamesAPresetStartsAnewFromIt) {
  v1::Tick wire = make_tick(1);
  wire.mutable_settings()->set_preset(v1::Settings::SIGHTLINE);
  ask_for_two(*wire.mutable_settings());
  EXPECT_EQ(values_of(*must_read(wire, with_own_settings()).settings),
            changed(values_of(preset_settings(Preset::kSightline)), kTwo));
}

TEST_F(FromProto, AnEndOfThePresentZoomCanBeMovedAlone) {
  v1::Tick wire = make_tick(1);
  wire.mutable_settings()->mutable_framing()->set_max_vertical_fov_rad(0.6);
  EXPECT_EQ(values_of(*must_read(wire, with_own_settings()).settings),
            changed(values_of(with_own_settings().settings), {{"framing.max_vertical_fov_rad", 0.6}}));
  EXPECT_EQ(read(wire).error().field, "tick.settings.framing.min_vertical_fov_rad");
  wire.mutable_settings()->mutable_framing()->set_max_vertical_fov_rad(0.4);
  EXPECT_EQ(read(wire, with_own_settings()).error().field, "tick.settings.framing.max_vertical_fov_rad");
  wire.mutable_settings()->mutable_framing()->clear_max_vertical_fov_rad();
  wire.mutable_settings()->mutable_framing()->set_min_vertical_fov_rad(0.9);
  EXPECT_EQ(read(wire, with_own_settings()).error().field, "tick.settings.framing.min_vertical_fov_rad");
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
