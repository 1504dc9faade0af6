#include "client/evaluate/evaluate_command.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "client/base/progress_bar.h"
#include "client/evaluate/evaluation_tables.h"
#include "scenes/catalog.h"
#include "scenes/tile_set.h"
#include "server/base/cpu_budget.h"
#include "server/sample/sampler_choice.h"
#include "server/scene/gltf.h"

namespace sightline {
namespace {

using scenes::CatalogEntry;
using scenes::SceneGroup;
using scenes::SceneRequest;

// ---- which scenes ----

uint64_t seed_of(const EvaluateOptions& options, int k) {
  return options.first_seed + static_cast<uint64_t>(k);
}

void add_seeds(const CatalogEntry& entry, const std::string& name, SceneRequest request, const EvaluateOptions& options,
               std::vector<SceneCase>& cases) {
  request.tiles = options.tiles, request.motion = options.motion;
  for (int k = 0; k < options.seeds; ++k) {
    request.seed = seed_of(options, k);
    const auto load = [&entry, request](GeometryStore& store) -> Result<Scenario> {
      const auto bytes = entry.make(request);
      if (!bytes) return tl::unexpected(bytes.error());
      const auto asset = read_gltf(*bytes, nullptr, store);
      if (!asset) return tl::unexpected(asset.error());
      return Scenario::from_asset(*asset);
    };
    cases.push_back({name, request.seed, load});
  }
}

void add_sizes(const CatalogEntry& entry, int SceneRequest::*size, std::initializer_list<int> sizes,
               const EvaluateOptions& options, std::vector<SceneCase>& cases) {
  for (const int n : sizes) {
    SceneRequest request;
    request.*size = n;
    add_seeds(entry, std::string(entry.name).append("-").append(std::to_string(n)), request, options, cases);
  }
}

// Tiles and recordings are looked for before anything is played.
Status add_generated(const CatalogEntry& entry, const EvaluateOptions& options, std::vector<SceneCase>& cases) {
  if (entry.group == SceneGroup::kTiles)
    if (const auto tiles = scenes::read_tiles(scenes::tiles_folder(options.tiles)); !tiles)
      return tl::unexpected(tiles.error());
  if (entry.group == SceneGroup::kMotion)
    if (const auto made = entry.make({.motion = options.motion}); !made) return tl::unexpected(made.error());
  if (entry.name == "arena")
    add_sizes(entry, &SceneRequest::arena_targets, {2, 3, 4, 5, 6, 7, 8}, options, cases);
  else if (entry.name == "crowd")
    add_sizes(entry, &SceneRequest::crowd_movers, {0, 10, 20, 35}, options, cases);
  else
    add_seeds(entry, entry.name, {}, options, cases);
  return {};
}

Status add_group(const std::string& name, const EvaluateOptions& options, std::vector<SceneCase>& cases) {
  const auto group = scenes::find_group(name);
  if (!group) return fail(ErrorCode::kNotFound, "group", "no group \"" + name + "\"");
  for (const CatalogEntry* entry : scenes::scenes_of(*group))
    if (Status done = add_generated(*entry, options, cases); !done) return done;
  return {};
}

void add_file(const std::string& path, const EvaluateOptions& options, std::vector<SceneCase>& cases) {
  for (int k = 0; k < options.seeds; ++k)
    cases.push_back({std::filesystem::path(path).stem().string(), seed_of(options, k),
                     [path](GeometryStore& store) { return Scenario::read(path, store); }});
}

Status add_scene(const std::string& scene, const EvaluateOptions& options, std::vector<SceneCase>& cases) {
  std::error_code trouble;
  if (const CatalogEntry* entry = scenes::find_scene(scene)) return add_generated(*entry, options, cases);
  if (!std::filesystem::is_regular_file(scene, trouble))
    return fail(ErrorCode::kNotFound, "scene", "\"" + scene + "\" is neither a generated scene nor a file");
  add_file(scene, options, cases);
  return {};
}

// ---- which policies ----

bool has_name(const std::vector<PolicyEntry>& entries, const std::string& name) {
  return std::any_of(entries.begin(), entries.end(), [&](const PolicyEntry& e) { return e.name == name; });
}

// Built-in policies in the order of policies(), however they were asked for, then the user's own.
Result<std::vector<PolicyEntry>> policies_of(const EvaluateOptions& options) {
  const std::vector<PolicyEntry> known = policies();
  const auto& asked = options.policies;
  for (const std::string& name : asked)
    if (!has_name(known, name)) return fail(ErrorCode::kNotFound, "policy", "no policy \"" + name + "\"");
  std::vector<PolicyEntry> chosen;
  for (const PolicyEntry& entry : known)
    if (asked.empty() ? !is_ceiling(entry.name) : std::find(asked.begin(), asked.end(), entry.name) != asked.end())
      chosen.push_back(entry);
  for (const std::string& text : options.settings) {
    auto named = read_named_settings(text);
    if (!named) return tl::unexpected(named.error());
    if (has_name(known, named->name) || has_name(chosen, named->name))
      return invalid("settings", std::string("there is already a policy \"").append(named->name).append("\""));
    chosen.push_back(step_policy(std::move(named->name), named->settings, named->shot));
  }
  return chosen;
}

// ---- what is written ----

template <typename Writer>
Status write_table(const std::filesystem::path& path, Writer writer, std::span<const RunRecord> runs) {
  std::ofstream file(path, std::ios::binary);
  writer(file, runs);
  if (!file.flush()) return fail(ErrorCode::kUnavailable, path.string(), "cannot be written");
  return {};
}

Status evaluate_into_folder(const EvaluateOptions& options, std::ostream& out, std::ostream& err) {
  const auto cases = cases_of(options);
  if (!cases) return tl::unexpected(cases.error());
  const auto chosen = policies_of(options);
  if (!chosen) return tl::unexpected(chosen.error());
  const auto sampler = choose_sampler_device(options.sampler == "egl" ? SamplerChoice::kEgl : SamplerChoice::kEmbree,
                                             {});
  if (!sampler) return tl::unexpected(sampler.error());
  const std::filesystem::path folder(options.out);
  // Made before the runs, so that a folder that cannot be written is reported at once.
  std::error_code trouble;
  std::filesystem::create_directories(folder, trouble);
  if (trouble) return fail(ErrorCode::kUnavailable, options.out, trouble.message());
  const std::filesystem::path sheets = options.sheets ? folder / "sheets" : std::filesystem::path();
  if (options.sheets && !std::filesystem::create_directory(sheets, trouble) && trouble)
    return fail(ErrorCode::kUnavailable, sheets.string(), trouble.message());
  ProgressBar bar(err, options.progress);
  EvaluationOptions playing{.rate_hz = options.rate_hz,
                            .duration_s = options.duration_s,
                            .picture_every = options.picture_every,
                            .sheets = sheets.string(),
                            .jobs = options.jobs > 0 ? options.jobs : cpu_budget(),
                            .samplers = sampler->device.get(),
                            .progress = {}};
  playing.progress = [&](double share) { bar.show("evaluate", static_cast<size_t>(1000 * share), 1000); };
  const auto runs = evaluate(*cases, *chosen, playing);
  bar.clear();
  if (!runs) return tl::unexpected(runs.error());
  if (auto done = write_table(folder / "runs.csv", write_runs, *runs); !done) return done;
  if (auto done = write_table(folder / "pictures.csv", write_pictures, *runs); !done) return done;
  if (auto done = write_table(folder / "reasons.csv", write_reasons, *runs); !done) return done;
  if (auto done = write_table(folder / "timing.csv", write_timing, *runs); !done) return done;
  if (options.json) {
    const nlohmann::ordered_json json{{"folder", options.out}, {"figures", summary_json(*runs)}};
    out << json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << '\n';
    return {};
  }
  print_summary(out, *runs);
  out << "\nwritten to " << options.out << ": runs.csv, pictures.csv, reasons.csv, timing.csv\n";
  return {};
}

}  // namespace

Result<std::vector<SceneCase>> cases_of(const EvaluateOptions& options) {
  std::vector<SceneCase> cases;
  std::vector<std::string> groups = options.groups;
  if (groups.empty() && options.scenes.empty()) groups.emplace_back(scenes::name_of(SceneGroup::kStudy));
  for (const std::string& group : groups)
    if (Status done = add_group(group, options, cases); !done) return tl::unexpected(done.error());
  for (const std::string& scene : options.scenes)
    if (Status done = add_scene(scene, options, cases); !done) return tl::unexpected(done.error());
  return cases;
}

int run_evaluate_command(const EvaluateOptions& options, std::ostream& out, std::ostream& err) {
  if (const Status done = evaluate_into_folder(options, out, err); !done) {
    err << "sightline evaluate: " << to_string(done.error()) << '\n';
    return 1;
  }
  return 0;
}

}  // namespace sightline
