#include "client/base/wire_presets.h"

#include <cctype>

namespace sightline {
namespace {

std::string lower_case(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

}  // namespace

std::vector<std::string> preset_names() {
  const google::protobuf::EnumDescriptor& presets = *v1::Settings::Preset_descriptor();
  std::vector<std::string> names;
  for (int i = 1; i < presets.value_count(); ++i) names.push_back(lower_case(presets.value(i)->name()));
  return names;
}

Result<v1::Settings::Preset> preset_named(const std::string& name) {
  const google::protobuf::EnumDescriptor& presets = *v1::Settings::Preset_descriptor();
  for (int i = 1; i < presets.value_count(); ++i)  // 0: not named
    if (lower_case(presets.value(i)->name()) == name)
      return static_cast<v1::Settings::Preset>(presets.value(i)->number());
  return invalid("--preset", "there is no preset " + name);
}

}  // namespace sightline
