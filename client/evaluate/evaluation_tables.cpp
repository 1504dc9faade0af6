#include "client/evaluate/evaluation_tables.h"

#include <algorithm>
#include <charconv>
#include <iterator>
#include <nlohmann/json.hpp>
#include <numbers>

#include "client/base/text_table.h"

namespace sightline {
namespace {

using Run = RunRecord;

struct Column {
  std::string_view name;
  double (*of)(const Run& run);
};

constexpr Column kAnswerColumns[] = {
    {"longest_blind_with_way_s", [](const Run& r) { return r.longest_blind_with_way_s; }},
    {"mean_worth", [](const Run& r) { return r.coherence.mean_worth; }},
    {"mean_sight_loss", [](const Run& r) { return r.coherence.mean_sight_loss; }},
    {"mean_shot_loss", [](const Run& r) { return r.coherence.mean_shot_loss; }},
    {"as_asked_share", [](const Run& r) { return r.coherence.as_asked_share; }},
    {"shot_kept_share", [](const Run& r) { return r.coherence.kept_share; }},
    {"shot_deviation", [](const Run& r) { return mean_of(r.coherence.mean); }},
    {"shot_deviation_side", [](const Run& r) { return r.coherence.mean.side; }},
    {"shot_deviation_height", [](const Run& r) { return r.coherence.mean.height; }},
    {"shot_deviation_size", [](const Run& r) { return r.coherence.mean.size; }},
    {"shot_deviation_place", [](const Run& r) { return r.coherence.mean.place; }},
    {"asked_height_rad", [](const Run& r) { return r.coherence.asked_height_rad; }},
    {"median_height_rad", [](const Run& r) { return r.coherence.median_height_rad; }},
    {"high_share", [](const Run& r) { return r.coherence.high_share; }},
    {"mean_acceleration_mps2", [](const Run& r) { return r.coherence.mean_acceleration_mps2; }},
    {"target_changes", [](const Run& r) { return double(r.changes.changes); }},
    {"mean_change_answer_s", [](const Run& r) { return r.changes.mean_answer_s; }},
    {"longest_change_answer_s", [](const Run& r) { return r.changes.longest_answer_s; }},
    {"unanswered_changes", [](const Run& r) { return double(r.changes.unanswered); }},
    {"turns", [](const Run& r) { return double(r.turns.turns); }},
    {"mean_turn_answer_s", [](const Run& r) { return r.turns.mean_answer_s; }},
    {"unanswered_turns", [](const Run& r) { return double(r.turns.unanswered); }},
    {"sustained_occlusions", [](const Run& r) { return double(r.reaction.occlusions); }},
    {"mean_reaction_s", [](const Run& r) { return r.reaction.mean_delay_s; }},
    {"p95_reaction_s", [](const Run& r) { return r.reaction.p95_delay_s; }},
    {"mean_regain_s", [](const Run& r) { return r.reaction.mean_regain_s; }},
    {"unanswered_occlusions", [](const Run& r) { return double(r.reaction.unanswered); }},
};

// Only of runs that have reports.
constexpr Column kReportColumns[] = {
    {"reported_pairs", [](const Run& r) { return double(r.reports->pairs); }},
    {"reported_hidden_pairs", [](const Run& r) { return double(r.reports->hidden_pairs); }},
    {"false_visible", [](const Run& r) { return r.reports->visible.false_visible; }},
    {"false_occluded", [](const Run& r) { return r.reports->visible.false_occluded; }},
    {"share_error", [](const Run& r) { return r.reports->visible.mean_absolute_error; }},
    {"filtered_false_visible", [](const Run& r) { return r.reports->filtered.false_visible; }},
    {"filtered_false_occluded", [](const Run& r) { return r.reports->filtered.false_occluded; }},
    {"filtered_share_error", [](const Run& r) { return r.reports->filtered.mean_absolute_error; }},
};

// Only of runs that have a status.
constexpr Column kStatusColumns[] = {
    {"tracking_while_lost", [](const Run& r) { return r.status->tracking_while_lost; }},
    {"lost_called_tracking", [](const Run& r) { return r.status->lost_called_tracking; }},
    {"tracking_while_half_hidden", [](const Run& r) { return r.status->tracking_while_half_hidden; }},
};

// Only of runs that have goals.
constexpr Column kGoalColumns[] = {
    {"goal_jumps_per_s", [](const Run& r) { return r.goals->jumps_per_s; }},
};

// Only of Sightline's own policies.
constexpr Column kVolumeColumns[] = {
    {"pair_volume_share", [](const Run& r) { return *r.pair_volume_share; }},
};

// A group of columns that a run may lack.
struct OptionalColumns {
  std::span<const Column> columns;
  bool (*has)(const Run& run);
};
constexpr OptionalColumns kOptionalColumns[] = {
    {kReportColumns, [](const Run& r) { return r.reports.has_value(); }},
    {kStatusColumns, [](const Run& r) { return r.status.has_value(); }},
    {kGoalColumns, [](const Run& r) { return r.goals.has_value(); }},
    {kVolumeColumns, [](const Run& r) { return r.pair_volume_share.has_value(); }},
};

constexpr std::string_view kLegend = R"(
Means over seeds. Collisions and violations are frames, summed over seeds; blind and with way are the longest of any seed.
  joint           share of pictures in which the part of every target that is inside is visible to 95 %
  whole           share of pictures in which every target is visible to 95 %, and 95 % of its outline are inside
  worth           mean worth of a picture, 0 to 1: whole bodies, in the shot of the first frame (server/move/picture_worth.h)
  size            height of the largest target in picture heights, 95th percentile; from 1 on it is cut off
  asked, height   elevation of the camera over the targets in degrees: in the first frame, and the median
  of ceiling      joint and worth as shares of what the policies ceiling and ceiling-worth reach
  at most         upper estimates of the joint share and of the worth of any camera
  r_N             share of pictures without a visible pixel of any target
  blind           longest stretch of such pictures
  with way        longest part of one in which a place that sees a target could be reached within 2 s
  episodes        how often a target is lost from sight
  d_c             length of the camera's path
  shot kept       share of frames in which side, height, size and place each deviate from the first frame's by at most 0.5
  deviation       mean of these four, each from 0 (within its free band) to 1 (beyond its limit)
  accel.          mean size of the camera's acceleration
  at a_max        share of frames at the acceleration limit
  jerk            root mean square
  reversals       the camera turns back
  goals           the camera's goal moves more than 0.5 m within 1/30 s
  false TRACKING  share of pictures that have this status and no visible pixel of any target
  reaction        from the onset of an occlusion until the camera leaves its course or sees the target again
  report error    mean absolute error of the filtered visible share that the policy reports
)";

// In quotes, with quotes doubled: a user's file may have any name.
std::string quoted(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"') out += '"';
    out += c;
  }
  return out + '"';
}

