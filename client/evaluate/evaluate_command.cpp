#include "client/evaluate/evaluate_command.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "client/evaluate/evaluation_tables.h"
#include "client/evaluate/named_settings.h"
#include "client/evaluate/paper_suite.h"
#include "client/evaluate/paper_tables.h"
#include "client/evaluate/plot.h"
#include "client/base/progress_bar.h"
#include "scenes/catalog.h"
#include "server/base/cpu_budget.h"
#include "server/scene/gltf.h"

namespace sightline {
namespace {

using scenes::CatalogEntry;
using scenes::SceneRequest;

// ---- which scenes ----

SceneCase generated(const CatalogEntry& entry, std::string name, const SceneRequest& request) {
  const auto load = [&entry, request](GeometryStore& store) -> Result<Scenario> {
    const auto asset = read_gltf(entry.make(request), nullptr, store);
    if (!asset) return tl::unexpected(asset.error());
    return Scenario::from_asset(*asset);
  };
  return {std::move(name), request.seed, load};
}

// Scenes that are generated in several sizes, each of which is a case of its own.
struct Sizes {
  std::string_view scene;
  std::vector<int> sizes;
  void (*set)(SceneRequest& request, int size);
};

const Sizes* sizes_of(std::string_view scene) {
  static const std::array<Sizes, 2> kSizes{{
      {"arena", {2, 3, 4, 5, 6, 7, 8}, [](SceneRequest& request, int size) { request.arena_targets = size; }},
      {"crowd", {0, 10, 20, 35}, [](SceneRequest& request, int size) { request.crowd_movers = size; }},
  }};
  for (const Sizes& sizes : kSizes)
    if (sizes.scene == scene) return &sizes;
  return nullptr;
}

void add_seeds(const CatalogEntry& entry, const std::string& name, SceneRequest request, int seeds,
               std::vector<SceneCase>& cases) {
  for (int seed = 1; seed <= seeds; ++seed) {
    request.seed = static_cast<uint64_t>(seed);
    cases.push_back(generated(entry, name, request));
  }
}

void add_generated(const CatalogEntry& entry, int seeds, std::vector<SceneCase>& cases) {
  const std::string name(entry.name);
  const Sizes* sizes = sizes_of(entry.name);
  if (!sizes) return add_seeds(entry, name, {}, seeds, cases);
  for (const int size : sizes->sizes) {
    SceneRequest request;
    sizes->set(request, size);
    add_seeds(entry, std::string(name).append("-").append(std::to_string(size)), request, seeds, cases);
  }
}

void add_file(const std::string& path, int seeds, std::vector<SceneCase>& cases) {
  for (int seed = 1; seed <= seeds; ++seed)
    cases.push_back({std::filesystem::path(path).stem().string(), static_cast<uint64_t>(seed),
                     [path](GeometryStore& store) { return Scenario::read(path, store); }});
}

// A suite: a list of scene cases; its tables are those of every evaluation.
struct Suite {
  std::string_view name;
  void (*add)(int seeds, std::vector<SceneCase>& cases);
};

constexpr std::array<Suite, 1> kSuites{{
    {"scenes",
     [](int seeds, std::vector<SceneCase>& cases) {
       for (const CatalogEntry& entry : scenes::catalog()) add_generated(entry, seeds, cases);
     }},
}};

// Tables of its own, see paper_suite.h.
constexpr std::string_view kPaperSuite = "paper";

// What the user set, and a policy for each; nothing may be added later, as entries point at names and settings.
struct OwnPolicies {
  std::vector<NamedSettings> named;
  std::vector<PolicyEntry> entries;
};

Result<OwnPolicies> own_policies_of(const EvaluateOptions& options) {
  OwnPolicies own;
  for (const std::string& text : options.settings) {
    auto named = read_named_settings(text);
    if (!named) return tl::unexpected(named.error());
    const bool taken =
        std::any_of(own.named.begin(), own.named.end(), [&](const auto& n) { return n.name == named->name; });
    if (taken || find_policy(named->name))
      return invalid("settings",
                     std::string("there is already a policy \"").append(named->name).append("\""));
    own.named.push_back(std::move(*named));
  }
  for (const NamedSettings& named : own.named)
    own.entries.push_back({named.name, "settings given by the user", nullptr, &named.settings});
  return own;
}

Result<std::vector<const PolicyEntry*>> policies_of(const EvaluateOptions& options, const OwnPolicies& own) {
  std::vector<const PolicyEntry*> chosen;
  for (const std::string& name : options.policies)
    if (!find_policy(name)) return fail(ErrorCode::kNotFound, "policy", "no policy \"" + name + "\"");
  // In the table's order, each once, however they were asked for.
  for (const PolicyEntry& entry : policies()) {
    const bool asked =
        std::find(options.policies.begin(), options.policies.end(), entry.name) != options.policies.end();
    if (asked || options.policies.empty()) chosen.push_back(&entry);
  }
  for (const PolicyEntry& entry : own.entries) chosen.push_back(&entry);
  return chosen;
}

// ---- what is written ----

// A file name from any scene name.
std::string file_name(const std::string& scene) {
  std::string name = scene;
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c)) && c != '-' && c != '_') c = '_';
  return name;
}

