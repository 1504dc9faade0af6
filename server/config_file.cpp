#include "server/config_file.h"

#include <optional>

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

// The value of a line without its quotes and its comment. Nothing when a quote that is opened is not closed at the end
// of the value.
std::optional<std::string> value_of(const std::string& text) {
  const char quote = text.empty() ? '\0' : text.front();
  if (quote != '"' && quote != '\'') return trimmed(text.substr(0, text.find('#')));
  for (size_t end = text.find(quote, 1); end != std::string::npos; end = text.find(quote, end + 1)) {
    const std::string rest = trimmed(text.substr(end + 1));
    if (rest.empty() || rest.front() == '#') return text.substr(1, end - 1);
  }
  return std::nullopt;
}

}  // namespace

std::string why_not_in_file(const std::string& value) {
  if (value.find_first_of("\r\n") != std::string::npos)
    return "a value in a configuration file cannot have a line break";
  if (value != trimmed(value)) return "a value in a configuration file cannot begin or end with a blank";
  if (value.find('"') != std::string::npos && value.find('\'') != std::string::npos)
    return "a value in a configuration file cannot have both kinds of quotes";
  return {};
}

std::vector<CLI::ConfigItem> ConfigFile::from_config(std::istream& input) const {
  std::vector<CLI::ConfigItem> entries;
  std::string line;
  for (int number = 1; std::getline(input, line); ++number) {
    line = trimmed(line);
    if (!line.empty() && line.front() != '#' && line.front() != ';') entries.push_back(read_line(line, number));
  }
  return entries;
}

CLI::ConfigItem ConfigFile::read_line(const std::string& line, int number) const {
  const size_t equals = line.find('=');
  if (equals == std::string::npos) refuse(number, "`flag = value` is needed; got " + line);
  const std::string key = trimmed(line.substr(0, equals));
  const CLI::Option* const option = key.empty() ? nullptr : app_.get_option_no_throw("--" + key);
  if (!option || !option->get_configurable()) refuse(number, "there is no flag \"" + key + "\" that can be set here");
  if (!lines_.emplace(key, number).second) refuse(number, "\"" + key + "\" is set twice");
  const std::optional<std::string> value = value_of(trimmed(line.substr(equals + 1)));
  if (!value) refuse(number, "a quote that is opened must be closed at the end of the value; got " + line);
  if (const std::string why = why_not_in_file(*value); !why.empty()) refuse(number, why);
  return {{}, key, {*value}};
}

std::string ConfigFile::place_of(const std::string& message) const {
  const size_t colon = message.find(':');
  if (!message.starts_with("--") || colon == std::string::npos) return {};
  const auto line = lines_.find(message.substr(2, colon - 2));
  return line == lines_.end() ? "" : " (line " + std::to_string(line->second) + " of the configuration file)";
}

}  // namespace sightline