void write_identity(std::ostream& out, const Run& run) {
  out << quoted(run.scene) << ',' << run.seed << ',' << run.target_count << ',' << quoted(run.policy);
}

// The runs of one scene's seeds under one policy.
using Group = std::vector<const Run*>;

std::vector<Group> group_runs(std::span<const Run> runs) {
  std::vector<Group> groups;
  for (const Run& run : runs) {
    const auto group = std::find_if(groups.begin(), groups.end(), [&](const Group& g) {
      return g.front()->scene == run.scene && g.front()->policy == run.policy;
    });
    group == groups.end() ? groups.push_back({&run}) : group->push_back(&run);
  }
  return groups;
}

template <typename Has>
Group only(const Group& group, Has has) {
  Group some;
  std::copy_if(group.begin(), group.end(), std::back_inserter(some), [&](const Run* run) { return has(*run); });
  return some;
}

template <typename Value>
double sum(const Group& group, Value value) {
  double total = 0.0;
  for (const Run* run : group) total += static_cast<double>(value(*run));
  return total;
}

template <typename Value>
double mean(const Group& group, Value value) {
  return sum(group, value) / static_cast<double>(group.size());
}

// The group's mean as a share of a ceiling's mean, over the seeds that both have played. It is empty if the ceiling did
// not play or reaches nothing.
template <typename Value>
std::string share_of_ceiling(std::string_view name, const Group& group, const std::vector<Group>& groups, Value value) {
  double own = 0.0, most = 0.0;
  for (const Group& other : groups) {
    if (other.front()->policy != name || other.front()->scene != group.front()->scene) continue;
    for (const Run* ceiling : other)
      for (const Run* run : group)
        if (run->seed == ceiling->seed) {
          own += value(*run);
          most += value(*ceiling);
        }
  }
  return most > 0 ? formatted("%.1f %%", 100 * own / most) : "";
}

