// Every setting of the move stage that has a range: both ends are allowed, and what is beyond them is named.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "server/move/choose.h"

namespace sightline {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Range {
  const char* field;
  double low, high;
  bool open_low;  // the low end itself is not allowed
  void (*set)(MoveSettings& settings, double value);
};

std::string field_of(const MoveSettings& settings) {
  const Status status = validate(settings);
  return status ? std::string() : status.error().field;
}

class MoveSetting : public testing::TestWithParam<Range> {};
TEST_P(MoveSetting, IsKeptInItsRange) {
  const Range& range = GetParam();
  const auto field_with = [&](double value) {
    MoveSettings settings;
    range.set(settings, value);
    return field_of(settings);
  };
  const double step = 1e-6 * std::max(1.0, range.high);
  EXPECT_EQ(field_with(range.high), "");
  EXPECT_EQ(field_with(range.low + step), "");
  EXPECT_EQ(field_with(range.low), range.open_low ? range.field : "");
  for (const double value : {range.low - step, range.high + step, std::nan(""), kInfinity, -kInfinity})
    EXPECT_EQ(field_with(value), range.field) << value;
}

constexpr double kHalfPi = std::numbers::pi / 2;
const Range kRanges[] = {
    {"move.prediction_s", 0, 2, false, [](auto& s, double v) { s.prediction_s = v; }},
    {"move.predictive_power", 0, 1, false, [](auto& s, double v) { s.predictive_power = v; }},
    {"move.turn_share", 0, 0.5, false, [](auto& s, double v) { s.turn_share = v; }},
    {"move.turn_rad", 0, kHalfPi, false, [](auto& s, double v) { s.turn_rad = v; }},
    {"move.response_s", 0, 1, false, [](auto& s, double v) { s.response_s = v; }},
    {"move.blend.hidden", 0, 1000, false, [](auto& s, double v) { s.blend.hidden = v; }},
    {"move.blend.tolerance", 0, 1, false, [](auto& s, double v) { s.blend.tolerance = v; }},
    {"move.survey.content", 0, 1, false, [](auto& s, double v) { s.survey.content = v; }},
    {"move.blend.distance", 0, 10, false, [](auto& s, double v) { s.blend.distance = v; }},
    {"move.blend.shelter", 0, 10, false, [](auto& s, double v) { s.blend.shelter = v; }},
    {"move.blend.full_depth_m", 0, 5, true, [](auto& s, double v) { s.blend.full_depth_m = v; }},
    {"move.blend.route", 0, 10, false, [](auto& s, double v) { s.blend.route = v; }},
    {"move.blend.exposure", 0, 100, false, [](auto& s, double v) { s.blend.exposure = v; }},
    {"move.blend.steadiness", 0, 10, false, [](auto& s, double v) { s.blend.steadiness = v; }},
    {"move.survey.memory_s", 0, 10, true, [](auto& s, double v) { s.survey.memory_s = v; }},
    {"move.survey.hold", 0, 1, false, [](auto& s, double v) { s.survey.hold = v; }},
    {"move.coherence.visibility", 0, 100, false, [](auto& s, double v) { s.coherence.visibility = v; }},
    {"move.coherence.view_angle", 0, 100, false, [](auto& s, double v) { s.coherence.view_angle = v; }},
    {"move.coherence.height", 0, 100, false, [](auto& s, double v) { s.coherence.height = v; }},
    {"move.coherence.distance", 0, 100, false, [](auto& s, double v) { s.coherence.distance = v; }},
    {"move.coherence.screen", 0, 100, false, [](auto& s, double v) { s.coherence.screen = v; }},
    {"move.coherence.responsiveness", 0, 1, false, [](auto& s, double v) { s.coherence.responsiveness = v; }},
};
INSTANTIATE_TEST_SUITE_P(Ranges, MoveSetting, testing::ValuesIn(kRanges), [](const auto& of) {
  std::string name = of.param.field;
  for (char& c : name)
    if (c == '.') c = '_';
  return name;
});

TEST(MoveSettings, ASurveyHasTwoToThirtyTwoTexelsASide) {
  const auto field_with = [](int resolution) {
    MoveSettings settings;
    settings.survey.resolution = resolution;
    return field_of(settings);
  };
  EXPECT_EQ(field_with(2), "");
  EXPECT_EQ(field_with(32), "");
  for (const int resolution : {-1, 0, 1, 33}) EXPECT_EQ(field_with(resolution), "move.survey.resolution");
}

TEST(MoveSettings, ABlendWithoutAnyWeightIsRefused) {
  MoveSettings settings;
  settings.blend.hidden = settings.blend.distance = settings.blend.shelter = settings.blend.route = 0;
  settings.blend.exposure = settings.blend.steadiness = 1;
  ASSERT_FALSE(validate(settings));
  EXPECT_EQ(field_of(settings), "move.blend");
  for (const auto weight :
       {&BlendSettings::hidden, &BlendSettings::distance, &BlendSettings::shelter, &BlendSettings::route}) {
    MoveSettings one = settings;
    one.blend.*weight = 1e-3;
    EXPECT_EQ(field_of(one), "");
  }
}

TEST(MoveSettings, CoherenceWithoutAnyWeightIsRefused) {
  MoveSettings settings;
  settings.coherence = {.visibility = 0, .view_angle = 0, .height = 0, .distance = 0, .screen = 0};
  EXPECT_FALSE(validate(settings));
}

}  // namespace
}  // namespace sightline
