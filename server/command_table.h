// All flags and sub-commands of a program as data. Manual pages, completions of shells and the page about flags are
// made from it, so they agree with --help.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace sightline {

// One JSON object: `name`, `description`, `footer`, `takes_flags_of_parent`, `flags` and `commands`; each command is
// such an object. A flag has `names` ("--out"; a positional argument has its plain name), `description`, `type`,
// `default`, `choices`, and the truth values `positional`, `required`, `repeated` and `takes_value`.
std::string command_table(const CLI::App& app);

// Adds --describe, which prints the table and ends the program with 0. `app` must be complete when it parses.
void add_describe_flag(CLI::App& app);

}  // namespace sightline