template <typename Value>
double greatest(const Group& group, Value value) {
  double most = value(*group.front());
  for (const Run* run : group) most = std::max<double>(most, value(*run));
  return most;
}

double degrees(double rad) {
  return rad * 180 / std::numbers::pi;
}

std::string percent(double share) {
  return formatted("%.2f %%", 100 * share);
}

}  // namespace

void write_runs(std::ostream& out, std::span<const Run> runs) {
  out << "scene,seed,targets,policy";
  for (const RunFigure& figure : run_figures()) out << ',' << figure.name;
  for (const Column& column : kAnswerColumns) out << ',' << column.name;
  for (const OptionalColumns& group : kOptionalColumns)
    for (const Column& column : group.columns) out << ',' << column.name;
  out << ",most_joint,most_worth,reaction_delays_s\n";
  for (const Run& run : runs) {
    write_identity(out, run);
    for (const RunFigure& figure : run_figures()) out << ',' << exact_text(figure.of(run.metrics));
    for (const Column& column : kAnswerColumns) out << ',' << exact_text(column.of(run));
    for (const OptionalColumns& group : kOptionalColumns)
      for (const Column& column : group.columns) out << ',' << (group.has(run) ? exact_text(column.of(run)) : "");
    out << ',' << (run.most_joint ? exact_text(*run.most_joint) : "") << ','
        << (run.most_worth ? exact_text(*run.most_worth) : "") << ",\"";
    for (const double delay_s : run.reaction.delays_s) out << exact_text(delay_s) << ' ';
    out << "\"\n";
  }
}

void write_pictures(std::ostream& out, std::span<const Run> runs) {
  out << "scene,seed,targets,policy,time_s,camera_x_m,camera_y_m,camera_z_m,least_whole_share,lost,"
         "tracking\n";
  for (const Run& run : runs)
    for (const JudgedPicture& picture : run.pictures) {
      write_identity(out, run);
      const glm::dvec3& p = picture.camera_m;
      for (const double value : {picture.time_s, p.x, p.y, p.z, picture.least_whole_share})
        out << ',' << exact_text(value);
      out << ',' << picture.lost << ',' << (picture.tracking ? std::to_string(*picture.tracking) : "") << '\n';
    }
}

void write_reasons(std::ostream& out, std::span<const Run> runs) {
  out << "scene,seed,targets,policy,reason,claims,false_claims\n";
  const auto write = [&](const Run& run, std::string_view claim, size_t claims, size_t false_claims) {
    if (claims == 0) return;
    write_identity(out, run);
    out << ',' << claim << ',' << claims << ',' << false_claims << '\n';
  };
  for (const Run& run : runs) {
    for (const auto& [reason, count] : run.reasons) write(run, to_string(reason), count.claims, count.false_claims);
    const ObstructionCounts& counts = run.obstructions;
    write(run, "obstruction_expected", counts.announced, counts.announced - counts.came_true);
    write(run, "obstruction_not_expected", counts.began, counts.began - counts.began_announced);
  }
}

void write_timing(std::ostream& out, std::span<const Run> runs) {
  out << "scene,seed,targets,policy,run_s,step_ms\n";
  for (const Run& run : runs) {
    write_identity(out, run);
    out << formatted(",%.3f,%.4f\n", run.timing.run_s, run.timing.step_ms);
  }
}

