#include "client/shots/shots_command.h"

#include <google/protobuf/util/json_util.h>

#include <CLI/CLI.hpp>
#include <iomanip>
#include <iostream>
#include <memory>

#include "client/shots/named_shots.h"

namespace sightline {
namespace {

void list_shots(std::ostream& out) {
  size_t widest = 0;
  for (const NamedShot& shot : named_shots()) widest = std::max(widest, shot.name.size());
  for (const NamedShot& shot : named_shots())
    out << std::left << std::setw(static_cast<int>(widest) + 2) << shot.name << shot.shows << '\n';
}

}  // namespace

int run_shots_command(const ShotsOptions& options, std::ostream& out, std::ostream& err) {
  if (options.name.empty()) {
    if (options.json)
      out << "{\"shots\": " << shots_json() << "}\n";
    else
      list_shots(out);
    return 0;
  }
  const auto tick = named_shot(options.name, options.subject, options.other);
  if (!tick) {
    err << "sightline shots: " << to_string(tick.error()) << '\n';
    return 1;
  }
  google::protobuf::util::JsonPrintOptions print;
  print.add_whitespace = true;
  std::string json;
  if (!google::protobuf::util::MessageToJsonString(*tick, &json, print).ok()) return 1;
  out << json;
  return 0;
}

Verb add_shots_verb(CLI::App& app) {
  const auto options = std::make_shared<ShotsOptions>();
  CLI::App* command = app.add_subcommand(
      "shots", "List the named shots, or print one of them as the part of a Tick that asks for it");
  command->add_option("name", options->name, "The shot to print as JSON (default: list all)");
  command->add_option("--subject", options->subject,
                      "Id of the instance that the shot shows, or over whose shoulder it looks");
  command->add_option("--other", options->other, "Id of the other instance, for shots of two");
  command->add_flag(
      "--json", options->json,
      "One JSON object: the list, with $subject and $other for the ids. A single shot is always printed as JSON");
  return {command, [options] { return run_shots_command(*options, std::cout, std::cerr); }};
}

}  // namespace sightline
