#include "client/evaluate/evaluate_command.h"

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "client/base/progress_bar.h"
#include "client/evaluate/evaluation_tables.h"
#include "scenes/catalog.h"
#include "server/base/cpu_budget.h"
#include "server/scene/gltf.h"

namespace sightline {
namespace {

using scenes::CatalogEntry;
using scenes::SceneRequest;

// ---- which scenes ----

void add_seeds(const CatalogEntry& entry, const std::string& name, SceneRequest request, int seeds,
               std::vector<SceneCase>& cases) {
  for (int seed = 1; seed <= seeds; ++seed) {
    request.seed = static_cast<uint64_t>(seed);
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
               int seeds, std::vector<SceneCase>& cases) {
  for (const int n : sizes) {
    SceneRequest request;
    request.*size = n;
    add_seeds(entry, std::string(entry.name).append("-").append(std::to_string(n)), request, seeds, cases);
  }
}

void add_generated(const CatalogEntry& entry, int seeds, std::vector<SceneCase>& cases) {
  if (entry.name == "arena")
    return add_sizes(entry, &SceneRequest::arena_targets, {2, 3, 4, 5, 6, 7, 8}, seeds, cases);
  if (entry.name == "crowd")
    return add_sizes(entry, &SceneRequest::crowd_movers, {0, 10, 20, 35}, seeds, cases);
  add_seeds(entry, std::string(entry.name), {}, seeds, cases);
}

void add_file(const std::string& path, int seeds, std::vector<SceneCase>& cases) {
  for (int seed = 1; seed <= seeds; ++seed)
    cases.push_back({std::filesystem::path(path).stem().string(), static_cast<uint64_t>(seed),
                     [path](GeometryStore& store) { return Scenario::read(path, store); }});
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
    if (asked.empty() || std::find(asked.begin(), asked.end(), entry.name) != asked.end())
      chosen.push_back(entry);
  for (const std::string& text : options.settings) {
    auto named = read_named_settings(text);
    if (!named) return tl::unexpected(named.error());
    if (has_name(known, named->name) || has_name(chosen, named->name))
      return invalid("settings",
                     std::string("there is already a policy \"").append(named->name).append("\""));
    chosen.push_back(step_policy(std::move(named->name), named->settings));
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
  const std::filesystem::path folder(options.out);
  // Made before the runs, so that a folder that cannot be written is reported at once.
  std::error_code trouble;
  std::filesystem::create_directories(folder, trouble);
  if (trouble) return fail(ErrorCode::kUnavailable, options.out, trouble.message());
  ProgressBar bar(err, options.progress);
  EvaluationOptions playing{.rate_hz = options.rate_hz,
                            .duration_s = options.duration_s,
                            .picture_every = options.picture_every,
                            .jobs = options.jobs > 0 ? options.jobs : cpu_budget(),
                            .progress = {}};
  playing.progress = [&](double share) { bar.show("evaluate", static_cast<size_t>(1000 * share), 1000); };
  const auto runs = evaluate(*cases, *chosen, playing);
  bar.clear();
  if (!runs) return tl::unexpected(runs.error());
  if (auto done = write_table(folder / "runs.csv", write_runs, *runs); !done) return done;
  if (auto done = write_table(folder / "pictures.csv", write_pictures, *runs); !done) return done;
  if (auto done = write_table(folder / "timing.csv", write_timing, *runs); !done) return done;
  print_summary(out, *runs);
  out << "\nwritten to " << options.out << ": runs.csv, pictures.csv, timing.csv\n";
  return {};
}

}  // namespace

Result<std::vector<SceneCase>> cases_of(const EvaluateOptions& options) {
  std::vector<SceneCase> cases;
  if (options.scenes.empty())
    for (const CatalogEntry& entry : scenes::catalog()) add_generated(entry, options.seeds, cases);
  for (const std::string& scene : options.scenes) {
    std::error_code trouble;
    if (const CatalogEntry* entry = scenes::find_scene(scene))
      add_generated(*entry, options.seeds, cases);
    else if (std::filesystem::is_regular_file(scene, trouble))
      add_file(scene, options.seeds, cases);
    else
      return fail(ErrorCode::kNotFound, "scene", "\"" + scene + "\" is neither a generated scene nor a file");
  }
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
