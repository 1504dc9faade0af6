#include "client/replay/compare_command.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "client/base/progress_bar.h"
#include "client/base/text_table.h"
#include "client/replay/compare_recordings.h"

namespace sightline {
namespace {

using nlohmann::ordered_json;

std::string hex(uint64_t hash) {
  return formatted("%016lx", static_cast<unsigned long>(hash));
}

ordered_json json_of(const FieldDifference& difference) {
  return {{"field", difference.path}, {"a", difference.a}, {"b", difference.b}};
}

ordered_json json_of(const ReplyDifference& difference) {
  ordered_json json = {{"sequence", difference.sequence}, {"time_s", difference.time_s}};
  json.update(json_of(difference.field));
  return json;
}

template <typename Difference>
ordered_json json_of(const std::optional<Difference>& difference) {
  return difference ? json_of(*difference) : ordered_json();
}

ordered_json json_of(const RecordingComparison& comparison) {
  const ReplyComparison& replies = comparison.replies;
  ordered_json fields = ordered_json::array();
  for (const FieldDeviation& deviation : replies.deviations()) {
    ordered_json field = {
        {"field", deviation.field}, {"replies", deviation.replies}, {"first_sequence", deviation.first_sequence}};
    if (deviation.is_number) field["largest"] = deviation.largest;
    fields.push_back(std::move(field));
  }
  return {{"equal", comparison.equal()},
          {"replies",
           {{"compared", replies.compared()},
            {"equal", replies.equal()},
            {"only_a", comparison.only_a},
            {"only_b", comparison.only_b},
            {"first", json_of(replies.first())},
            {"hash_a", hex(replies.hash_a())},
            {"hash_b", hex(replies.hash_b())},
            {"position_m", replies.position_m()},
            {"direction_deg", replies.direction_deg()},
            {"visible_share", replies.visible_share()},
            {"unknown_fields", replies.unknown()},
            {"fields", std::move(fields)}}},
          {"input",
           {{"compared", comparison.input.ticks},
            {"equal", comparison.input.equal},
            {"only_a", comparison.input.only_a},
            {"only_b", comparison.input.only_b},
            {"opening", json_of(comparison.input.opening)},
            {"first", json_of(comparison.input.first)}}},
          {"missing_messages", {{"a", comparison.missing_a}, {"b", comparison.missing_b}}}};
}

std::string counts(uint64_t compared, uint64_t equal, uint64_t only_a, uint64_t only_b) {
  std::string text = formatted("%lu in both, %lu equal", static_cast<unsigned long>(compared),
                               static_cast<unsigned long>(equal));
  if (only_a > 0) text += formatted(", %lu only in A", static_cast<unsigned long>(only_a));
  if (only_b > 0) text += formatted(", %lu only in B", static_cast<unsigned long>(only_b));
  return text;
}

void print_first(std::ostream& out, const std::optional<ReplyDifference>& first) {
  if (!first) return;
  out << formatted("  first     tick %lu at %.3f s: ", static_cast<unsigned long>(first->sequence), first->time_s)
      << first->field.path << ": " << first->field.a << " in A, " << first->field.b << " in B\n";
}

void print_fields(std::ostream& out, const std::vector<FieldDeviation>& deviations) {
  if (deviations.empty()) return;
  Table table({{"field"}, {"replies", true}, {"first tick", true}, {"largest", true}});
  for (const FieldDeviation& deviation : deviations)
    table.row({deviation.field, std::to_string(deviation.replies), std::to_string(deviation.first_sequence),
               deviation.is_number ? formatted("%.6g", deviation.largest) : "-"});
  table.print(out);
}

void print(std::ostream& out, const RecordingComparison& comparison) {
  const InputComparison& input = comparison.input;
  const ReplyComparison& replies = comparison.replies;
  out << "opening     ";
  if (input.opening)
    out << "differs: " << input.opening->path << ": " << input.opening->a << " in A, " << input.opening->b << " in B\n";
  else
    out << "equal\n";
  out << "ticks       " << counts(input.ticks, input.equal, input.only_a, input.only_b) << '\n';
  print_first(out, input.first);
  out << "replies     " << counts(replies.compared(), replies.equal(), comparison.only_a, comparison.only_b) << '\n';
  for (const std::string& field : replies.unknown())
    out << "  unknown   " << field << ": not in both contracts, not compared\n";
  print_first(out, replies.first());
  if (comparison.missing_a + comparison.missing_b > 0)
    out << formatted("gaps        %lu messages are missing in A, %lu in B\n",
                     static_cast<unsigned long>(comparison.missing_a),
                     static_cast<unsigned long>(comparison.missing_b));
  out << "hash        " << hex(replies.hash_a()) << " of A, " << hex(replies.hash_b()) << " of B\n";
  if (!replies.all_equal())
    out << formatted("at most     camera %.6g m and %.6g degrees apart, visible shares %.6g\n", replies.position_m(),
                     replies.direction_deg(), replies.visible_share());
  print_fields(out, replies.deviations());
  out << "result      " << (comparison.equal() ? "equal" : "differs") << '\n';
}

Result<bool> compare(const CompareOptions& options, std::ostream& out, std::ostream& err) {
  const auto a = Recording::open(options.a);
  if (!a) return tl::unexpected(a.error());
  const auto b = Recording::open(options.b);
  if (!b) return tl::unexpected(b.error());
  ProgressBar bar(err, options.progress);
  const auto length_ms = static_cast<size_t>(1e3 * a->duration_s()) + 1;
  const auto comparison = compare_recordings(*a, *b, [&](double at_s) {
    bar.show("compare", std::min(length_ms, static_cast<size_t>(1e3 * std::max(0.0, at_s))), length_ms);
  });
  bar.clear();
  if (!comparison) return tl::unexpected(comparison.error());
  if (options.json)
    out << json_of(*comparison).dump(2) << '\n';
  else
    print(out, *comparison);
  return comparison->equal();
}

}  // namespace

int run_compare_command(const CompareOptions& options, std::ostream& out, std::ostream& err) {
  const Result<bool> equal = compare(options, out, err);
  if (equal) return *equal ? 0 : 1;
  err << "sightline compare: " << to_string(equal.error()) << '\n';
  return 1;
}

Verb add_compare_verb(CLI::App& app) {
  const auto options = std::make_shared<CompareOptions>();
  options->progress = isatty(STDERR_FILENO) != 0;
  CLI::App* command = app.add_subcommand(
      "compare", "Say where the replies of two recordings of the same ticks differ, and by how much");
  command->add_option("a", options->a, "A recording (.mcap)")->required()->check(CLI::ExistingFile);
  command->add_option("b", options->b, "Another")->required()->check(CLI::ExistingFile);
  command->add_flag("--json", options->json, "One JSON object instead of a table");
  return {command, [options] { return run_compare_command(*options, std::cout, std::cerr); }};
}

}  // namespace sightline
