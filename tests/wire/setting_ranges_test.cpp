// Every setting has the range, and the presets have the values, that settings.proto and tuning.proto state. The rules
// between settings hold.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "server/settings/rules.h"
#include "tests/wire/every_setting.h"

namespace sightline::test {
namespace {

using google::protobuf::FieldDescriptor;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Range {
  bool or_zero = false, low_open = false, high_open = false;
  double low = 0, high = 0;
};

double number_of(const FoundSetting& setting) {
  const auto& reflection = *setting.message.GetReflection();
  return setting.field.cpp_type() == FieldDescriptor::CPPTYPE_UINT32
             ? reflection.GetUInt32(setting.message, &setting.field)
             : reflection.GetDouble(setting.message, &setting.field);
}

// An end is a number, a multiple of pi, or the name of another setting of the same message.
double end_of(const FoundSetting& setting, const std::string& text) {
  if (text == "pi/2" || text == "-pi/2") return (text[0] == '-' ? -1 : 1) * std::numbers::pi / 2;
  const FieldDescriptor* other = setting.message.GetDescriptor()->FindFieldByName(text);
  return other ? number_of({"", setting.message, *other, setting.annotation}) : std::stod(text);
}

Range range_of(const FoundSetting& setting) {
  std::string text = setting.annotation.range();
  const bool or_zero = text.starts_with("0 or ");
  if (or_zero) text.erase(0, std::string("0 or ").size());
  const size_t comma = text.find(", ");
  return {or_zero, text.front() == '(', text.back() == ')', end_of(setting, text.substr(1, comma - 1)),
          end_of(setting, text.substr(comma + 2, text.size() - comma - 3))};
}

// The field that the session would refuse; empty when it accepts all.
std::string refused(const v1::OpenSession& open) {
  StepSettings settings;
  if (const Status ok = read_settings(open.settings(), open.tuning(), "", settings); !ok) return ok.error().field;
  const Status ok = validate(settings);
  return ok ? std::string() : ok.error().field;
}

// All settings at their defaults except `value`, and a zoom range, which has no default.
std::string refused_with(const std::string& path, double value) {
  v1::OpenSession open = wire_of({});
  open.mutable_settings()->set_min_vertical_fov_rad(0.5);
  open.mutable_settings()->set_max_vertical_fov_rad(1.5);
  for_each_setting(open, [&](const FoundSetting& setting) {
    if (setting.path != path) return;
    if (setting.field.cpp_type() == FieldDescriptor::CPPTYPE_UINT32)
      setting.message.GetReflection()->SetUInt32(&setting.message, &setting.field, static_cast<uint32_t>(value));
    else
      setting.message.GetReflection()->SetDouble(&setting.message, &setting.field, value);
  });
  return refused(open);
}

TEST(SettingRanges, EverySettingIsKeptInItsRange) {
  v1::OpenSession defaults = wire_of({});
  defaults.mutable_settings()->set_min_vertical_fov_rad(0.5);
  int tried = 0;
  for_each_setting(defaults, [&](const FoundSetting& setting) {
    if (setting.annotation.range().empty()) return;
    SCOPED_TRACE(setting.path);
    ++tried;
    const Range range = range_of(setting);
    const bool whole = setting.field.cpp_type() == FieldDescriptor::CPPTYPE_UINT32;
    const double step = whole ? 1 : 1e-6 * std::max(1.0, range.high);
    // The low end of a setting that bounds others can move those out of their range. So the test asks only that this
    // setting is not the one at fault.
    EXPECT_NE(refused_with(setting.path, range.low_open ? range.low + step : range.low), setting.path);
    EXPECT_NE(refused_with(setting.path, range.high_open ? range.high - step : range.high), setting.path);
    std::vector<double> wrong{range.high + step};
    if (range.low_open) wrong.push_back(range.low);
    if (range.high_open) wrong.push_back(range.high);
    if (range.or_zero) {
      EXPECT_NE(refused_with(setting.path, 0.0), setting.path);
      wrong.insert(wrong.end(), {-step, range.low / 2, std::numeric_limits<double>::denorm_min()});
    } else if (!whole || range.low >= 1) {
      wrong.push_back(std::min(range.low - step, std::nextafter(range.low, -kInfinity)));
    }
    if (!whole) wrong.insert(wrong.end(), {std::nan(""), kInfinity, -kInfinity});
    for (const double value : wrong) EXPECT_EQ(refused_with(setting.path, value), setting.path) << value;
  });
  EXPECT_GE(tried, 45);
}

TEST(SettingRanges, AllValuesOfAnEnumAreTakenAndNoOther) {
  v1::OpenSession open = wire_of({});
  for_each_setting(open, [&](const FoundSetting& setting) {
    if (setting.field.enum_type() == nullptr) return;
    const auto& reflection = *setting.message.GetReflection();
    const int count = setting.field.enum_type()->value_count();
    for (int value = 0; value <= count; ++value) {
      reflection.SetEnumValue(&setting.message, &setting.field, value);
      EXPECT_EQ(refused(open), value < count ? "" : setting.path);
    }
    reflection.SetEnumValue(&setting.message, &setting.field, 0);
  });
}

std::string value_text(const FoundSetting& setting) {
  const auto& reflection = *setting.message.GetReflection();
  if (const auto* values = setting.field.enum_type()) {
    const std::string name = values->FindValueByNumber(reflection.GetEnumValue(setting.message, &setting.field))
                                 ->name();
    return name.substr(values->value(0)->name().size() - std::string("UNSPECIFIED").size());
  }
  if (setting.field.cpp_type() == FieldDescriptor::CPPTYPE_BOOL)
    return reflection.GetBool(setting.message, &setting.field) ? "true" : "false";
  if (!reflection.HasField(setting.message, &setting.field)) return "";
  char text[32];
  std::snprintf(text, sizeof text, "%g", number_of(setting));
  return text;
}

TEST(SettingRanges, ThePresetsHaveTheValuesOfTheAnnotations) {
  for (const Preset preset : {Preset::kSightline, Preset::kPaper}) {
    v1::OpenSession open = wire_of(preset_settings(preset));
    for_each_setting(open, [&](const FoundSetting& setting) {
      const bool differs = preset == Preset::kPaper && !setting.annotation.paper_value().empty();
      EXPECT_EQ(value_text(setting), differs ? setting.annotation.paper_value() : setting.annotation.default_value())
          << setting.path;
    });
  }
}

TEST(SettingRanges, ACostWithoutAnyWeightIsRefused) {
  MoveSettings settings;
  settings.cost.occlusion = settings.cost.distance = settings.cost.route = 0;
  settings.cost.surroundings = settings.cost.steadiness = 1;
  ASSERT_FALSE(validate(settings));
  EXPECT_EQ(validate(settings).error().field, "tuning.move.cost");
  for (const auto weight : {&CostWeights::occlusion, &CostWeights::distance, &CostWeights::route}) {
    MoveSettings one = settings;
    one.cost.*weight = 1e-3;
    EXPECT_TRUE(validate(one));
  }
}

}  // namespace
}  // namespace sightline::test
