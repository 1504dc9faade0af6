#include "client/evaluate/evaluation_tables.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <charconv>
#include <nlohmann/json.hpp>

#include "client/base/text_table.h"

namespace sightline {
namespace {

using Run = RunRecord;

double count(size_t n) {
  return static_cast<double>(n);
}

constexpr std::array<Figure, 40> kFigures{{
    {"frames", "frames", [](const Run& r) { return count(r.metrics.frames); }},
    {"pictures", "judged pictures", [](const Run& r) { return count(r.metrics.pictures); }},
    {"joint_visible_share", "Share of pictures with all targets visible to 95 %",
     [](const Run& r) { return r.metrics.all_clear(); }, true},
    {"all_seen", "Share of pictures with a pixel of every target",
     [](const Run& r) { return r.metrics.all_seen; }, true},
    {"mean_visible_share", "Mean visible share of a target",
     [](const Run& r) { return r.metrics.mean_visible_share; }, true},
    {"mean_hidden_share", "Mean hidden share of a target in the picture",
     [](const Run& r) { return r.metrics.mean_hidden_share; }, true},
    {"in_frame_share", "Share of pictures that hold a target's centre",
     [](const Run& r) { return r.metrics.in_frame_share; }, true},
    {"r_n", "r_N: share of pictures with no target visible", [](const Run& r) { return r.metrics.r_n; },
     true},
    {"r_p", "r_P: share of pictures with a target partly hidden", [](const Run& r) { return r.metrics.r_p; },
     true},
    {"r_p_tolerant", "r_P with 5 % tolerance", [](const Run& r) { return r.metrics.r_p_tolerant; }, true},
    {"episodes", "Episodes of lost sight", [](const Run& r) { return count(r.metrics.episodes.count); },
     true},
    {"p95_episode_s", "95th percentile of an episode's length, seconds",
     [](const Run& r) { return r.metrics.episodes.p95_length_s; }, true},
    {"mean_reacquire_s", "Mean time to reacquire 95 % of a lost target, seconds",
     [](const Run& r) { return r.metrics.episodes.mean_reacquire_s; }, true},
    {"never_reacquired", "episodes not made good by the end",
     [](const Run& r) { return count(r.metrics.episodes.never_reacquired); }},
    {"lasting_occlusions", "lasting occlusions", [](const Run& r) { return count(r.reaction.occlusions); }},
    {"mean_reaction_s", "Mean reaction delay to a lasting occlusion, seconds",
     [](const Run& r) { return r.reaction.mean_delay_s; }, true},
    {"p95_reaction_s", "95th percentile of the reaction delay, seconds",
     [](const Run& r) { return r.reaction.p95_delay_s; }},
    {"mean_regain_s", "Mean time until a lasting occlusion is over, seconds",
     [](const Run& r) { return r.reaction.mean_regain_s; }, true},
    {"unanswered_occlusions", "lasting occlusions without an answer",
     [](const Run& r) { return count(r.reaction.unanswered); }},
    {"d_c_m", "d_c: camera travel, metres", [](const Run& r) { return r.metrics.d_c_m; }, true},
    {"d_s_heights", "d_s: travel of the targets in the picture, picture heights",
     [](const Run& r) { return r.metrics.d_s_heights; }, true},
    {"rms_acceleration_mps2", "RMS acceleration, m/s2",
     [](const Run& r) { return r.metrics.rms_acceleration_mps2; }, true},
    {"peak_acceleration_mps2", "peak acceleration, m/s2",
     [](const Run& r) { return r.metrics.peak_acceleration_mps2; }},
    {"rms_jerk_mps3", "RMS jerk, m/s3", [](const Run& r) { return r.metrics.rms_jerk_mps3; }, true},
    {"peak_jerk_mps3", "peak jerk, m/s3", [](const Run& r) { return r.metrics.peak_jerk_mps3; }},
    {"peak_speed_mps", "peak speed, m/s", [](const Run& r) { return r.metrics.peak_speed_mps; }},
    {"peak_angular_speed_radps", "peak angular speed, rad/s",
     [](const Run& r) { return r.metrics.peak_angular_speed_radps; }},
    {"peak_angular_acceleration_radps2", "peak angular acceleration, rad/s2",
     [](const Run& r) { return r.metrics.peak_angular_acceleration_radps2; }},
    {"pops", "Jumps of over 0.5 m or 5 degrees without a cut",
     [](const Run& r) { return count(r.metrics.pops); }, true},
    {"body_collisions", "Frames in which the body touches a collider",
     [](const Run& r) { return count(r.metrics.body_collisions); }, true},
    {"least_clearance_m", "least clearance, metres",
     [](const Run& r) { return r.metrics.least_clearance_m; }},
    {"limit_violations", "Frames that break a motion limit",
     [](const Run& r) { return count(r.metrics.limit_violations); }, true},
    {"word_pairs", "judged words", [](const Run& r) { return count(r.words->pairs); }, false, true},
    {"word_hidden_pairs", "judged words of targets truly not visible",
     [](const Run& r) { return count(r.words->hidden_pairs); }, false, true},
    {"false_visible", "Said visible in this step, of what is not",
     [](const Run& r) { return r.words->visible.false_visible; }, true, true},
    {"false_occluded", "Said not visible in this step, of what is",
     [](const Run& r) { return r.words->visible.false_occluded; }, true, true},
    {"share_error", "Mean absolute error of the share reported of a step",
     [](const Run& r) { return r.words->visible.mean_absolute_error; }, true, true},
    {"filtered_false_visible", "Said visible over the last steps, of what is not",
     [](const Run& r) { return r.words->filtered.false_visible; }, true, true},
    {"filtered_false_occluded", "Said not visible over the last steps, of what is",
     [](const Run& r) { return r.words->filtered.false_occluded; }, true, true},
    {"filtered_share_error", "Mean absolute error of the share reported over the last steps",
     [](const Run& r) { return r.words->filtered.mean_absolute_error; }, true, true},
}};

// A cell of the summary must not end its row or its cell.
std::string in_cell(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '|') out += '\\';
    out += c == '\n' ? ' ' : c;
  }
  return out;
}

