#include "client/evaluate/paper_tables.h"

#include <algorithm>
#include <limits>
#include <numeric>

#include "client/evaluate/evaluation_tables.h"
#include "client/truth/metrics.h"

namespace sightline {
namespace {

using RunFigure = double (*)(const RunRecord& run);

struct NamedFigure {
  std::string_view name;
  RunFigure of;
};

constexpr NamedFigure kModelFigures[] = {
    {"r_n", [](const RunRecord& r) { return r.metrics.r_n; }},
    {"r_p", [](const RunRecord& r) { return r.metrics.r_p; }},
    {"r_p_tolerant", [](const RunRecord& r) { return r.metrics.r_p_tolerant; }},
    {"mean_hidden_share", [](const RunRecord& r) { return r.metrics.mean_hidden_share; }},
    {"joint_visible_share", [](const RunRecord& r) { return r.metrics.joint_visible_share(); }},
    {"d_c_m", [](const RunRecord& r) { return r.metrics.d_c_m; }},
    {"d_s_heights", [](const RunRecord& r) { return r.metrics.d_s_heights; }},
    {"step_time_ms", [](const RunRecord& r) { return r.timing.step_ms; }},
};

constexpr NamedFigure kStabilityFigures[] = {
    {"t_c_ms", [](const RunRecord& r) { return r.timing.step_ms; }},
    {"d_c_m", [](const RunRecord& r) { return r.metrics.d_c_m; }},
    {"d_s_heights", [](const RunRecord& r) { return r.metrics.d_s_heights; }},
    {"mean_visible_share", [](const RunRecord& r) { return r.metrics.mean_visible_share; }},
    {"joint_visible_share", [](const RunRecord& r) { return r.metrics.joint_visible_share(); }},
};
constexpr std::string_view kRatios[] = {"d_c_ratio", "d_s_ratio"};

std::vector<const RunRecord*> runs_of(std::span<const RunRecord> runs, std::string_view policy,
                                      std::string_view scene) {
  std::vector<const RunRecord*> chosen;
  for (const RunRecord& run : runs)
    if (run.policy == policy && run.scene == scene) chosen.push_back(&run);
  return chosen;
}

Spread spread_over(std::span<const RunRecord* const> runs, RunFigure of) {
  std::vector<double> values;
  for (const RunRecord* run : runs) values.push_back(of(*run));
  return spread_of(std::move(values));
}

// How many times less; rows that both stand still are equal.
double times_less(double reference, double value) {
  if (value > 0) return reference / value;
  return reference > 0 ? std::numeric_limits<double>::infinity() : 1.0;
}

// By seed; both in the order of seeds.
Spread ratio_over(std::span<const RunRecord* const> references, std::span<const RunRecord* const> runs,
                  RunFigure of) {
  std::vector<double> ratios;
  for (size_t i = 0; i < std::min(references.size(), runs.size()); ++i)
    ratios.push_back(times_less(of(*references[i]), of(*runs[i])));
  return spread_of(std::move(ratios));
}

void write_spread_head(std::ostream& out, std::string_view name) {
  for (const char* part : {"_mean", "_median", "_least", "_most"}) out << ',' << name << part;
}

void write_spread(std::ostream& out, const Spread& spread) {
  for (const double value : {spread.mean, spread.median, spread.least, spread.most})
    out << ',' << exact_text(value);
}

void write_percentiles(std::ostream& out, const Percentiles& times) {
  out << ',' << fixed(times.p50_ms, 4) << ',' << fixed(times.p95_ms, 4);
}

// All lasting occlusions of some runs.
struct Reactions {
  std::vector<double> delays_s;
  size_t unanswered = 0;
  double regain_s = 0.0;  // summed

