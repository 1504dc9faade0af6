#include "server/config_file.h"

#include <sstream>

namespace sightline {
namespace {

std::string trimmed(const std::string& text) {
  const size_t first = text.find_first_not_of(" \t\r");
  if (first == std::string::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

[[noreturn]] void refuse(int number, const std::string& why) {
  throw CLI::ConfigError("line " + std::to_string(number) + " of the configuration file: " + why);
}

}  // namespace

std::vector<CLI::ConfigItem> ConfigFile::from_config(std::istream& input) const {
  std::ostringstream text;
  std::string line;
  for (int number = 1; std::getline(input, line); ++number) {
    check_line(trimmed(line), number);
    text << line << '\n';
  }
  std::istringstream again(text.str());
  return CLI::ConfigTOML::from_config(again);
}

void ConfigFile::check_line(const std::string& line, int number) const {
  if (line.empty() || line.front() == '#' || line.front() == ';') return;
  const size_t equals = line.find('=');
  if (equals == std::string::npos) refuse(number, "`flag = value` is needed; got " + line);
  const std::string key = trimmed(line.substr(0, equals));
  const CLI::Option* const option = key.empty() ? nullptr : app_.get_option_no_throw("--" + key);
  if (!option || !option->get_configurable()) refuse(number, "there is no flag \"" + key + "\" that can be set here");
  if (!lines_.emplace(key, number).second) refuse(number, "\"" + key + "\" is set twice");
}

std::string ConfigFile::place_of(const std::string& message) const {
  const size_t colon = message.find(':');
  if (!message.starts_with("--") || colon == std::string::npos) return {};
  const auto line = lines_.find(message.substr(2, colon - 2));
  return line == lines_.end() ? "" : " (line " + std::to_string(line->second) + " of the configuration file)";
}

}  // namespace sightline