void write_identity(std::ostream& out, const Run& run) {
  out << quoted(run.scene) << ',' << run.seed << ',' << run.target_count << ',' << quoted(run.policy);
}

}  // namespace

std::span<const Figure> figures() {
  return kFigures;
}

bool has(const RunRecord& run, const Figure& figure) {
  return !figure.of_words || run.words.has_value();
}

double Group::mean(const Figure& figure) const {
  double sum = 0.0;
  size_t n = 0;
  for (const RunRecord* run : runs)
    if (has(*run, figure)) sum += figure.of(*run), ++n;
  return n == 0 ? 0.0 : sum / count(n);
}

double Group::mean(std::string_view figure_name) const {
  const auto found =
      std::find_if(kFigures.begin(), kFigures.end(), [&](const Figure& f) { return f.name == figure_name; });
  assert(found != kFigures.end());
  return mean(*found);
}

std::vector<Group> group_runs(std::span<const RunRecord> runs) {
  std::vector<Group> groups;
  for (const RunRecord& run : runs) {
    auto group = std::find_if(groups.begin(), groups.end(),
                              [&](const Group& g) { return g.scene == run.scene && g.policy == run.policy; });
    if (group == groups.end()) group = groups.insert(groups.end(), {run.scene, run.policy, {}});
    group->runs.push_back(&run);
  }
  return groups;
}

void write_csv(std::ostream& out, std::span<const RunRecord> runs) {
  out << "scene,seed,targets,policy";
  for (const Figure& figure : kFigures) out << ',' << figure.name;
  out << '\n';
  for (const RunRecord& run : runs) {
    write_identity(out, run);
    for (const Figure& figure : kFigures) {
      out << ',';
      if (has(run, figure)) out << exact_text(figure.of(run));
    }
    out << '\n';
  }
}