class Folder {
 public:
  explicit Folder(std::filesystem::path path) : path_(std::move(path)) {}

  Status make() const {
    std::error_code trouble;
    std::filesystem::create_directories(path_ / "plots", trouble);
    if (trouble) return fail(ErrorCode::kUnavailable, path_.string(), trouble.message());
    return {};
  }
  Status write(const std::filesystem::path& name, const std::string& text) const {
    std::ofstream file(path_ / name, std::ios::binary);
    file << text;
    if (!file.flush()) return fail(ErrorCode::kUnavailable, (path_ / name).string(), "cannot be written");
    return {};
  }
  template <typename Writer>
  Status write_table(const std::filesystem::path& name, Writer writer,
                     std::span<const RunRecord> runs) const {
    std::ostringstream text;
    writer(text, runs);
    return write(name, text.str());
  }

 private:
  const std::filesystem::path path_;
};

Status write_tables(const Folder& folder, std::span<const RunRecord> runs) {
  if (auto done = folder.write_table("runs.csv", write_csv, runs); !done) return done;
  if (auto done = folder.write_table("runs.json", write_json, runs); !done) return done;
  if (auto done = folder.write_table("summary.md", write_summary, runs); !done) return done;
  return folder.write_table("timing.csv", write_timing, runs);
}

Status write_plots(const Folder& folder, const Evaluation& evaluation) {
  const std::filesystem::path plots("plots");
  const size_t policies_each = evaluation.runs.size() / evaluation.plans.size();
  for (size_t i = 0; i < evaluation.plans.size(); ++i) {
    const ScenePlan& plan = evaluation.plans[i];
    const auto runs = std::span(evaluation.runs).subspan(i * policies_each, policies_each);
    const std::string stem = file_name(plan.scene).append("-s").append(std::to_string(plan.seed));
    if (auto done = folder.write(plots / (stem + "-share.svg"), plot_shares(runs)); !done) return done;
    if (auto done = folder.write(plots / (stem + "-path.svg"), plot_paths(plan, runs)); !done) return done;
  }
  const std::vector<Group> groups = group_runs(evaluation.runs);
  for (const Figure& figure : figures()) {
    if (!figure.charted) continue;
    const std::string name = std::string("bars-").append(figure.name).append(".svg");
    if (auto done = folder.write(plots / name, plot_bars(figure, groups)); !done) return done;
  }
  return {};
}

EvaluationOptions playing_of(const EvaluateOptions& options) {
  EvaluationOptions how;
  how.rate_hz = options.rate_hz;
  how.duration_s = options.duration_s;
  how.picture_every = options.picture_every;
  how.jobs =
      options.jobs > 0 ? options.jobs : cpu_budget();
  return how;
}

void show(ProgressBar& bar, std::string_view what, double share) {
  bar.show(std::string(what), static_cast<size_t>(1000 * share), 1000);
}

Status write_paper(const Folder& folder, const PaperResults& results) {
  const auto write = [&](const char* name, auto writer, const auto& rows) {
    std::ostringstream text;
    writer(text, rows);
    return folder.write(name, text.str());
  };
  const std::vector<RunRecord>&hall = results.hall.runs, &fence = results.fence.runs;
  if (auto done = write("table1.csv", write_table1, results.timings); !done) return done;
  if (auto done = write("table2.csv", write_table2, hall); !done) return done;
  if (auto done = write("table3.csv", write_table3, fence); !done) return done;
  const std::filesystem::path plots("plots");
  const std::vector<Group> groups = group_runs(hall);
  for (const Figure& figure : figures()) {
    if (figure.name != "r_n" && figure.name != "r_p") continue;
    const std::string name = std::string("table2-").append(figure.name).append(".svg");
    if (auto done = folder.write(plots / name, plot_bars(figure, groups)); !done) return done;
  }
  const auto first_runs = std::span(fence).first(fence.size() / results.fence.plans.size());
  return folder.write(plots / "table3-offset.svg", plot_offsets(first_runs));
}

