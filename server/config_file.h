// The file that --config names: one `flag = value` a line, as --print-config writes it.
#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <string>
#include <vector>

namespace sightline {

// Reads as CLI11 does, but refuses every line that it does not understand, with its number.
class ConfigFile final : public CLI::ConfigTOML {
 public:
  // `app` must outlive it.
  explicit ConfigFile(const CLI::App& app) : app_(app) {}

  std::vector<CLI::ConfigItem> from_config(std::istream& input) const override;

  // " (line 3 of the configuration file)" for an error about a value from the file; otherwise empty. `message` is the text of
  // the error, which begins with the flag.
  std::string place_of(const std::string& message) const;

 private:
  void check_line(const std::string& line, int number) const;

  const CLI::App& app_;
  mutable std::map<std::string, int> lines_;  // number by key; CLI11 calls from_config as const
};

}  // namespace sightline