void write_json(std::ostream& out, std::span<const RunRecord> runs) {
  nlohmann::ordered_json json = nlohmann::ordered_json::array();
  for (const RunRecord& run : runs) {
    nlohmann::ordered_json row = {
        {"scene", run.scene}, {"seed", run.seed}, {"targets", run.target_count}, {"policy", run.policy}};
    for (const Figure& figure : kFigures) {
      if (has(run, figure))
        row[std::string(figure.name)] = figure.of(run);
      else
        row[std::string(figure.name)] = nullptr;
    }
    row["by_target"] = nlohmann::ordered_json::array();
    for (const TargetMetrics& target : run.metrics.targets)
      row["by_target"].push_back({{"id", target.id},
                                  {"name", target.name},
                                  {"mean_visible_share", target.mean_visible_share},
                                  {"in_frame_share", target.in_frame_share}});
    json.push_back(std::move(row));
  }
  // A file name need not be UTF-8.
  out << json.dump(2, ' ', false, nlohmann::ordered_json::error_handler_t::replace) << '\n';
}

namespace {

// Two cells, empty for a policy that says nothing.
std::string words_in_cells(const Group& group) {
  if (!group.runs.front()->words) return "| ";
  return fixed(group.mean("share_error"), 3) + ", " + fixed(group.mean("filtered_share_error"), 3) + " | " +
         percent(group.mean("filtered_false_visible")) + ", " +
         percent(group.mean("filtered_false_occluded"));
}

}  // namespace

void write_summary(std::ostream& out, std::span<const RunRecord> runs) {
  out << "Means over seeds. Joint visible share: pictures in which every target is visible to 95 %. "
         "Episodes: times a\n"
         "target was lost from sight. Collisions, violations and pops are summed over seeds. Error of the "
         "word: mean\n"
         "absolute error of the visible share that a policy reports, of one step and over the last steps; "
         "false words: over\n"
         "the last steps, said visible of what is not, and the reverse.\n\n"
         "| scene | policy | runs | joint visible share | r_N | r_P (5 %) | episodes | reacquire s | "
         "collisions | "
         "violations | pops | d_c m | d_s heights | jerk m/s3 | reaction s | error of the word | false words "
         "|\n"
         "|---|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n";
  for (const Group& group : group_runs(runs)) {
    const auto sum = [&](std::string_view name) {
      return fixed(group.mean(name) * count(group.runs.size()), 0);
    };
    out << "| " << in_cell(group.scene) << " | " << group.policy << " | " << group.runs.size() << " | "
        << percent(group.mean("joint_visible_share")) << " | " << percent(group.mean("r_n")) << " | "
        << percent(group.mean("r_p_tolerant")) << " | " << fixed(group.mean("episodes"), 1) << " | "
        << fixed(group.mean("mean_reacquire_s"), 2) << " | " << sum("body_collisions") << " | "
        << sum("limit_violations") << " | " << sum("pops") << " | " << fixed(group.mean("d_c_m"), 1) << " | "
        << fixed(group.mean("d_s_heights"), 1) << " | " << fixed(group.mean("rms_jerk_mps3"), 0) << " | "
        << fixed(group.mean("mean_reaction_s"), 2) << " | " << words_in_cells(group) << " |\n";
  }
}

void write_timing(std::ostream& out, std::span<const RunRecord> runs) {
  out << "scene,seed,targets,policy,run_s,step_ms\n";
  for (const RunRecord& run : runs) {
    write_identity(out, run);
    out << ',' << fixed(run.timing.run_s, 3) << ',' << fixed(run.timing.step_ms, 4) << '\n';
  }
}

std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"') out += '"';
    out += c;
  }
  out += '"';
  return out;
}

std::string fixed(double value, int digits) {
  return formatted("%.*f", digits, value);
}

std::string percent(double share) {
  return fixed(100 * share, 2) + " %";
}

std::string exact_text(double value) {
  char text[64];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  return {text, end};
}

}  // namespace sightline
