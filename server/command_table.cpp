#include "server/command_table.h"

#include <iostream>
#include <nlohmann/json.hpp>

namespace sightline {
namespace {

using nlohmann::ordered_json;

std::vector<std::string> names_of(const CLI::Option& option) {
  if (option.get_positional()) return {option.get_single_name()};
  std::vector<std::string> names;
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  return names;
}

// "TEXT:{auto,egl}" and "value in {auto->0,egl->1}" list the values that are allowed.
std::vector<std::string> choices_of(const std::string& type) {
  const size_t open = type.find('{'), close = type.find('}');
  std::vector<std::string> choices;
  if (open == std::string::npos || close == std::string::npos) return choices;
  for (std::string& word : CLI::detail::split(type.substr(open + 1, close - open - 1), ','))
    choices.push_back(word.substr(0, word.find("->")));
  return choices;
}

ordered_json flag_of(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  return {{"names", names_of(option)},
          {"description", option.get_description()},
          {"type", type},
          {"default", option.get_default_str()},
          {"choices", choices_of(type)},
          {"positional", option.get_positional()},
          {"required", option.get_required()},
          {"repeated", option.get_expected_max() > 1},
          {"takes_value", option.get_items_expected_max() > 0}};
}

ordered_json table_of(const CLI::App& app) {
  ordered_json table = {{"name", app.get_name()},         {"description", app.get_description()},
                        {"footer", app.get_footer()},     {"takes_flags_of_parent", app.get_fallthrough()},
                        {"flags", ordered_json::array()}, {"commands", ordered_json::array()}};
  for (const CLI::Option* option : app.get_options()) table["flags"].push_back(flag_of(*option));
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    table["commands"].push_back(table_of(*command));
  return table;
}

}  // namespace

std::string command_table(const CLI::App& app) {
  return table_of(app).dump(2);
}

void add_describe_flag(CLI::App& app) {
  const auto describe = [&app] {
    std::cout << command_table(app) << '\n';
    throw CLI::Success();
  };
  app.add_flag_callback("--describe", describe, "Print all flags and sub-commands as one JSON object, and exit")
      ->configurable(false);
}

}  // namespace sightline
