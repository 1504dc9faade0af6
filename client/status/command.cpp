#include "client/status/command.h"

#include <google/protobuf/util/json_util.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <thread>

#include "client/base/text_table.h"
#include "client/cpp/sightline_client.h"
#include "client/status/status_text.h"

namespace sightline {
namespace {

constexpr std::chrono::seconds kPatience{5};
constexpr const char* kClearScreen = "\x1b[H\x1b[J";

struct Reading {
  v1::GetServerInfoResponse info;
  v1::GetServerStatsResponse stats;
};

Result<Client> connect_to(const std::string& address, const ConnectionFlags& connection) {
  const auto credentials = read_credentials(connection);
  if (!credentials) return tl::unexpected(credentials.error());
  return Client::connect(address, kPatience, {}, *credentials);
}

Result<Reading> read_from(const std::string& address, const ConnectionFlags& connection) {
  auto client = connect_to(address, connection);
  if (!client) return tl::unexpected(std::move(client.error()));
  auto info = client->server_info(kPatience);
  if (!info) return tl::unexpected(std::move(info.error()));
  auto stats = client->server_stats(kPatience);
  if (!stats) return tl::unexpected(std::move(stats.error()));
  return Reading{std::move(*info), std::move(*stats)};
}

std::string json_of(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  options.always_print_primitive_fields = true;
  std::string text;
  (void)google::protobuf::util::MessageToJsonString(message, &text, options);
  return text;
}

void print_json(std::ostream& out, std::span<const v1::SessionFigures> sessions) {
  out << "{\"sessions\":[";
  for (size_t i = 0; i < sessions.size(); ++i) out << (i > 0 ? "," : "") << json_of(sessions[i]);
  out << "]}\n";
}

int cannot_ask(const std::string& address, const Error& error, std::ostream& err) {
  err << address << ": " << to_string(error) << '\n';
  return 1;
}

void show_window(const TopOptions& options, const Reading& reading, const Window& window, std::ostream& out) {
  if (options.json) {
    out << "{\"window\":" << json_of(window).dump() << ",\"stats\":" << json_of(reading.stats) << "}" << std::endl;
    return;
  }
  out << (options.terminal ? kClearScreen : "");
  print_state(out, options.address, reading.info, reading.stats);
  print_window(out << formatted("\nIn the last %.1f s\n", window.seconds), window);
  out << (options.terminal ? "" : "\n") << std::flush;
}

}  // namespace

int run_status_command(const StatusOptions& options, std::ostream& out, std::ostream& err) {
  const auto reading = read_from(options.address, options.connection);
  if (!reading) return cannot_ask(options.address, reading.error(), err);
  if (options.json) {
    out << "{\"info\":" << json_of(reading->info) << ",\"stats\":" << json_of(reading->stats) << "}\n";
  } else {
    print_state(out, options.address, reading->info, reading->stats);
    print_window(out << "\nSince the start\n", window_between({}, reading->stats));
  }
  return reading->stats.ready() ? 0 : 1;
}

int run_sessions_command(const StatusOptions& options, std::ostream& out, std::ostream& err) {
  auto client = connect_to(options.address, options.connection);
  if (!client) return cannot_ask(options.address, client.error(), err);
  const auto sessions = client->list_sessions(kPatience);
  if (!sessions) return cannot_ask(options.address, sessions.error(), err);
  if (options.json)
    print_json(out, *sessions);
  else
    print_sessions(out, *sessions);
  return 0;
}

int run_top_command(const TopOptions& options, std::ostream& out, std::ostream& err) {
  v1::GetServerStatsResponse before;
  for (uint64_t shown = 0;; ++shown) {
    const auto reading = read_from(options.address, options.connection);
    if (!reading) return cannot_ask(options.address, reading.error(), err);
    // A daemon that has started again counts from 0.
    if (reading->stats.uptime_s() < before.uptime_s()) before.Clear();
    if (shown > 0) show_window(options, *reading, window_between(before, reading->stats), out);
    if (options.count > 0 && shown == options.count) return 0;
    before = reading->stats;
    std::this_thread::sleep_for(std::chrono::duration<double>(options.interval_s));
  }
}

namespace {

// Other commands say --server, so both are understood.
void add_server_flag(CLI::App& command, std::string& address) {
  command.add_option("--server,--address", address, "Address of the daemon: host:port, or unix:PATH")
      ->capture_default_str();
}

}  // namespace

Verb add_sessions_verb(CLI::App& app) {
  const auto options = std::make_shared<StatusOptions>();
  options->address = kDefaultAddress;
  CLI::App* command = app.add_subcommand(
      "sessions", "List the open sessions of a running daemon, with what their cameras show; the worst come first");
  add_server_flag(*command, options->address);
  add_connection_flags(*command, options->connection);
  command->add_flag("--json", options->json, "One JSON object: `sessions`, all of them, as ListSessions lists them");
  return {command, [options] { return run_sessions_command(*options, std::cout, std::cerr); }};
}

Verb add_status_verb(CLI::App& app) {
  const auto options = std::make_shared<StatusOptions>();
  options->address = kDefaultAddress;
  CLI::App* command = app.add_subcommand(
      "status", "Print how a running daemon is: sessions, quality, limits, times of its steps");
  add_server_flag(*command, options->address);
  add_connection_flags(*command, options->connection);
  command->add_flag("--json", options->json,
                    "One JSON object: `info` and `stats`, as GetServerInfo and GetServerStats answer");
  return {command, [options] { return run_status_command(*options, std::cout, std::cerr); }};
}

Verb add_top_verb(CLI::App& app) {
  const auto options = std::make_shared<TopOptions>();
  options->address = kDefaultAddress;
  options->terminal = isatty(STDOUT_FILENO) != 0;
  CLI::App* command = app.add_subcommand(
      "top", "Show how a running daemon is, again and again, with what it did in each interval");
  add_server_flag(*command, options->address);
  add_connection_flags(*command, options->connection);
  command->add_option("--interval", options->interval_s, "Time between two readings, in seconds")
      ->check(CLI::Range(0.1, 3600.0))
      ->capture_default_str();
  command->add_option("--count", options->count, "Number of intervals to show; 0 means until it is stopped")
      ->capture_default_str();
  command->add_flag("--json", options->json,
                    "One JSON object a line for each interval: `window`, its rates and durations, and `stats`");
  return {command, [options] { return run_top_command(*options, std::cout, std::cerr); }};
}

}  // namespace sightline
