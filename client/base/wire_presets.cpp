#include "client/base/wire_presets.h"

#include <google/protobuf/util/json_util.h>

#include <cctype>
#include <string_view>

namespace sightline {
namespace {

// PRESET_PAPER -> "paper"
std::string typed_name(const google::protobuf::EnumValueDescriptor& preset) {
  std::string name = preset.name().substr(std::string_view("PRESET_").size());
  for (char& c : name) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return name;
}

}  // namespace

std::vector<std::string> preset_names() {
  const google::protobuf::EnumDescriptor& presets = *v1::Settings::Preset_descriptor();
  std::vector<std::string> names;
  for (int i = 1; i < presets.value_count(); ++i) names.push_back(typed_name(*presets.value(i)));
  return names;
}

Result<v1::Settings::Preset> preset_named(const std::string& name) {
  const google::protobuf::EnumDescriptor& presets = *v1::Settings::Preset_descriptor();
  for (int i = 1; i < presets.value_count(); ++i)  // 0: unspecified
    if (typed_name(*presets.value(i)) == name) return static_cast<v1::Settings::Preset>(presets.value(i)->number());
  return invalid("--preset", "there is no preset " + name);
}

Result<v1::OpenSession> settings_from_json(const std::string& json) {
  v1::OpenSession given;
  const auto parsed = google::protobuf::util::JsonStringToMessage(json, &given);
  if (!parsed.ok()) return invalid("", std::string(parsed.message()));
  v1::OpenSession rest = given;
  rest.clear_settings(), rest.clear_tuning(), rest.clear_shot();
  if (rest.ByteSizeLong() > 0) return invalid("", "must hold \"settings\", \"tuning\" and \"shot\" only");
  return given;
}

}  // namespace sightline
