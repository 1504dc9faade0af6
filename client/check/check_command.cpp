#include "client/check/check_command.h"

#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "client/base/text_table.h"
#include "client/check/level_play.h"
#include "client/check/level_warnings.h"
#include "client/check/plan_picture.h"

namespace sightline {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kNoPlan = "none";

std::string plan_path(const CheckOptions& options) {
  if (!options.plan.empty()) return options.plan;
  return std::filesystem::path(options.level).stem().string() + "-plan.png";
}

std::string counted(size_t count, const char* what) {
  return grouped(count) + " " + what + (count == 1 ? "" : "s");
}

std::string roles_text(const Level& level, const LevelFacts& facts) {
  if (level.unplayable) return "not usable";
  if (!level.has_camera) return "none";
  return counted(facts.targets, "target") + ", " + counted(facts.occluders, "moving occluder") + ", 1 camera";
}

std::string names_text(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text.append(text.empty() ? "" : ", ").append(printable(name));
  return text.empty() ? "none" : text;
}

std::string play_text(const LevelPlay& play) {
  const RunMetrics& run = play.metrics;
  return formatted("%.0f s of ", play.duration_s) +
         (play.wandered ? "two people who wander" : "the level's own scenario") +
         formatted(": all whole in %.0f %% of the pictures, nobody seen in %.0f %%, ", 100.0 * run.joint_whole_share,
                   100.0 * run.r_n) +
         (run.body_collisions == 0 ? "and the camera touched nothing"
                                   : formatted("and the camera touched something in %zu frames", run.body_collisions));
}

// The results of the command.
struct Findings {
  LevelFacts facts;
  std::vector<LevelWarning> warnings;
  std::optional<LevelPlay> play;
};

void print(std::ostream& out, const CheckOptions& options, const Level& level, const Findings& findings) {
  const auto& [facts, warnings, play] = findings;
  const glm::dvec3 size = facts.size_m();
  out << "level        " << options.level << '\n'
      << "size         " << formatted("%.2f m along x, %.2f m high, %.2f m along z", size.x, size.y, size.z) << '\n'
      << "triangles    " << grouped(facts.triangles) << " as instanced, " << grouped(facts.stored_triangles)
      << " stored\n"
      << "instances    " << grouped(facts.instances) << ": " << grouped(facts.hiding) << " hide, "
      << grouped(facts.colliding) << " collide\n"
      << "see-through  " << names_text(facts.see_through_materials) << '\n'
      << "roles        " << roles_text(level, facts) << '\n';
  if (options.plan != kNoPlan) out << "plan         " << plan_path(options) << '\n';
  if (play) out << "played       " << play_text(*play) << '\n';
  out << "warnings     " << (warnings.empty() ? "none" : grouped(warnings.size())) << '\n';
  for (const LevelWarning& warning : warnings)
    out << "  " << warning.kind << ": " << printable(warning.text, 600) << '\n';
}

Json json_of(const glm::dvec3& v) {
  return {v.x, v.y, v.z};
}

Json json_of(const LevelPlay& play) {
  Json told = Json::parse(to_json(play.metrics));
  told["wandered"] = play.wandered;
  told["duration_s"] = play.duration_s;
  return told;
}

Json json_of(const CheckOptions& options, const Level& level, const Findings& findings) {
  const auto& [facts, warnings, play] = findings;
  Json told = Json::array();
  for (const LevelWarning& warning : warnings) told.push_back({{"kind", warning.kind}, {"text", warning.text}});
  Json roles = nullptr;
  if (level.has_camera) roles = {{"targets", facts.targets}, {"occluders", facts.occluders}};
  return {{"level", options.level},
          {"size_m", json_of(facts.size_m())},
          {"min_m", json_of(facts.min_m)},
          {"max_m", json_of(facts.max_m)},
          {"triangles", facts.triangles},
          {"stored_triangles", facts.stored_triangles},
          {"instances", facts.instances},
          {"hiding", facts.hiding},
          {"colliding", facts.colliding},
          {"see_through_materials", facts.see_through_materials},
          {"roles", std::move(roles)},
          {"plan", options.plan == kNoPlan ? Json() : Json(plan_path(options))},
          {"play", play ? json_of(*play) : Json()},
          {"warnings", std::move(told)}};
}

}  // namespace

int run_check_command(const CheckOptions& options, std::ostream& out, std::ostream& err) {
  const auto failed = [&](const Error& error) {
    err << options.level << ": " << to_string(error) << '\n';
    return 1;
  };
  const auto level = read_level(options.level);
  if (!level) return failed(level.error());
  Findings findings{facts_of(*level), {}, std::nullopt};
  findings.warnings = level_warnings(*level, findings.facts, surface_findings(*level));
  if (options.plan != kNoPlan)
    if (const Status written = write_png(draw_plan(*level, findings.facts), plan_path(options)); !written)
      return failed(written.error());
  if (options.play) {
    auto played = play_level(*level);
    if (!played) return failed(played.error());
    findings.play = std::move(*played);
  }
  if (options.json)
    // Names come from the file: what is no text is replaced, not refused.
    out << json_of(options, *level, findings).dump(2, ' ', false, Json::error_handler_t::replace) << '\n';
  else
    print(out, options, *level, findings);
  return options.strict && !findings.warnings.empty() ? 1 : 0;
}

Verb add_check_verb(CLI::App& app) {
  const auto options = std::make_shared<CheckOptions>();
  CLI::App* check = app.add_subcommand(
      "check", "Read a level as the daemon does; say what it holds and what is likely to be wrong, and draw a plan");
  check->add_option("level", options->level, "A .glb or .gltf")->required()->check(CLI::ExistingFile);
  check->add_option("--plan", options->plan,
                    "File for the plan from above, a PNG; none: no plan (default: the level's name with -plan.png, in "
                    "the working folder)");
  check->add_flag("--play", options->play,
                  "Also try a camera with the default settings on two people who wander through the level, or on its "
                  "own scenario; takes some seconds");
  check->add_flag("--strict", options->strict, "Exit with 1 when there are warnings");
  check->add_flag("--json", options->json, "One JSON object instead of text");
  return {check, [options] { return run_check_command(*options, std::cout, std::cerr); }};
}

}  // namespace sightline