  explicit Reactions(std::span<const RunRecord* const> runs) {
    for (const RunRecord* run : runs) {
      const ReactionMetrics& of_run = run->reaction;
      delays_s.insert(delays_s.end(), of_run.delays_s.begin(), of_run.delays_s.end());
      unanswered += of_run.unanswered;
      regain_s += of_run.mean_regain_s * static_cast<double>(of_run.occlusions);
    }
  }
  double mean_s() const { return spread_of(delays_s).mean; }
};

void write_reactions(std::ostream& out, const Reactions& reactions) {
  out << ',' << reactions.delays_s.size() << ',' << reactions.unanswered;
  if (reactions.delays_s.empty()) {
    out << ",,,";
    return;
  }
  out << ',' << exact_text(reactions.mean_s()) << ',' << exact_text(percentile(reactions.delays_s, 0.95))
      << ',' << exact_text(reactions.regain_s / static_cast<double>(reactions.delays_s.size()));
}

void summarize_table1(std::ostream& out, std::span<const TimingRow> rows) {
  out << "Table 1 (ms, medians; p95 in brackets)\n\n"
         "| sampler | settings | r | samples | render | intersect | select | total | paper's total |\n"
         "|---|---|--:|--:|--:|--:|--:|--:|--:|\n";
  for (const TimingRow& row : rows) {
    const PaperTiming* paper = paper_timing(row.resolution);
    out << "| " << row.sampler << " | " << row.settings << " | " << row.resolution << " | "
        << row.timing.samples;
    for (const Percentiles& stage : {row.timing.sample, row.timing.aggregate, row.timing.move})
      out << " | " << fixed(stage.p50_ms, 3);
    out << " | " << fixed(row.timing.total.p50_ms, 3) << " (" << fixed(row.timing.total.p95_ms, 3) << ")"
        << " | " << (paper ? fixed(paper->total_ms, 2) : "") << " |\n";
  }
}

void summarize_table2(std::ostream& out, std::span<const RunRecord> runs) {
  out << "\nTable 2 (means over seeds)\n\n| model | r_N | r_P | paper's r_N | paper's r_P | d_c m |\n"
         "|---|--:|--:|--:|--:|--:|\n";
  for (const ModelRow& row : model_rows()) {
    const auto of_row = runs_of(runs, row.policy->name, "hall");
    out << "| " << row.policy->name << " | " << percent(spread_over(of_row, kModelFigures[0].of).mean)
        << " | " << percent(spread_over(of_row, kModelFigures[1].of).mean) << " | "
        << (row.paper ? percent(row.paper->r_n) : "") << " | " << (row.paper ? percent(row.paper->r_p) : "")
        << " | " << fixed(spread_over(of_row, kModelFigures[5].of).mean, 1) << " |\n";
  }
}

void summarize_table3(std::ostream& out, std::span<const RunRecord> runs) {
  out << "\nTable 3 (medians over seeds)\n\n| stability | t_c ms | d_c m | d_s heights | paper's d_c | "
         "paper's d_s | "
         "mean reaction s |\n|---|--:|--:|--:|--:|--:|--:|\n";
  for (const StabilityRow& row : stability_rows()) {
    const auto of_row = runs_of(runs, row.policy->name, "fence");
    const Reactions reactions(runs_of(runs, row.policy->name, "fence-board"));
    out << "| " << row.policy->name;
    for (size_t i = 0; i < 3; ++i)
      out << " | " << fixed(spread_over(of_row, kStabilityFigures[i].of).median, 3);
    out << " | " << (row.paper ? fixed(row.paper->d_c, 1) : "") << " | "
        << (row.paper ? fixed(row.paper->d_s, 1) : "") << " | "
        << (reactions.delays_s.empty() ? "" : fixed(reactions.mean_s(), 3)) << " |\n";
  }
}

}  // namespace

Spread spread_of(std::vector<double> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  const size_t n = values.size();
  const double median = n % 2 == 1 ? values[n / 2] : (values[n / 2 - 1] + values[n / 2]) / 2;
  const double mean = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(n);
  return {mean, median, values.front(), values.back()};
}

void write_table1(std::ostream& out, std::span<const TimingRow> rows) {
  out << "sampler,renderer,settings,r,frames,samples,sample_p50_ms,sample_p95_ms,aggregate_p50_ms,aggregate_"
         "p95_ms,"
         "move_p50_ms,move_p95_ms,total_p50_ms,total_p95_ms,paper_samples,paper_render_ms,paper_intersect_ms,"
         "paper_select_ms,paper_total_ms\n";
  for (const TimingRow& row : rows) {
    out << row.sampler << ',' << quoted(row.renderer) << ',' << row.settings << ',' << row.resolution << ','
        << row.timing.frames << ',' << row.timing.samples;
    for (const Percentiles& times :
         {row.timing.sample, row.timing.aggregate, row.timing.move, row.timing.total})
      write_percentiles(out, times);
    if (const PaperTiming* paper = paper_timing(row.resolution))
      out << ',' << paper->samples << ',' << exact_text(paper->render_ms) << ','
          << exact_text(paper->intersect_ms) << ',' << exact_text(paper->select_ms) << ','
          << exact_text(paper->total_ms) << '\n';
    else
      out << ",,,,,\n";
  }
}

void write_table2(std::ostream& out, std::span<const RunRecord> runs) {
  out << "model,prediction_ms,runs,pictures";
  for (const NamedFigure& figure : kModelFigures) write_spread_head(out, figure.name);
  out << ",paper_r_n,paper_r_p\n";
  for (const ModelRow& row : model_rows()) {
    const auto of_row = runs_of(runs, row.policy->name, "hall");
    size_t pictures = 0;
    for (const RunRecord* run : of_row) pictures += run->metrics.pictures;
    out << row.model << ',' << (row.prediction_ms ? std::to_string(*row.prediction_ms) : "") << ','
        << of_row.size() << ',' << pictures;
    for (const NamedFigure& figure : kModelFigures) write_spread(out, spread_over(of_row, figure.of));
    out << ',' << (row.paper ? exact_text(row.paper->r_n) : "") << ','
        << (row.paper ? exact_text(row.paper->r_p) : "") << '\n';
  }
}

void write_table3(std::ostream& out, std::span<const RunRecord> runs) {
  out << "stability,runs";
  for (const NamedFigure& figure : kStabilityFigures) write_spread_head(out, figure.name);
  for (const std::string_view ratio : kRatios) write_spread_head(out, ratio);
  out << ",occlusions,unanswered,mean_reaction_s,p95_reaction_s,mean_regain_s,paper_t_c_ms,paper_d_c,paper_d_"
         "s\n";
  const std::vector<StabilityRow> rows = stability_rows();
  const auto unfiltered = runs_of(runs, rows.front().policy->name, "fence");
  for (const StabilityRow& row : rows) {
    const auto of_row = runs_of(runs, row.policy->name, "fence");
    out << row.policy->name << ',' << of_row.size();
    for (const NamedFigure& figure : kStabilityFigures) write_spread(out, spread_over(of_row, figure.of));
    for (const size_t i : {1u, 2u})
      write_spread(out, ratio_over(unfiltered, of_row, kStabilityFigures[i].of));
    write_reactions(out, Reactions(runs_of(runs, row.policy->name, "fence-board")));
    if (row.paper)
      out << ',' << exact_text(row.paper->t_c_ms) << ',' << exact_text(row.paper->d_c) << ','
          << exact_text(row.paper->d_s) << '\n';
    else
      out << ",,,\n";
  }
}

void write_paper_summary(std::ostream& out, const PaperResults& results) {
  summarize_table1(out, results.timings);
  if (!results.no_egl.empty()) out << "\nNo rows of EGL: " << results.no_egl << '\n';
  summarize_table2(out, results.hall.runs);
  summarize_table3(out, results.fence.runs);
}

}  // namespace sightline