void print_summary(std::ostream& out, std::span<const Run> runs) {
  Table table({{"scene"},
               {"policy"},
               {"runs", true},
               {"joint", true},
               {"whole", true},
               {"worth", true},
               {"size", true},
               {"asked", true},
               {"height", true},
               {"joint of ceiling", true},
               {"joint at most", true},
               {"worth of ceiling", true},
               {"worth at most", true},
               {"r_N", true},
               {"blind s", true},
               {"with way s", true},
               {"episodes", true},
               {"collisions", true},
               {"violations", true},
               {"d_c m", true},
               {"shot kept", true},
               {"deviation", true},
               {"accel. m/s2", true},
               {"at a_max", true},
               {"jerk m/s3", true},
               {"reversals/s", true},
               {"goals/s", true},
               {"false TRACKING", true},
               {"reaction s", true},
               {"report error", true}});
  const std::vector<Group> groups = group_runs(runs);
  for (const Group& group : groups) {
    const auto of = [&](const char* format, auto value) { return formatted(format, mean(group, value)); };
    const Group goals = only(group, [](const Run& r) { return r.goals.has_value(); });
    const Group status = only(group, [](const Run& r) { return r.status.has_value(); });
    const Group reports = only(group, [](const Run& r) { return r.reports.has_value(); });
    const auto total = [&](auto value) { return formatted("%.0f", sum(group, value)); };
    table.row(
        {printable(group.front()->scene),
         group.front()->policy,
         std::to_string(group.size()),
         percent(mean(group, [](const Run& r) { return r.metrics.joint_visible_share(); })),
         percent(mean(group, [](const Run& r) { return r.metrics.joint_whole_share; })),
         of("%.2f", [](const Run& r) { return r.coherence.mean_worth; }),
         of("%.2f", [](const Run& r) { return r.metrics.p95_size_pictures; }),
         of("%.0f", [](const Run& r) { return degrees(r.coherence.asked_height_rad); }),
         of("%.0f", [](const Run& r) { return degrees(r.coherence.median_height_rad); }),
         share_of_ceiling(kCeilingName, group, groups, [](const Run& r) { return r.metrics.joint_visible_share(); }),
         group.front()->most_joint ? percent(mean(group, [](const Run& r) { return *r.most_joint; })) : "",
         share_of_ceiling(kWorthCeilingName, group, groups, [](const Run& r) { return r.coherence.mean_worth; }),
         group.front()->most_worth ? of("%.2f", [](const Run& r) { return *r.most_worth; }) : "",
         percent(mean(group, [](const Run& r) { return r.metrics.r_n; })),
         formatted("%.1f", greatest(group, [](const Run& r) { return r.metrics.longest_blind_s; })),
         formatted("%.1f", greatest(group, [](const Run& r) { return r.longest_blind_with_way_s; })),
         of("%.1f", [](const Run& r) { return r.metrics.episodes.count; }),
         total([](const Run& r) { return r.metrics.body_collisions; }),
         total([](const Run& r) { return r.metrics.limit_violations; }),
         of("%.1f", [](const Run& r) { return r.metrics.d_c_m; }),
         percent(mean(group, [](const Run& r) { return r.coherence.kept_share; })),
         of("%.2f", [](const Run& r) { return mean_of(r.coherence.mean); }),
         of("%.2f", [](const Run& r) { return r.coherence.mean_acceleration_mps2; }),
         percent(mean(group, [](const Run& r) { return r.metrics.acceleration_limit_share; })),
         of("%.0f", [](const Run& r) { return r.metrics.rms_jerk_mps3; }),
         of("%.2f", [](const Run& r) { return r.metrics.reversals_per_s; }),
         goals.empty() ? "" : formatted("%.2f", mean(goals, [](const Run& r) { return r.goals->jumps_per_s; })),
         status.empty() ? "" : percent(mean(status, [](const Run& r) { return r.status->tracking_while_lost; })),
         of("%.2f", [](const Run& r) { return r.reaction.mean_delay_s; }),
         reports.empty() ? "" : formatted("%.3f", mean(reports, [](const Run& r) {
                                            return r.reports->filtered.mean_absolute_error;
                                          }))});
  }
  table.print(out);
  out << kLegend;
}

nlohmann::ordered_json summary_json(std::span<const Run> runs) {
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const Group& group : group_runs(runs)) {
    nlohmann::ordered_json& row = rows.emplace_back();
    row = {{"scene", group.front()->scene}, {"policy", group.front()->policy}, {"runs", group.size()}};
    const auto put = [&](std::string_view name, auto of) { row[std::string(name)] = mean(group, of); };
    for (const RunFigure& figure : run_figures())
      put(figure.name, [&](const Run& run) { return figure.of(run.metrics); });
    for (const Column& column : kAnswerColumns) put(column.name, column.of);
    for (const OptionalColumns& columns : kOptionalColumns)
      if (only(group, columns.has).size() == group.size())
        for (const Column& column : columns.columns) put(column.name, column.of);
    if (group.front()->most_joint) put("most_joint", [](const Run& run) { return *run.most_joint; });
    if (group.front()->most_worth) put("most_worth", [](const Run& run) { return *run.most_worth; });
  }
  return rows;
}

std::string exact_text(double value) {
  char text[64];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  return {text, end};
}

}  // namespace sightline
