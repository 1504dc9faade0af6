// The file that --config names: one `flag = value` a line, as --print-config writes it.
#pragma once

#include <CLI/CLI.hpp>
#include <map>
#include <string>
#include <vector>

namespace sightline {

// Why --print-config could not write this value so that --config reads the same again: it has a line break, a blank at
// an end, or both kinds of quotes. Empty: it can.
std::string why_not_in_file(const std::string& value);

// Writes as CLI11 does. Reads a value in double or single quotes, or without; what follows `#` outside of quotes is a
// comment. Refuses every line that it does not understand, with its number. (CLI11 itself reads `#` in quotes as a
// comment, and lists, which no flag takes.)
class ConfigFile final : public CLI::ConfigTOML {
 public:
  // `app` must outlive it.
  explicit ConfigFile(const CLI::App& app) : app_(app) {}

  std::vector<CLI::ConfigItem> from_config(std::istream& input) const override;

  // " (line 3 of the configuration file)" for an error about a value from the file; otherwise empty. `message` is the
  // text of the error, which begins with the flag.
  std::string place_of(const std::string& message) const;

  // Forgets the lines of the file that was read, before another command line is parsed.
  void forget() { lines_.clear(); }

 private:
  CLI::ConfigItem read_line(const std::string& line, int number) const;

  const CLI::App& app_;
  mutable std::map<std::string, int> lines_;  // number by key; CLI11 calls from_config as const
};

}  // namespace sightline