Status play_paper_into_folder(const EvaluateOptions& options, std::ostream& out, std::ostream& err) {
  if (!options.policies.empty()) return invalid("policy", "the suite \"paper\" has its own");
  PaperCases cases;
  add_generated(*scenes::find_scene("hall"), options.seeds, cases.hall);
  for (const char* name : {"fence", "fence-board"})
    add_generated(*scenes::find_scene(name), options.seeds, cases.fence);
  const Folder folder(options.out);
  if (auto made = folder.make(); !made) return made;
  ProgressBar bar(err, options.progress);
  PaperOptions how;
  how.timed_frames = options.timed_frames;
  how.playing = playing_of(options);
  how.progress = [&](std::string_view table, double share) { show(bar, table, share); };
  const auto results = play_paper(cases, how);
  bar.clear();
  if (!results) return tl::unexpected(results.error());
  if (auto done = write_paper(folder, *results); !done) return done;
  write_paper_summary(out, *results);
  out << "\nwritten to " << options.out << ": table1.csv, table2.csv, table3.csv, plots\n";
  return {};
}

Status evaluate_into_folder(const EvaluateOptions& options, std::ostream& out, std::ostream& err) {
  auto cases = cases_of(options);
  if (!cases) return tl::unexpected(cases.error());
  const auto own = own_policies_of(options);
  if (!own) return tl::unexpected(own.error());
  const auto chosen = policies_of(options, *own);
  if (!chosen) return tl::unexpected(chosen.error());
  const Folder folder(options.out);
  // Found out now rather than after the runs.
  if (auto made = folder.make(); !made) return made;
  ProgressBar bar(err, options.progress);
  EvaluationOptions how = playing_of(options);
  how.progress = [&](double share) { show(bar, "evaluate", share); };
  const auto evaluation = evaluate(*cases, *chosen, how);
  bar.clear();
  if (!evaluation) return tl::unexpected(evaluation.error());
  if (auto done = write_tables(folder, evaluation->runs); !done) return done;
  if (auto done = write_plots(folder, *evaluation); !done) return done;
  write_summary(out, evaluation->runs);
  out << "\nwritten to " << options.out << ": runs.csv, runs.json, summary.md, timing.csv, plots\n";
  return {};
}

}  // namespace

std::vector<std::string> suite_names() {
  std::vector<std::string> names;
  for (const Suite& suite : kSuites) names.emplace_back(suite.name);
  names.emplace_back(kPaperSuite);
  return names;
}

Result<std::vector<SceneCase>> cases_of(const EvaluateOptions& options) {
  std::vector<SceneCase> cases;
  if (options.suite.empty() == options.scenes.empty())
    return invalid("scene", "give either a suite or scenes");
  for (const Suite& suite : kSuites)
    if (suite.name == options.suite) suite.add(options.seeds, cases);
  for (const std::string& scene : options.scenes) {
    std::error_code trouble;
    if (const CatalogEntry* entry = scenes::find_scene(scene))
      add_generated(*entry, options.seeds, cases);
    else if (std::filesystem::is_regular_file(scene, trouble))
      add_file(scene, options.seeds, cases);
    else
      return fail(ErrorCode::kNotFound, "scene", "\"" + scene + "\" is neither a generated scene nor a file");
  }
  if (cases.empty()) return fail(ErrorCode::kNotFound, "suite", "no suite \"" + options.suite + "\"");
  return cases;
}

int run_evaluate_command(const EvaluateOptions& options, std::ostream& out, std::ostream& err) {
  const bool paper = options.suite == kPaperSuite && options.scenes.empty();
  const Status done =
      paper ? play_paper_into_folder(options, out, err) : evaluate_into_folder(options, out, err);
  if (!done) {
    err << "sightline evaluate: " << to_string(done.error()) << '\n';
    return 1;
  }
  return 0;
}

}  // namespace sightline
